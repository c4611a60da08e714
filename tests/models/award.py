"""The award: a compartment wants a stored car, two robots bid, and one of them comes to have the right to the car.

Compartment, stewardship, negotiation of both sides, the robots' journal, the book of rights and the custody of the car
are the shipped ones.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from onboard.contract.codes import Operation
from onboard.contract.messages import (
    Bid,
    CarAt,
    Heartbeat,
    Itinerary,
    Message,
    Progress,
    Reference,
    TokenDispute,
    TokenGiven,
    Waiting,
)
from onboard.core.records import BootRecord, TokenHeldRecord
from onboard.systems.car_park.bay_memory import car_record, job_record, winner_record
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.compartment_factory import CompartmentFactory
from onboard.systems.car_park.records import NumberRecord
from onboard.ways.tokens import car_token
from tests.models.at_work import LEFT_OUT, AtWork, Entry
from tests.models.bays import BayBody, DoorsState
from tests.models.robots import PricedFactory, RobotBody, RobotState, stand_still
from tests.sites import at_the_key, one_floor

SITE = at_the_key(one_floor(2))
BAY, CHEAP, DEAR = 1, 11, 12
CAR, TASK, WHEELBASE_MM = Reference(BAY, 1), Reference(BAY, 7), 2_600
PLACE, KEY = SITE.places[0], car_token(*CAR)


class View(NamedTuple):
    """Of one machine: whether it holds the car, has the task in hand, and, whom the compartment takes for that."""

    holds: bool
    in_hand: bool
    winner: int | None


@dataclass
class AwardPart:
    """``calls`` are as many as one life of the compartment may open."""

    calls: int = 2
    nodes: tuple[int, ...] = (BAY, CHEAP, DEAR)
    left_out: frozenset[str] = LEFT_OUT
    #: In the first while they start; in the second the compartment calls.
    prelude: int = 2
    #: Whether a robot's heartbeats are heard once it was started again. Where they are not, all has to come right by
    #: what is said about tasks and rights alone.
    tells_life: bool = False

    def journal(self, node: int) -> tuple[Entry, ...]:
        """The compartment has the car in its custody and has begun the task; the robots have lived before."""
        boot = BootRecord(1).entry
        if node != BAY:
            return (boot,)
        stands = CarAt(BAY, CAR, PLACE.number, 1, WHEELBASE_MM)
        return (
            boot,
            TokenHeldRecord(KEY.kind, KEY.number, 1, BAY).entry,
            car_record(stands).entry,
            # Who brought it, by an award that was said again.
            winner_record(CAR, CHEAP, CAR, 1).entry,
            NumberRecord(TASK.number).entry,
            job_record(TASK, Operation.RETRIEVE, CAR, WHEELBASE_MM).entry,
        )

    def body(self, node: int) -> Any:
        """Doors locked; robots at home."""
        if node == BAY:
            return DoorsState()
        return RobotState((SITE.machines[node].home.index - 1) * SITE.tracks[1].pitch_mm)

    def made(self, node: int, journal: tuple[Entry, ...], body: Any) -> AtWork:
        """Compartment or robot."""
        if node == BAY:
            return AtWork(SITE, node, CompartmentFactory(), BayBody(node, body, 0), journal, is_said=self.is_said)
        factory = PricedFactory(prices_ms={DEAR: 5_000})
        return AtWork(SITE, node, factory, RobotBody(node, body, is_quick=False), journal, stand_still, self.is_said)

    def is_said(self, word: Message) -> bool:
        """Ways are no part of this: of a plan only which call it comes from; nor is it the compartment's life."""
        if isinstance(word, Heartbeat):
            return self.tells_life and word.sender != BAY
        return not isinstance(word, Progress | Waiting) and (
            not isinstance(word, Itinerary) or word.stamp.initiator == BAY
        )

    def hears(self, node: int, word: Message) -> bool:
        """A robot hears the compartment's words that are for all, or for it.

        Of the other it hears what that would take, what it has given away, and doubts about itself.
        """
        if node == BAY or isinstance(word, Bid | TokenGiven):
            return True
        if isinstance(word, Heartbeat):
            return False
        if isinstance(word, TokenDispute):
            return word.believed == node
        addressee = getattr(word, "holder", getattr(word, "requester", node))
        return word.sender == BAY and addressee == node

    def is_within(self, machine: AtWork) -> bool:
        """No more calls than are explored."""
        return machine.fleet.negotiation._last_call & 0xFF <= self.calls

    def view(self, machine: AtWork) -> View:
        """See ``View``."""
        behaviour, holds = machine.behaviour, machine.fleet.tokens.holds(KEY)
        if isinstance(behaviour, Compartment):
            return View(holds, behaviour.job is not None, behaviour.job.winner if behaviour.job else None)
        return View(holds, any(work.call.task == TASK for work in behaviour._works()), None)

    def wrong(self, views: tuple[View | None, ...]) -> str:
        """Two hold the car."""
        return "two hold the car" if sum(one is not None and one.holds for one in views) > 1 else ""

    def is_over(self, views: tuple[View | None, ...]) -> bool:
        """A robot that has the task holds the car; no other believes to have it, nor the compartment that one has."""
        bay, *robots = views
        having = [node for node, one in zip(self.nodes[1:], robots, strict=True) if one is not None and one.in_hand]
        holds = any(one is not None and one.holds and one.in_hand for one in robots)
        return holds and len(having) == 1 and bay is not None and bay.winner == having[0]
