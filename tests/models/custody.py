"""The custody of a car: who has won it takes it from its place and leaves it at the bay, by the shipped code of both.

It begins with the award in both journals. The shuttle does each stroke at once; controllers crash between any two
effects, strokes among them.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CallForProposals, CarAt, Message
from onboard.core.records import TokenGivenRecord, TokenGoneRecord, TokenHeldRecord
from onboard.systems.car_park.bay_memory import car_record, winner_record
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.program import CarHandling, StationWork
from onboard.systems.car_park.recovery import award_record, handled_record
from tests.models.at_work import AtWork, Entry
from tests.models.award import BAY, CAR, CHEAP, KEY, PLACE, SITE, TASK, WHEELBASE_MM, AwardPart
from tests.models.robots import CAR_KG, PricedFactory, RobotBody, stand_still

HERE = SITE.compartments[BAY]
CALL = CallForProposals(
    BAY,
    513,
    TASK,
    Operation.RETRIEVE,
    KindCode.ROBOT,
    Criterion.FINISH_TIME,
    1,
    0,
    1_000,
    PLACE.number,
    HERE.number,
    CAR,
    WHEELBASE_MM,
)


_GONE = (TokenGivenRecord, TokenGoneRecord)


class View(NamedTuple):
    """Of one machine: whether it holds the car, where it has it by its own word, and whether it takes part."""

    holds: bool
    station: int | None
    takes_part: bool
    #: Of a robot, whether its sensors see the car aboard; None of the compartment.
    is_laden: bool | None


@dataclass
class CustodyPart(AwardPart):
    """Of two machines, or with a second robot that may win the task where it is called for anew."""

    nodes: tuple[int, ...] = (BAY, CHEAP)
    prelude: int = 1
    #: Whether it begins with the car aboard.
    laden: bool = True

    def journal(self, node: int) -> tuple[Entry, ...]:
        """The first robot has won, and all that needs to know has noted it; it may have the car aboard."""
        entries = super().journal(node)
        if node == BAY:
            entries = (*entries, winner_record(CAR, CHEAP, TASK, 1).entry)
            return (
                (*entries, *(made(KEY.kind, KEY.number, 2, CHEAP).entry for made in _GONE)) if self.laden else entries
            )
        if node != CHEAP:
            return entries
        entries = (*entries, award_record(CALL, PLACE, HERE, 1).entry)
        if not self.laden:
            return entries
        aboard = CarAt(CHEAP, CAR, ANY_STATION, 2, WHEELBASE_MM)
        taken = StationWork(CarHandling.TAKE, PLACE, CAR, WHEELBASE_MM, CALL)
        held = TokenHeldRecord(KEY.kind, KEY.number, 2, CHEAP)
        return (*entries, held.entry, car_record(aboard).entry, handled_record(taken).entry)

    def body(self, node: int) -> Any:
        """As in the award; the car may be aboard."""
        body = super().body(node)
        return body._replace(load_kg=CAR_KG) if self.laden and node == CHEAP else body

    def made(self, node: int, journal: tuple[Entry, ...], body: Any) -> AtWork:
        """As in the award, with a shuttle whose strokes come to their ends."""
        if node == BAY:
            return super().made(node, journal, body)
        return AtWork(SITE, node, PricedFactory(), RobotBody(node, body), journal, stand_still, self.is_said)

    def hears(self, node: int, word: Message) -> bool:
        """Words about cars as well."""
        return super().hears(node, word) or word.sender == BAY

    def view(self, machine: AtWork) -> Any:
        """See ``View``."""
        record = machine.fleet.mirror.cars.get(CAR)
        station = record.station if record is not None and record.custodian == machine.node else None
        laden = None if isinstance(machine.behaviour, Compartment) else machine.body.state.load_kg > 0
        return View(machine.fleet.tokens.holds(KEY), station, machine.takes_part, laden)

    def wrong(self, views: tuple[Any, ...]) -> str:
        """Two hold the car, or who holds it does not know where it stands."""
        holders = [one for one in views if one is not None and one.holds]
        if len(holders) > 1:
            return "two hold the car"
        if any(one.takes_part and one.station is None and not one.is_laden for one in holders if one.is_laden is None):
            return "its keeper does not know where the car stands"
        return ""

    def is_over(self, views: tuple[Any, ...]) -> bool:
        """The compartment has the car in its bay, or it has left."""
        bay = views[0]
        return bay is not None and bay.holds and bay.station in (HERE.number, OUTSIDE)
