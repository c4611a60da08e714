"""A terminal that can be run, and its indicators."""

from collections.abc import Callable
from dataclasses import dataclass, field

from bus_sim.run import BusRun
from bus_sim.systems.terminal.deliveries import BoxDelivery, deliveries, ordered
from bus_sim.systems.terminal.plant import TerminalPlant
from onboard.contract.messages import CarAt, Message
from onboard.systems.terminal.desk import Desk
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.vehicle import Vehicle
from onboard.ways.cars import CarMirror


@dataclass
class TerminalRun(BusRun[TerminalPlant]):
    """A terminal that can be run. ``spectator`` is what somebody who only listens to the fleet bus knows."""

    spectator: TerminalMirror = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        site, listener = self.plant.site, min(self.site.machines)
        self.spectator = TerminalMirror(site, listener, CarMirror(site, listener))
        self.observers.append(self._listen)

    def _listen(self, message: Message, time_us: int) -> None:
        if isinstance(message, CarAt):
            self.spectator.fleet.on_car(message)
        self.spectator.hear(message, time_us)


@dataclass(frozen=True)
class TerminalOutcome:
    """What a run came to. ``touched`` counts plans that their owners made anew; ``events`` disturbances."""

    deliveries: tuple[BoxDelivery, ...]
    ordered: int
    ended_us: int
    touched: int
    disturbances: int
    frames: int
    busy: float
    violations: tuple[str, ...]
    halted: tuple[str, ...]
    interrupted: int = 0

    @property
    def is_good(self) -> bool:
        """Whether all was delivered and nothing broke."""
        return not self.violations and not self.halted and len(self.deliveries) == self.ordered

    def mean_s(self, what: Callable[[BoxDelivery], int]) -> float:
        """Mean over all deliveries, s."""
        return sum(map(what, self.deliveries)) / max(1, len(self.deliveries)) / 1e6


def outcome(run: TerminalRun) -> TerminalOutcome:
    """The indicators of a run so far."""
    site = run.plant.site
    vehicles = [one.holon.behaviour for one in run.controllers.values() if isinstance(one.holon.behaviour, Vehicle)]
    desks = [one.holon.behaviour for one in run.controllers.values() if isinstance(one.holon.behaviour, Desk)]
    halted = tuple(
        f"{one.holon.machine.name}: {one.holon.halted}" for one in run.controllers.values() if one.holon.halted
    )
    statistics = run.fleet.statistics()
    return TerminalOutcome(
        tuple(deliveries(site, run.plant.world.handled)),
        ordered(site),
        max((one.time_us for one in run.plant.world.handled), default=0),
        sum(vehicle.planner.touched for vehicle in vehicles),
        len(site.blockages),
        statistics.frames,
        statistics.mean_load,
        tuple(run.plant.world.violations),
        halted,
        sum(desk.interrupted for desk in desks),
    )
