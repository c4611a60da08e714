"""The checkers of ``onboard.trace.check`` at every trial: they hear all buses, and share no code with the plant.

What the plant's oracle finds happened to bodies; what the checkers find was said on a bus. A trial is safe where
neither finds anything.
"""

from functools import partial
from typing import Any

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.medium import Medium, Tap
from bus_sim.run import FLEET, BusRun
from onboard.core.frame import Frame
from onboard.trace.check.checks import Checks
from onboard.trace.check.systems import rules_for


class Judges:
    """Listens to every bus of a run from before its start. ``disturbed``: frames are lost or doubled on purpose."""

    def __init__(self, run: BusRun[Any], *, disturbed: bool) -> None:
        self._site, self._seals = run.site, run.seals
        #: Rules that say that something must happen in time; all others are rules of safety.
        self._liveness = frozenset(rule.name for rule in rules_for(run.site) if rule.liveness)
        self._checks = Checks(run.site, disturbed=disturbed)
        self._listen(FLEET, run.fleet)
        for node_id, medium in run.devices.items():
            self._listen(run.site.machines[node_id].name, medium)

    def _listen(self, channel: str, medium: Medium) -> None:
        hear: Tap = partial(self._hear, channel)
        medium.tap(self._seals.proved(hear) if channel == FLEET else hear, errors=ErrorsHeard.NONE)

    def _hear(self, channel: str, frame: Frame, time_us: int, _: str) -> None:
        self._checks.feed(time_us, channel, frame)

    @property
    def is_unsafe(self) -> bool:
        """Whether a rule was broken that holds at any time, also under faults."""
        return bool(self._checks.verdict.counts.keys() - self._liveness)

    def excuse(self, until_us: int) -> None:
        """Faults last until then, loop time in us: what must happen in time has time from there."""
        self._checks.excuse(until_us)

    def excuse_clocks(self, until_us: int) -> None:
        """Clocks are wrong on purpose until then, loop time in us."""
        self._checks.excuse_clocks(until_us)

    def finish(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The run is over: what was unsafe, and what stood still though nothing was broken any more."""
        findings = self._checks.finish().findings
        unsafe = tuple(one.line(self._name) for one in findings if one.rule not in self._liveness)
        return unsafe, tuple(one.line(self._name) for one in findings if one.rule in self._liveness)

    def _name(self, node: int) -> str:
        machine = self._site.machines.get(node)
        return machine.name if machine is not None else str(node)
