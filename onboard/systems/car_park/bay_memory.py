"""What the journal of a fixed machine keeps of cars and tasks, and what it tells after a restart.

A steward remembers where the cars in its custody stand and who won which; a compartment its task, whether the winner
has had the bay, and the tickets that wait. Written before it is said (design, section 5).
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import Operation
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import CarAt, Reference
from onboard.core.authority import TokenKey
from onboard.core.effects import Record
from onboard.core.journal_records import Entry, JournalRecord, records_in
from onboard.core.records import RetiredRecord, TokenGivenRecord
from onboard.core.serial import is_newer, successor
from onboard.systems.car_park.bay_task import queue_ticket
from onboard.systems.car_park.records import (
    AheadOverRecord,
    AheadRecord,
    BayFreeRecord,
    BayJobRecord,
    CarAtRecord,
    DeskForRecord,
    FetchTimeRecord,
    NumberRecord,
    ReceivedRecord,
    TicketGoneRecord,
    TicketRecord,
    WinnerRecord,
)
from onboard.systems.car_park.site import ANY_CLASS
from onboard.ways.mirror import WayFleet
from onboard.ways.tokens import car_token

#: How far behind the last known car the numbers of a lost journal go on: more tasks than there are between two cars.
BEYOND_LOST = 16_384


def car_record(statement: CarAt) -> Record:
    """Where a car in my custody stands, as it is told."""
    return Record(CarAtRecord(statement.car, statement.station, statement.version, statement.wheelbase_mm))


def cars_at(node_id: int, entries: Iterable[Entry]) -> dict[Reference, CarAt]:
    """What node ``node_id`` has last journalled of each car, as it told it."""
    return BayMemory(node_id).take_up(records_in(entries, CarAtRecord, RetiredRecord)).cars


def winner_record(car: Reference, winner: int, task: Reference, version: int) -> Record:
    """Who may fetch a car, for which task and under which version of it; 0 for nobody any more."""
    return Record(WinnerRecord(car, winner, task, version))


def ticket_record(car: Reference, *, urgent: bool) -> Record:
    """A ticket came; its car is to be fetched, an urgent one before those that wait."""
    return Record(TicketRecord(car, urgent))


def job_record(
    task: Reference, operation: Operation, car: Reference, wheelbase_mm: int, car_class: int = ANY_CLASS
) -> Record:
    """The journal's word that a task of the bay begins."""
    return Record(BayJobRecord(task, operation, car, wheelbase_mm, car_class))


def ahead_record(task: Reference, car: Reference, wheelbase_mm: int) -> Record:
    """The journal's word that a car is called for before the bay is free."""
    return Record(AheadRecord(task, car, wheelbase_mm))


def ahead_over_record(task: Reference) -> Record:
    """It is called for no more."""
    return Record(AheadOverRecord(task))


def job_over_record() -> Record:
    """The bay is free again."""
    return Record(BayFreeRecord())


def _next_reference(last: int, fleet: WayFleet) -> Reference:
    """The next number of a car or task of this node; one under which a token was ever heard of is passed over.

    It goes to the journal before its token: whatever happens between the two writes, it is never used again. A journal
    that gave none though there are cars was lost: others may have tasks of numbers that were given since the last car.
    """
    if last == 0:
        known = max((car.number for car in fleet.mirror.cars if car.origin == fleet.node_id), default=0)
        last = (known + BEYOND_LOST) % (1 << 16) if known else 0
    for _ in range(1 << 16):
        last = successor(last, 16)
        if not fleet.tokens.is_known(car_token(fleet.node_id, last)):
            break
    return Reference(fleet.node_id, last)


_READ = (
    CarAtRecord,
    WinnerRecord,
    RetiredRecord,
    FetchTimeRecord,
    TicketRecord,
    DeskForRecord,
    ReceivedRecord,
    TicketGoneRecord,
    BayJobRecord,
    AheadRecord,
    AheadOverRecord,
    BayFreeRecord,
    NumberRecord,
    TokenGivenRecord,
)


@dataclass
class BayMemory:
    """The journal of a fixed machine, read from its oldest entry on. ``bay`` is a compartment's own station token."""

    node_id: int
    bay: TokenKey | None = None
    cars: dict[Reference, CarAt] = field(default_factory=dict)
    winners: dict[Reference, int] = field(default_factory=dict)
    #: For which task, and under which version of it, somebody may fetch a car, or might.
    tasks: dict[Reference, tuple[Reference, int]] = field(default_factory=dict)
    tickets: deque[Reference] = field(default_factory=deque)
    #: Tickets read here: task, version, and the compartment that has taken it (``DeskForRecord``).
    desks: dict[Reference, tuple[Reference, int, int]] = field(default_factory=dict)
    #: Tickets read elsewhere that are served here: their task and its version.
    received: dict[Reference, tuple[Reference, int]] = field(default_factory=dict)
    #: When cars that came in here will be fetched, as their drivers said, bus ms.
    fetch_times: dict[Reference, int] = field(default_factory=dict)
    #: The last number that was given to a car or a task; 0 before any.
    number: int = 0
    #: Task, operation, car and wheelbase of the task in hand, or None.
    job: tuple[Reference, Operation, Reference, int] | None = None
    #: Class of its car, where that is to be parked.
    car_class: int = ANY_CLASS
    #: Whether the winner has had the bay since the task began.
    was_granted: bool = False
    #: Task, car and wheelbase of what is called for while the task in hand still has the bay.
    ahead: tuple[Reference, Reference, int] | None = None

    def read(self, entries: Iterable[Entry]) -> "BayMemory":
        """Take up all entries; those of other kinds are passed over."""
        return self.take_up(records_in(entries, *_READ))

    def take_up(self, records: Iterable[JournalRecord]) -> "BayMemory":
        """Take up records of this memory."""
        for record in records:
            self._take(record)
        return self

    def _take(self, record: JournalRecord) -> None:
        match record:
            case CarAtRecord(car=car):
                self.cars[car] = CarAt(self.node_id, car, record.station, record.version, record.wheelbase_mm)
                self.winners.pop(car, None)
                if record.station == OUTSIDE:
                    self.fetch_times.pop(car, None)
                    self._forget_ticket(car)
            case WinnerRecord():
                self._take_winner(record)
            case RetiredRecord():
                self._forget(record.load)
            case FetchTimeRecord():
                self.fetch_times[record.car] = record.fetch_ms
            case TicketRecord():
                queue_ticket(self.tickets, record.car, urgent=record.urgent)
                self.desks.pop(record.car, None)
            case DeskForRecord():
                self.desks[record.car] = record.task, record.version, record.winner
            case ReceivedRecord():
                self.received[record.car] = record.task, record.version
            case TicketGoneRecord():
                self._forget_ticket(record.car)
            case _:
                self._take_task(record)

    def _take_task(self, record: JournalRecord) -> None:
        match record:
            case BayJobRecord():
                self._take_job(record)
            case AheadRecord(car=car):
                self.ahead = record.task, car, record.wheelbase_mm
                if car in self.tickets:
                    self.tickets.remove(car)
            case AheadOverRecord():
                self.ahead = None
            case NumberRecord():
                self.number = record.number
            case BayFreeRecord():
                self.job = None
            case TokenGivenRecord() if self.bay == (record.kind, record.number):
                self.was_granted = True

    def _take_job(self, record: BayJobRecord) -> None:
        """The task in hand; the next one that comes before a fetch in hand has changed places with it."""
        before, car = self.job, record.car
        self.job, self.was_granted = (record.task, record.operation, car, record.wheelbase_mm), False
        self.car_class = record.car_class
        if record.operation is Operation.RETRIEVE and car in self.tickets:
            self.tickets.remove(car)
        if self.ahead is not None and self.ahead[0] == record.task:
            is_fetch = before is not None and before[1] is Operation.RETRIEVE
            self.ahead = (before[0], before[2], before[3]) if before is not None and is_fetch else None

    def next_reference(self, fleet: WayFleet) -> tuple[Reference, Record]:
        """The name of the next car or task of this node, and what is to be written before it is used."""
        name = _next_reference(self.number, fleet)
        self.number = name.number
        return name, Record(NumberRecord(name.number))

    def never_gave(self, task: Reference, node: int) -> bool:
        """Whether a machine has a task of this node that this journal knows nothing of, though it knows earlier ones.

        A number is on the disk before it is said: such a journal is an old copy.
        """
        return task.origin == node and self.number != 0 and is_newer(task.number, self.number, 16)

    def _forget(self, car: Reference) -> None:
        """It left long ago."""
        for table in (self.cars, self.winners, self.tasks, self.desks, self.fetch_times):
            table.pop(car, None)
        self._forget_ticket(car)

    def _forget_ticket(self, car: Reference) -> None:
        self.received.pop(car, None)
        if car in self.tickets:
            self.tickets.remove(car)

    def _take_winner(self, record: WinnerRecord) -> None:
        if record.winner:
            self.winners[record.car] = record.winner
        else:
            self.winners.pop(record.car, None)
        if record.version is not None and record.task is not None:
            self.tasks[record.car] = record.task, record.version
