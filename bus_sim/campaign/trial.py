"""One trial: a scenario is played to its end, and judged first for safety, then for what became of all who came."""

import asyncio
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from bus_sim.campaign.journal_points import Held
from bus_sim.campaign.judges import Judges
from bus_sim.campaign.limits import WallLimitError, event_limit, wall_limit, wall_limit_s
from bus_sim.campaign.recovery import Measure, RecoveryMeasure, clocks_right_us, is_of_clock
from bus_sim.campaign.report import CONVERGED_US, SERVED_AGAIN_US, RunVerdict, TrialReport
from bus_sim.demand import DemandError
from bus_sim.faults.arm import arm, check_faults
from bus_sim.faults.scenario import FaultScenario
from bus_sim.options import RunOptions
from bus_sim.run import BusRun, run_until
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stage import SystemStage
from bus_sim.virtual_time import EventLimitError, StandstillError, VirtualTimeLoop, run_on
from onboard.core.site import Site

#: Looks whether it is over, us.
STEP_US = 1_000_000
#: What the loop raises where virtual time does not go on, or not in time.
HANGS = (StandstillError, EventLimitError)
#: A wait that is longer than the same run's longest without faults by this counts as delayed, us: about one more task
#: before it.
DELAY_US = 60_000_000


class TrialWatch(Protocol):
    """Looks at one trial from outside, and changes nothing."""

    def begin(self, stage: SystemStage[Any]) -> None:
        """The run is connected and armed, and not switched on."""

    def is_over(self, now_us: int) -> bool:
        """Whether all is known that it looks for, at loop time ``now_us``; the trial goes on until then."""


def stage_of(
    site: Site, scenario: FaultScenario, loop: VirtualTimeLoop, trace: Path | None = None, *, devices: bool = False
) -> SystemStage[Any]:
    """A scenario's run, connected and not switched on; only faults of single frames are there.

    ``devices``: its trace has the device buses too.

    Raises ``DemandError`` for orders that the site cannot be brought, and for faults that it cannot have.
    """
    check_faults(scenario.faults, site)
    options = RunOptions(
        seed=scenario.seed, trace=trace, devices=devices, faults=scenario.faults, demand=scenario.demand
    )
    return simulated_of(site).stage(site, options, loop)


def play(
    site: Site,
    scenario: FaultScenario,
    *,
    usual_wait_s: float | None = None,
    trace: Path | None = None,
    devices: bool = False,
    watch: TrialWatch | None = None,
) -> TrialReport:
    """Play a scenario; ``usual_wait_s`` is the longest wait without its faults, where it is known."""

    async def begin() -> TrialReport:
        stage = stage_of(site, scenario, loop, trace, devices=devices)
        arm(stage.run, scenario.faults)
        if watch is not None:
            watch.begin(stage)
        return await play_stage(stage, scenario, usual_wait_s, loop, watch)

    loop = VirtualTimeLoop()
    loop.event_limit = event_limit(scenario.limit_s)
    try:
        with wall_limit(wall_limit_s(scenario.limit_s)):
            return run_on(loop, begin())
    except (WallLimitError, *HANGS) as hang:
        return hung(scenario, loop, hang)
    except DemandError:
        raise
    except Exception as problem:  # noqa: BLE001  # as in ``play_stage``: one in the loop's own callback comes out here
        return replace(hung(scenario, loop, problem), verdict=RunVerdict.CRASHED, error=_named(problem))


def hung(scenario: FaultScenario, loop: VirtualTimeLoop, why: BaseException) -> TrialReport:
    """What ran was torn out of the run: nothing more can be asked of it."""
    # Its tasks tell their errors whenever they are collected: to format one parses sources, and in the midst of another
    # parse CPython 3.11 breaks that off.
    loop.set_exception_handler(lambda _loop, _context: None)
    return TrialReport(scenario, RunVerdict.HUNG, simulated_s=loop.now_us() / 1e6, error=str(why))


async def play_stage(
    stage: SystemStage[Any],
    scenario: FaultScenario,
    usual_wait_s: float | None,
    loop: VirtualTimeLoop,
    watch: TrialWatch | None = None,
) -> TrialReport:
    """The same of a stage whose faults are armed."""
    judges = Judges(stage.run, disturbed=bool(scenario.faults))
    recovery = RecoveryMeasure(stage.run, scenario.faults)
    right_us = clocks_right_us(scenario.faults)
    if right_us is not None:
        judges.excuse_clocks(right_us)
    held = Held()
    stage.run.observers.append(held.hear)
    error, hang, ends, broken = "", "", _End(stage, recovery, watch), BrokenCallbacks(loop)

    def is_over() -> bool:
        is_broken = bool(broken.error) or stage.is_broken or judges.is_unsafe
        return is_broken or held.is_over(loop.now_us()) or ends(loop.now_us())

    try:
        stage.run.start()
        await run_until(
            stage.run,
            is_over,
            round(scenario.limit_s * 1e6),
            STEP_US,
            lambda: judges.excuse(recovery.healed_us),
        )
    except HANGS as problem:
        hang = str(problem)
    except Exception as problem:  # noqa: BLE001  # a program error in one seed must not end the campaign: it is a result
        error = _named(problem)
    finally:
        stage.run.close()
    return _judge(stage, scenario, usual_wait_s, (error or broken.error, hang), judges, recovery, held)


class BrokenCallbacks:
    """The first program error in a timer, or in who hears a bus: asyncio prints it and goes on.

    Whoever it befell has fallen silent: a person, a device, an attacker. What comes of the run then says nothing.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        #: Its type and its words; empty: none so far.
        self.error = ""
        loop.set_exception_handler(self._note)

    def _note(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        problem = context.get("exception")
        if isinstance(problem, Exception):
            self.error = self.error or _named(problem)
        loop.default_exception_handler(context)


def _named(problem: Exception) -> str:
    return f"{type(problem).__name__}: {problem}"


class _End:
    """When a trial is over: safety comes first, then all heals, then everything must converge."""

    def __init__(self, stage: SystemStage[Any], recovery: RecoveryMeasure, watch: TrialWatch | None) -> None:
        self._stage = stage
        self._watch = watch
        self._recovery = recovery
        self._over_us: int | None = None

    def __call__(self, now_us: int) -> bool:
        """Everybody is served or told why, all faults are over, and the mirrors agree or had all the time to."""
        if now_us < self._recovery.healed_us:
            return False
        self._recovery.look_at_waits(self._stage.waits_since)
        if not self._stage.is_over or (self._watch is not None and not self._watch.is_over(now_us)):
            return False
        self._over_us = max(self._over_us or now_us, self._recovery.healed_us)
        return self._recovery.mirrors_agree() or now_us - self._over_us >= CONVERGED_US


def _judge(
    stage: SystemStage[Any],
    scenario: FaultScenario,
    usual_wait_s: float | None,
    errors: tuple[str, str],
    judges: Judges,
    recovery: RecoveryMeasure,
    held: Held,
) -> TrialReport:
    (error, hang), tally = errors, stage.tally()
    unsafe, stalls = judges.finish()
    violations = (*stage.violations(), *unsafe)
    is_apart = stage.is_over and not recovery.mirrors_agree()
    halted = tuple(
        f"{controller.holon.machine.name}: {controller.holon.halted}"
        for controller in stage.run.controllers.values()
        if controller.holon.halted is not None
    )
    is_late = usual_wait_s is not None and tally.longest_wait_s > usual_wait_s + DELAY_US / 1e6
    verdicts = (
        (bool(violations), RunVerdict.VIOLATION),
        (bool(error), RunVerdict.CRASHED),
        (bool(hang or stage.run.restless), RunVerdict.HUNG),
        # Whoever waits for it now waits for a person, and has been told so.
        (bool(held.since_us), RunVerdict.HELD),
        (bool(tally.waiting and halted), RunVerdict.STOPPED),
        (bool(tally.waiting), RunVerdict.NOT_SERVED),
        (bool(stalls), RunVerdict.NOT_LIVE),
        (is_apart, RunVerdict.APART),
        (_heals_late(scenario, recovery), RunVerdict.LATE),
        (is_late, RunVerdict.DELAYED),
        (bool(tally.told), RunVerdict.TOLD),
        (True, RunVerdict.SERVED),
    )
    return TrialReport(
        scenario,
        next(verdict for holds, verdict in verdicts if holds),
        violations,
        stalls,
        halted,
        tally.served,
        tally.told,
        tally.full,
        tally.waiting,
        tally.longest_wait_s,
        stage.run.loop.now_us() / 1e6,
        _struck(stage.run),
        tuple((measure.value, us) for measure, us in sorted(recovery.longest_us.items())),
        is_apart,
        error or hang,
        stage.who,
    )


def _heals_late(scenario: FaultScenario, recovery: RecoveryMeasure) -> bool:
    """Whether clocks were all that was wrong, and who waited when they were right again was served too late.

    Or a person has had rights made anew, and the first of them was.
    """
    is_clocks, took_us = all(is_of_clock(fault) for fault in scenario.faults), recovery.longest_us
    late = is_clocks and took_us.get(Measure.HEAL_SERVED, 0) > SERVED_AGAIN_US
    return late or took_us.get(Measure.REPAIR_SERVES, 0) > SERVED_AGAIN_US


def _struck(run: BusRun[Any]) -> tuple[tuple[str, int], ...]:
    """How often faults of single frames struck, by kind of the frame fault."""
    struck: Counter[str] = Counter()
    for injector in run.fleet.injectors:
        struck[injector.fault.kind.value] += injector.struck
    return tuple(sorted(struck.items()))
