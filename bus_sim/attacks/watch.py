"""Looks at one attack from the bus and from outside: was it named, with which word, how soon; who works after it.

A machine names an attack by ``Diagnostic`` (what it did not take), ``Halted`` (why it stands) or ``SealFault`` (whose
frames have no good seal). What the attacker says itself does not count.
"""

from collections.abc import Collection
from typing import Any, Final

from bus_sim.campaign.recovery import ADMITTED
from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.faults.injection import Injection
from bus_sim.systems.stage import SystemStage
from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import Diagnostic, Halted, Message
from onboard.contract.seal import SealFault
from onboard.core.frame import Frame

#: Service is to be back so long after an attack's end, us (issue 18, point 2).
BACK_US: Final = 60_000_000
#: An attack is to be named within so many heartbeat periods, once the bus has room (issue 18, point 2).
NAMED_BEATS: Final = 2
#: Between two looks at who takes part, us: the resolution of ``back_us``.
_LOOK_US: Final = 500_000
#: After the attack nothing is looked for any more once so long has passed, us.
_LONGEST_US: Final = 600_000_000


class AttackWatch:
    """Watches one trial. ``names``: the right words; ``fills_bus``: it can only be named once the attack is over.

    ``said`` counts the attacker's frames on the bus. ``named_us`` is how long after the first of them, or after the
    attack's end where it fills the bus, one of the right words was on the bus; ``back_us`` how long after its end all
    machines took part, and somebody worked or nobody of then waited. None: never. Both in us.
    """

    def __init__(self, what: Injection, names: Collection[str], *, fills_bus: bool) -> None:
        self.said = 0
        self.named: str | None = None
        self.named_us: int | None = None
        self.back_us: int | None = None
        self._names, self._fills_bus = names, fills_bus
        self._name, self._end_us = what.text("name"), what.until_us
        #: From here on words are waited for.
        self._since_us = 0

    def begin(self, stage: SystemStage[Any]) -> None:
        """The run is connected, and not switched on."""
        self._stage = stage
        self._decode = stage.run.codecs.fleet.decode_part
        self._beat_us = stage.run.site.timing.heartbeat_us
        stage.run.fleet.tap(self._on_frame, errors=ErrorsHeard.NONE)
        stage.run.plant.timers.call_at(self._end_us, self._look)

    def is_over(self, now_us: int) -> bool:
        """Whether it was named and service is back, or neither can come in time any more."""
        after_us = now_us - self._end_us
        is_named = self.named_us is not None or not self.said or after_us > NAMED_BEATS * self._beat_us
        return is_named and (self.back_us is not None or after_us > _LONGEST_US)

    @property
    def is_named_in_time(self) -> bool:
        """Whether the right word came within ``NAMED_BEATS`` heartbeat periods."""
        return self.named_us is not None and self.named_us <= NAMED_BEATS * self._beat_us

    @property
    def is_back_in_time(self) -> bool:
        """Whether service was back within ``BACK_US``."""
        return self.back_us is not None and self.back_us <= BACK_US

    def _on_frame(self, frame: Frame, time_us: int, node: str) -> None:
        if node.startswith(f"attacker {self._name} "):
            self.said += 1
            self._since_us = self._since_us or (self._end_us if self._fills_bus else time_us)
        elif self.said and self.named is None:
            name = _name_in(self._decode(frame), self._stage.run.site.machines)
            if name in self._names:
                self.named, self.named_us = name, max(0, time_us - self._since_us)

    def _look(self) -> None:
        now_us = self._stage.run.loop.now_us()
        if self._is_back():
            self.back_us = now_us - self._end_us
        elif now_us - self._end_us <= _LONGEST_US:
            self._stage.run.plant.timers.call_at(now_us + _LOOK_US, self._look)

    def _is_back(self) -> bool:
        run, holons = self._stage.run, [one.holon for one in self._stage.run.controllers.values()]
        states = [one.behaviour.state for one in holons if one.halted is None and not one.holding.is_held]
        takes_part = len(states) == len(run.site.machines) and all(one in ADMITTED for one in states)
        return takes_part and (MachineState.WORKING in states or not self._stage.waits_since(self._end_us))


def _name_in(word: Message | Reason, machines: Collection[int]) -> str:
    """What a machine of the site calls what is going on; empty where it does not."""
    if not isinstance(word, Diagnostic | Halted | SealFault) or word.sender not in machines:
        return ""
    return word.fault.name if isinstance(word, SealFault) else word.reason.name
