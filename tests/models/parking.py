"""A car that was brought: who has won it takes it out of the bay and leaves it at a place, by the shipped code of both.

It begins with the award in both journals and the car in the bay, whose doors are locked; the bay's sensors see it go.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals, CarAt, Message
from onboard.core.records import BootRecord, TokenHeldRecord
from onboard.systems.car_park.bay_memory import car_record, job_record, winner_record
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.compartment_factory import CompartmentFactory
from onboard.systems.car_park.records import NumberRecord
from onboard.systems.car_park.recovery import award_record
from tests.models.at_work import AtWork, Entry
from tests.models.award import BAY, CAR, CHEAP, KEY, PLACE, SITE, TASK, WHEELBASE_MM, AwardPart
from tests.models.bays import BayBody, DoorsState
from tests.models.custody import HERE, CustodyPart
from tests.models.robots import CAR_KG

CALL = CallForProposals(
    BAY,
    513,
    TASK,
    Operation.PARK,
    KindCode.ROBOT,
    Criterion.FINISH_TIME,
    1,
    0,
    1_000,
    HERE.number,
    ANY_STATION,
    CAR,
    WHEELBASE_MM,
)


class FullBay(NamedTuple):
    """Where the doors are, and what is in the bay, kg."""

    doors: DoorsState
    load_kg: int = CAR_KG


class Felt(NamedTuple):
    """What the bay's sensors see of it."""

    load_kg: int


@dataclass
class EmptiedBody(BayBody):
    """Doors, and a bay out of which its car goes."""

    @property
    def state(self) -> Any:
        """The doors, and what is in the bay."""
        return FullBay(self.now, self.load_kg)

    def meets(self, event: Any) -> list[Message]:
        """What is in the bay by now."""
        assert isinstance(event, Felt)
        self.load_kg = event.load_kg
        return self.start()[1:]


class View(NamedTuple):
    """Of one machine: whether it holds the car, where it has it by its own word, whether it takes part and is at work.

    Of a robot whether its sensors see the car aboard; None of the compartment.
    """

    holds: bool
    station: int | None
    takes_part: bool
    is_busy: bool
    is_laden: bool | None


@dataclass
class ParkingPart(CustodyPart):
    """The compartment and one robot, or two."""

    laden: bool = False

    def journal(self, node: int) -> tuple[Entry, ...]:
        """The first robot has won, and all that needs to know has noted it."""
        boot = BootRecord(1).entry
        if node == CHEAP:
            return boot, award_record(CALL, HERE, PLACE, 1).entry
        if node != BAY:
            return (boot,)
        return (
            boot,
            TokenHeldRecord(KEY.kind, KEY.number, 1, BAY).entry,
            car_record(CarAt(BAY, CAR, HERE.number, 1, WHEELBASE_MM)).entry,
            NumberRecord(TASK.number).entry,
            job_record(TASK, Operation.PARK, CAR, WHEELBASE_MM).entry,
            winner_record(CAR, CHEAP, TASK, 1).entry,
        )

    def body(self, node: int) -> Any:
        """Doors locked, and the car in the bay; robots at home."""
        return FullBay(DoorsState()) if node == BAY else AwardPart.body(self, node)

    def made(self, node: int, journal: tuple[Entry, ...], body: Any) -> AtWork:
        """As in custody, with a bay that sees what is in it."""
        if node != BAY:
            return super().made(node, journal, body)
        bay = EmptiedBody(node, body.doors, body.load_kg)
        return AtWork(SITE, node, CompartmentFactory(), bay, journal, is_said=self.is_said)

    def goes_on(self, body: Any) -> None:
        """Nothing by itself."""

    def feels(self, i: int, view: Any, bodies: tuple[Any, ...]) -> Hashable | None:
        """The bay is empty once somebody has the car aboard, and stays so: who is at the place has left it there."""
        if self.nodes[i] != BAY or not bodies[0].load_kg:
            return None
        at_mm = (PLACE.index - 1) * SITE.tracks[PLACE.track].pitch_mm
        return Felt(0) if any(one.load_kg or one.position_mm == at_mm for one in bodies[1:]) else None

    def view(self, machine: AtWork) -> Any:
        """See ``View``."""
        record = machine.fleet.mirror.cars.get(CAR)
        station = record.station if record is not None and record.custodian == machine.node else None
        behaviour, holds = machine.behaviour, machine.fleet.tokens.holds(KEY)
        if isinstance(behaviour, Compartment):
            return View(holds, station, machine.takes_part, behaviour.job is not None, None)
        return View(holds, station, machine.takes_part, bool(behaviour._works()), machine.body.state.load_kg > 0)

    def wrong(self, views: tuple[Any, ...]) -> str:
        """As in custody; of a machine that is down only the body is seen."""
        return super().wrong(tuple([one if isinstance(one, View) else None for one in views]))

    def is_over(self, views: tuple[Any, ...]) -> bool:
        """The car stands at a place by the word of who holds it, and nobody is at work any more."""
        if not all(isinstance(one, View) for one in views):
            return False
        stands = [one for one in views if one.holds and one.station not in (None, ANY_STATION, HERE.number)]
        return bool(stands) and not any(one.is_busy or one.is_laden for one in views)
