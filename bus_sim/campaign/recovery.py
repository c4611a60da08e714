"""How long the fleet needs to get over each fault: the longest of each kind in a run, looked at from outside.

Nothing here changes a run: controllers are looked at every ``LOOK_US`` while something is under way, never told.
"""

from collections.abc import Callable, Iterable
from enum import StrEnum
from functools import partial
from typing import Any, Final

from bus_sim.can.faults import FaultInjector, FaultKind, InjectedFault
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.faults.table import KINDS, Group
from bus_sim.run import BusRun
from onboard.contract.codes import MachineState
from onboard.contract.messages import Heartbeat, Message, SyncRequest
from onboard.controller.shell import Controller
from onboard.core.frame import Frame
from onboard.core.site import Machine
from onboard.ports.bus import ErrorState

#: Between two looks, us: the resolution of what is looked at inside.
LOOK_US: Final = 50_000
#: A machine in one of these is admitted: its position is sensed, and it takes part.
ADMITTED: Final = (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING)


class Measure(StrEnum):
    """What is measured, from the fault to the end of what it did."""

    #: A frame about plans or cars was missed by one receiver: until somebody asks for it, or it was said again.
    OMISSION_NOTICED = "omission noticed"
    #: Power is cut: until each other controller counts the machine as silent.
    LOSS_NOTICED = "node loss noticed"
    #: Off the bus, and the cause is gone: until its next frame on the bus.
    BUS_OFF_WORKING = "bus-off to working"
    #: Power comes back: until all that live have answered, and it may use its rights and begin anything.
    RESTART_ANSWERED = "restart to all answered"
    #: Power comes back: until its first heartbeat as a machine that takes part. What moves in it comes to rest first.
    RESTART_ADMITTED = "restart to admitted"
    #: The last fault is over and all machines run: until all mirrors have one digest.
    HEAL_DIGESTS = "heal to equal digests"
    #: The last fault is over: until everybody is served who waited then.
    HEAL_SERVED = "heal to all served"
    #: A person has had rights made anew: until the first is served of those who waited then.
    REPAIR_SERVES = "repair to first served"


def healed_us(faults: Iterable[AnyFault]) -> int:
    """When the last fault that has an end by itself is over, us of loop time; crashes end when power comes back."""
    ends = [0]
    for fault in faults:
        if isinstance(fault, InjectedFault):
            ends.append(fault.until_us or fault.from_us)
            continue
        settings = KINDS[fault.kind].settings
        if "at_s" in settings:
            lasts = [key for key in ("for_s", "spread_s") if key in settings]
            ends.append(fault.at_us + round(sum(fault.number(key) for key in lasts) * 1e6))
    return max(ends)


def clocks_right_us(faults: Iterable[AnyFault]) -> int | None:
    """When the last fault of a clock is over, us of loop time; None where there is none."""
    return max((healed_us([one]) for one in faults if is_of_clock(one)), default=None)


def is_of_clock(fault: AnyFault) -> bool:
    """Whether it makes clocks wrong, and nothing else."""
    return isinstance(fault, Injection) and KINDS[fault.kind].group is Group.CLOCK


class RecoveryMeasure:
    """Measures one run; to be made before ``BusRun.start``. ``longest_us`` and ``counts`` are by measure."""

    def __init__(self, simulation: BusRun[Any], faults: Iterable[AnyFault]) -> None:
        self.longest_us: dict[Measure, int] = {}
        self.counts: dict[Measure, int] = {}
        faults = tuple(faults)
        #: When the last fault known so far is over, us of loop time: later with every restart.
        self.healed_us = healed_us(faults)
        self._simulation = simulation
        crashes = [one for one in faults if isinstance(one, Injection) and one.kind == "crash"]
        self._for_good = {one.target for one in crashes if one.text("restart") == "no"}
        ends = (one for one in crashes if one.target not in self._for_good)
        #: How long power is off, us: nothing is over before it is back.
        self._off_us = {one.target: round(one.number("restart_s") * 1e6) for one in ends}
        self._starts: dict[int, int] = {}
        self._off: dict[str, int] = {}
        self._ends = {
            one.target: one.until_us for one in faults if isinstance(one, Injection) and one.kind == "bus_off"
        }
        self._watched = [i for i in simulation.fleet.injectors if i.fault.kind is FaultKind.OMISSION and i.fault.nth]
        self._struck: dict[FaultInjector, int] = {}
        self._deaf: dict[int, int] = {}
        self._is_healing = bool(faults)
        #: The healing after which nobody waits any more; 0 for none.
        self._served_since_us = 0
        #: When rights were made anew and nobody was served since, 0 for never; who waited then, below 0: not known.
        self._repaired = 0, -1
        simulation.before_start.append(self._on_start)
        simulation.after_crash.append(self._on_crash)
        simulation.after_repair.append(self._on_repair)
        if faults:
            simulation.observers.append(self._on_message)
        if self._ends or self._watched:
            simulation.fleet.tap(self._on_frame)
        if faults:
            self._at(self.healed_us, self._look_at_digests)

    def look_at_waits(self, waits_since: Callable[[int], int]) -> None:
        """Everybody who waited when the last fault was over, is served or has gone; or the first of them."""
        repaired_us, waited = self._repaired
        if repaired_us and waited < 0:
            self._repaired = repaired_us, waits_since(repaired_us)
        elif repaired_us and waits_since(repaired_us) < max(waited, 1):
            self._repaired = 0, -1
            self._note(Measure.REPAIR_SERVES, self._now_us() - repaired_us)
        if self._served_since_us != self.healed_us and not waits_since(self.healed_us):
            self._served_since_us = self.healed_us
            self._note(Measure.HEAL_SERVED, self._now_us() - self.healed_us)

    def mirrors_agree(self) -> bool:
        """Whether all machines run that are not dead for good, none is halted, and all mirrors have one digest."""
        running = self._simulation.controllers.values()
        names = {machine.name for machine in self._simulation.site.machines.values()} - self._for_good
        if names - {one.holon.machine.name for one in running} or any(one.holon.halted for one in running):
            return False
        return len({one.holon.mirror.digest() for one in running}) == 1

    def _note(self, measure: Measure, us: int) -> None:
        self.longest_us[measure] = max(self.longest_us.get(measure, 0), us)
        self.counts[measure] = self.counts.get(measure, 0) + 1

    def _now_us(self) -> int:
        return self._simulation.loop.now_us()

    def _at(self, when_us: int, look: Callable[[], None]) -> None:
        self._simulation.plant.timers.call_at(when_us, look)

    # --- restarts and losses -----------------------------------------------------------------------------------

    def _on_start(self, controller: Controller) -> None:
        now_us = self._now_us()
        if now_us:
            self._starts[controller.holon.node_id] = now_us
            self.healed_us = max(self.healed_us, now_us)
            self._is_healing = True
            self._at(now_us, self._look_at_digests)
            self._at(now_us + LOOK_US, partial(self._look_at_answers, controller, now_us))

    def _on_repair(self) -> None:
        self.healed_us = max(self.healed_us, self._now_us())
        self._repaired = self._now_us(), -1

    def _look_at_answers(self, controller: Controller, since_us: int) -> None:
        if controller is not self._simulation.controllers.get(controller.holon.node_id):
            return
        if controller.holon.part.begins and controller.holon.tokens.is_synced:
            self._note(Measure.RESTART_ANSWERED, self._now_us() - since_us)
        else:
            self._at(self._now_us() + LOOK_US, partial(self._look_at_answers, controller, since_us))

    def _on_crash(self, machine: Machine) -> None:
        self._starts.pop(machine.node_id, None)
        self.healed_us = max(self.healed_us, self._now_us() + self._off_us.get(machine.name, 0))
        now_us = self._now_us()
        self._at(now_us + LOOK_US, partial(self._look_at_loss, machine.node_id, now_us))

    def _look_at_loss(self, node: int, since_us: int) -> None:
        if node in self._simulation.controllers:
            return
        now_us = self._now_us()
        for controller in self._simulation.controllers.values():
            holon = controller.holon
            if node in holon.mirror.alive(holon.bus_us(now_us)):
                self._at(now_us + LOOK_US, partial(self._look_at_loss, node, since_us))
                return
        if self._simulation.controllers:
            self._note(Measure.LOSS_NOTICED, now_us - since_us)

    # --- the bus -----------------------------------------------------------------------------------------------

    def _on_message(self, message: Message, time_us: int) -> None:
        if isinstance(message, Heartbeat) and message.state in ADMITTED:
            started_us = self._starts.pop(message.sender, None)
            if started_us is not None:
                self._note(Measure.RESTART_ADMITTED, time_us - started_us)
        elif isinstance(message, SyncRequest) and self._deaf:
            for node in (message.sender, message.whom):
                struck_us = self._deaf.pop(node, None)
                if struck_us is not None:
                    self._note(Measure.OMISSION_NOTICED, time_us - struck_us)

    def _on_frame(self, _: Frame, time_us: int, sender: str) -> None:
        for name, end_us in self._ends.items():
            bus = self._simulation.fleet_node(name)
            if name == sender and name in self._off:
                self._note(Measure.BUS_OFF_WORKING, time_us - max(self._off.pop(name), end_us))
            elif bus is not None and bus.health().state is ErrorState.BUS_OFF:
                self._off.setdefault(name, time_us)
        for injector in self._watched:
            if injector.struck != self._struck.get(injector, 0):
                self._struck[injector] = injector.struck
                self._at(time_us + LOOK_US, partial(self._look_at_omission, injector, time_us))

    def _look_at_omission(self, injector: FaultInjector, struck_us: int) -> None:
        """Whoever differs from the rest so long after has missed something that matters to its mirror."""
        digests = {node: one.holon.mirror.digest() for node, one in self._simulation.controllers.items()}
        for node, mine in digests.items():
            name = self._simulation.site.machines[node].name
            apart = all(theirs != mine for other, theirs in digests.items() if other != node)
            if injector.chooses(name, node) and apart:
                self._deaf[node] = struck_us
                self._look_again(node)

    def _look_again(self, node: int) -> None:
        """Said again by itself counts as noticed too."""
        if node not in self._deaf:
            return
        running = self._simulation.controllers
        mine = running[node].holon.mirror.digest() if node in running else None
        if any(one.holon.mirror.digest() == mine for other, one in running.items() if other != node):
            self._note(Measure.OMISSION_NOTICED, self._now_us() - self._deaf.pop(node))
        else:
            self._at(self._now_us() + LOOK_US, partial(self._look_again, node))

    # --- convergence -------------------------------------------------------------------------------------------

    def _look_at_digests(self) -> None:
        now_us = self._now_us()
        if now_us < self.healed_us or not self._is_healing:
            return
        if self.mirrors_agree():
            self._is_healing = False
            self._note(Measure.HEAL_DIGESTS, now_us - self.healed_us)
        else:
            self._at(now_us + LOOK_US, self._look_at_digests)
