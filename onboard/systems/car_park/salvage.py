"""What a robot has in hand by its sensors and rights, where its journal was lost and its rights were made anew [G8].

A robot handles a car only in front of a station whose right it holds, with the car's right in hand, and keeps both
until it has said where the car stands. So of a shuttle that is out, or loaded, the rights tell which car it is about
and where. Whatever was begun there, the car is put where it may stay: back where it is said to stand, or where it was
being left; one that was on its way goes to the next place that is free. Whoever called for it calls again.
"""

from typing import NamedTuple

from onboard.contract.codes import Criterion, KindCode, Operation, ShuttleMode
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals, Reference, ShuttleState
from onboard.core.effects import Effect, Record, Report
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment, Station
from onboard.systems.car_park import custody
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.places import nearest
from onboard.systems.car_park.program import CarHandling, HandlingPhase, StationWork
from onboard.systems.car_park.records import StepRecord
from onboard.systems.car_park.recovery import award_record, handled_record
from onboard.systems.car_park.site import ANY_CLASS
from onboard.ways.mirror import WayFleet


class Salvage(NamedTuple):
    """A car that is to be left, and how far that is; ``phase`` None: the shuttle is home with it."""

    work: StationWork
    phase: HandlingPhase | None


def find(
    fleet: WayFleet, generation: CarParkGeneration, place: Segment, shuttle: ShuttleState, now_us: int
) -> Salvage | None:
    """What is in hand at ``place``, of a shuttle that rests out or loaded; None where nobody can know it."""
    is_out = shuttle.mode is not ShuttleMode.HOME
    beside = [one for one in custody.held_beside(fleet, place) if not is_out or one.side is shuttle.side]
    cars, station = custody.said_aboard(fleet), beside[0] if len(beside) == 1 else None
    if not cars and station is not None:
        cars = [car for car in custody.others_in(fleet.mirror, station) if custody.is_mine(fleet, car)]
    if len(cars) != 1:
        return None
    if station is None or custody.others_in(fleet.mirror, station, cars[0]):
        station = None if is_out else _free_place(fleet, generation, place, cars[0], now_us)
    if station is None:
        return None
    # With nothing in its grip it only has to come home; a car in it is let go first, where it may stand.
    return Salvage(_leaving(fleet, cars[0], station, now_us), HandlingPhase.CLAMP if is_out else None)


def noted(found: Salvage) -> list[Effect]:
    """The journal's word of it, so that a further restart goes on with the same; and what the log says."""
    work, phase = found
    taken = work._replace(handling=CarHandling.TAKE)
    effects: list[Effect] = [award_record(work.call, work.station, work.station, 1), handled_record(taken)]
    if phase is not None:
        effects.append(Record(StepRecord(phase, work.handling, work.station.number, work.car.number)))
    name = f"car {work.car.origin}.{work.car.number}"
    return [*effects, Report(f"{name} is in hand by sensors and rights: it is left at {work.station}")]


def _leaving(fleet: WayFleet, car: Reference, station: Station, now_us: int) -> StationWork:
    """To leave a car as a task of its robot's own, which nobody called for."""
    wheelbase_mm = fleet.mirror.cars[car].wheelbase_mm
    call = CallForProposals(
        sender=fleet.node_id,
        call=0,
        task=Reference(fleet.node_id, car.number),
        operation=Operation.PARK,
        kind=KindCode.ROBOT,
        criterion=Criterion.FINISH_TIME,
        attempt=1,
        depth=0,
        deadline_ms=to_bus_ms(now_us),
        from_station=station.number,
        to_station=ANY_STATION,
        car=car,
        wheelbase_mm=wheelbase_mm,
    )
    return StationWork(CarHandling.LEAVE, station, car, wheelbase_mm, call)


def _free_place(
    fleet: WayFleet, generation: CarParkGeneration, here: Segment, car: Reference, now_us: int
) -> Station | None:
    """The nearest free place that takes whatever car and that there is a way to now; else the nearest."""
    near = nearest(generation.free.of(now_us, ANY_CLASS), here)
    ways = (
        one for one in near if generation.reroute(here, now_us, [_leaving(fleet, car, one, now_us)], now_us) is not None
    )
    return next(ways, near[0] if near else None)
