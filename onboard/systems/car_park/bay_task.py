"""The one task that uses a compartment's bay, and what is said about it: its call and its award."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from onboard.contract.codes import (
    CallResult,
    Criterion,
    DeskInput,
    DeskText,
    KindCode,
    MachineState,
    Operation,
    OperatorAction,
    Reason,
    TaskPhase,
)
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import Award, BayState, CallForProposals, Reference, TaskReport, TokenRefusal
from onboard.core.authority import TokenKey
from onboard.core.effects import Effect, Send
from onboard.core.negotiation import RequestedTerms
from onboard.core.site import Station
from onboard.systems.car_park.site import ANY_CLASS, CarLimits, CarPark
from onboard.ways.mirror import WayMirror
from onboard.ways.tokens import car_token

#: A call that nobody could serve is made again after this, us, and each further time after twice as long, up to the
#: second: a fleet that is off costs five calls a minute, and one that is back is asked within the minute promised.
RETRY_US = 30_000_000
LONGEST_RETRY_US = 60_000_000
#: After a restart the machines say again what they have in hand; a task that nobody names is called anew so much later.
SETTLING_US = 2_000_000
#: What an operator's order stands for at the desk.
DESK_INPUT = {
    OperatorAction.PRESS_KEY: DeskInput.KEY,
    OperatorAction.INSERT_TICKET: DeskInput.TICKET,
    OperatorAction.CANCEL: DeskInput.CANCEL,
    OperatorAction.URGENT_TICKET: DeskInput.TICKET,
    OperatorAction.CHARGING_KEY: DeskInput.CHARGING_KEY,
}
#: The keys of who brings a car.
KEYS = (DeskInput.KEY, DeskInput.CHARGING_KEY)
#: The custodian's word that the winner is lost is answered so often with the newest award, before it counts: it may
#: have missed the first.
REMINDERS = 3


class BayPhase(Enum):
    """What the compartment is doing."""

    STARTING = "starting"
    FREE = "free"
    LOCKING = "locking"
    AWAITING = "awaiting"
    OPENING = "opening"
    SERVING = "serving"
    CLOSING = "closing"
    HANDOVER = "handover"
    RESERVING = "reserving"
    ENTERING = "entering"


#: What heartbeats tell in a phase, where that is not WORKING.
STATES = {BayPhase.STARTING: MachineState.STARTING, BayPhase.FREE: MachineState.IDLE}


@dataclass
class BayTask:
    """The task. ``version`` (16 bits) is raised each time that it is called anew; ``call`` is the one last awarded.

    ``car_class`` is that of a car to be parked, as it was let in.
    """

    task: Reference
    operation: Operation
    car: Reference
    wheelbase_mm: int
    winner: int = 0
    version: int = 1
    call: int = 0
    was_granted: bool = False
    retry_at_us: int | None = None
    #: Since when nothing shows that its winner has it, and when that is told so next; None while something does.
    unshown_us: int | None = None
    ask_at_us: int | None = None
    reminders: int = 0
    #: How often nobody could, one after the other, and why the last time; its driver may leave before anybody is asked.
    refusals: int = 0
    reason: Reason = Reason.CANCELLED
    car_class: int = ANY_CLASS
    #: From when on the bay can take its car, bus us; 0: at once.
    ready_us: int = 0
    #: Called for while its driver still drives in: the car is not measured, and no journal knows of it.
    is_coming: bool = False

    @property
    def is_given_back(self) -> bool:
        """Whether it is a car that nobody came to park: its driver may have it, and while he does not it is a task."""
        return self.operation is Operation.PARK and self.refusals > 0

    @property
    def may_be_given_back(self) -> bool:
        """Whether nobody is asked for just now to park it: its driver may have it at once."""
        return self.is_given_back and self.retry_at_us is not None

    def has_left(self, bay: BayState, mirror: WayMirror) -> bool:
        """Whether its car is gone: out with the driver who brought it, or from another bay."""
        return is_gone(self.car, mirror) or (self.operation is Operation.PARK and not bay.load_kg)

    def is_parked(self, bay: BayState, mirror: WayMirror, here: Station) -> bool:
        """Whether its car stands at a place by its keeper's word, though no robot was seen to have the bay for it."""
        stands = mirror.car_station(self.car)
        return self.operation is Operation.PARK and not bay.load_kg and stands not in (None, here)

    def is_brought(self, mirror: WayMirror, keeper: int, here: Station) -> bool:
        """Whether its car, to be fetched, is here by its keeper's word: nobody need be asked for it any more."""
        record = mirror.cars.get(self.car)
        is_kept = record is not None and (record.custodian, record.station) == (keeper, here.number)
        return self.operation is Operation.RETRIEVE and is_kept

    def refused(self, reason: Reason, now_us: int) -> None:
        """Nobody could; it is called for again later, and ever less often."""
        self.refusals, self.reason = self.refusals + 1, reason
        self.wait(now_us)

    def wait(self, now_us: int) -> None:
        """Its next call is made a whole pause from now, us."""
        self.retry_at_us = now_us + min(LONGEST_RETRY_US, RETRY_US << min(self.refusals - 1, 10))

    def may_be_served(self, now_us: int) -> None:
        """A robot has come back, or is done: where nobody could before, this is called for as soon as it may bid."""
        if self.refusals and self.retry_at_us is not None:
            self.retry_at_us = min(self.retry_at_us, now_us + SETTLING_US)

    def terms(self, source: int, sink: int, floor: Callable[[CallForProposals, int], int]) -> RequestedTerms:
        """The call for it, between two stations by number; no robot can be better than ``floor``."""
        return RequestedTerms(
            task=self.task,
            operation=self.operation,
            kind=KindCode.ROBOT,
            criterion=Criterion.FINISH_TIME,
            from_station=source,
            to_station=sink,
            load=self.car,
            load_mm=self.wheelbase_mm,
            task_version=self.version,
            ready_us=self.ready_us,
            floor=floor,
        )

    def is_unknown_to(self, refusal: TokenRefusal, mirror: WayMirror) -> bool:
        """Whether the car's custodian refuses it to the task's winner: it was off when the task was called, or won."""
        record, wanted = mirror.cars.get(self.car), TokenKey(refusal.token_kind, refusal.token)
        is_its_word = record is not None and record.custodian == refusal.sender and wanted == car_token(*self.car)
        knows_not = refusal.requester == self.winner and refusal.reason is Reason.TOKEN_NOT_GRANTABLE_YET
        return is_its_word and knows_not

    def award(self, sender: int) -> Award:
        """The newest award, to be said again."""
        return Award(sender, self.call, self.winner, self.task, self.version, CallResult.AWARDED, Reason.NONE)

    def refusal(self, sender: int, station: int) -> list[Effect]:
        """What is said of its end where nobody came to park its car, and the driver has left with it."""
        told = TaskReport(sender, self.task, TaskPhase.REFUSED, station, self.reason)
        return [Send(told)] if self.operation is Operation.PARK else []

    def remind(self, sender: int, node: int) -> list[Effect]:
        """Who was lost and comes back believing that the task is its own hears whose it is, or that nobody has it.

        While it is called for, or awarded, what is said of that tells it by its version.
        """
        if self.winner:
            return [] if self.winner == node else [Send(self.award(sender))]
        if not self.call or self.retry_at_us is None:
            return []
        return [Send(Award(sender, self.call, 0, self.task, self.version, CallResult.REJECTED, Reason.NODE_SILENT))]


def queue_ticket(tickets: deque[Reference], car: Reference, *, urgent: bool) -> bool:
    """Put a ticket behind those that wait, or an urgent one, new or not, before them; whether that changed anything."""
    if urgent and tickets and tickets[0] == car:
        return False
    if car in tickets and not urgent:
        return False
    if car in tickets:
        tickets.remove(car)
    tickets.insert(0 if urgent else len(tickets), car)
    return True


def withdrawal(node: int, report: TaskReport) -> list[Effect]:
    """The answer of ``node`` to who takes one of its tasks in hand that is another's, or over: it was away for long."""
    if report.task.origin != node or report.phase not in (TaskPhase.AWARDED, TaskPhase.STARTED, TaskPhase.FORFEITED):
        return []
    return [Send(void_award(node, report.task))]


def void_award(node: int, task: Reference) -> Award:
    """The word of ``node`` that it wants nobody to do a task of its own any more, in whatever call it was."""
    return Award(node, 0, 0, task, 0, CallResult.WITHDRAWN, Reason.CANCELLED)


def fits(bay: BayState, limits: CarLimits) -> bool:
    """Whether the car in the bay is one that the park takes (row P33)."""
    small = bay.length_mm <= limits.max_length_mm and bay.height_mm <= limits.max_height_mm
    grips = limits.min_wheelbase_mm <= bay.wheelbase_mm <= limits.max_wheelbase_mm
    narrow = not limits.max_width_mm or bay.width_mm <= limits.max_width_mm
    return small and grips and narrow and bay.load_kg <= limits.max_load_kg


def forget_tickets(tickets: deque[Reference], mirror: WayMirror) -> None:
    """Drop those of cars that have left, here or elsewhere: nobody can fetch them, and others wait behind them."""
    for car in [car for car in tickets if is_gone(car, mirror)]:
        tickets.remove(car)


def is_gone(car: Reference, mirror: WayMirror) -> bool:
    """Whether a car has left the park, by this compartment or another: nobody can fetch it any more."""
    return car in mirror.cars and mirror.cars[car].station == OUTSIDE


def admitted(bay: BayState, park: CarPark, mirror: WayMirror, *, charging: bool) -> int | DeskText:
    """The class under which a car is let in; for one that the park does not take what its driver is told."""
    car_class = class_in(bay, park, charging=charging)
    suited = (class_in(bay, park), car_class)
    if not fits(bay, park.cars) or not any(park.takes(place, one) for place in park.places for one in suited):
        return DeskText.CAR_TOO_LARGE
    return car_class if has_room(car_class, park, mirror) else full_text(car_class, park)


def full_text(car_class: int, park: CarPark) -> DeskText:
    """What is said where no place is free for a class: full is full for the class."""
    return DeskText.NO_CHARGING if park.charges(car_class) else DeskText.FULL


def refusal_text(car_class: int, park: CarPark, mirror: WayMirror) -> DeskText:
    """What a customer is told whom nobody can serve; that nobody can although there is room is not called full."""
    return DeskText.OUT_OF_ORDER if has_room(car_class, park, mirror) else full_text(car_class, park)


def class_in(bay: BayState | None, park: CarPark, *, charging: bool = False) -> int:
    """The class of the car in a bay, by its sensors; ``ANY_CLASS`` before they have said anything."""
    if bay is None:
        return ANY_CLASS
    return park.car_class(bay.length_mm, bay.height_mm, bay.load_kg, bay.width_mm, charging=charging)


def has_room(car_class: int, park: CarPark, mirror: WayMirror) -> bool:
    """Whether a place is free for a class of car."""
    return any(park.takes(place, car_class) for place in mirror.free_places())
