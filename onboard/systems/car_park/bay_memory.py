"""What the journal of a fixed machine keeps of cars and tasks, and what it tells after a restart.

A steward remembers where the cars in its custody stand and who won which; a compartment its task, whether the winner
has had the bay, and the tickets that wait. Written before it is said (design, section 5).
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from onboard.core.authority import TokenKey
from onboard.core.codes import Operation
from onboard.core.effects import Record
from onboard.core.messages import CarAt, Reference
from onboard.core.serial import successor
from onboard.systems.car_park.bay_task import queue_ticket
from onboard.ways.mirror import WayFleet
from onboard.ways.tokens import car_token

Entry = Mapping[str, str | int]


def car_record(statement: CarAt) -> Record:
    """Where a car in my custody stands, as it is told."""
    entry: dict[str, str | int] = {"record": "car_at", "car_origin": statement.car.origin, "car": statement.car.number}
    entry |= {"station": statement.station, "version": statement.version, "wheelbase_mm": statement.wheelbase_mm}
    return Record(entry)


def cars_at(node_id: int, entries: Iterable[Entry]) -> dict[Reference, CarAt]:
    """What node ``node_id`` has last journalled of each car, as it told it."""
    return BayMemory(node_id).read(entry for entry in entries if entry.get("record") in ("car_at", "retired")).cars


def winner_record(car: Reference, winner: int, task: Reference, version: int) -> Record:
    """Who may fetch a car, for which task and under which version of it; 0 for nobody any more."""
    entry: dict[str, str | int] = {"record": "winner", "car_origin": car.origin, "car": car.number, "winner": winner}
    return Record(entry | {"task_origin": task.origin, "task": task.number, "version": version})


def ticket_record(car: Reference, *, urgent: bool) -> Record:
    """A ticket came; its car is to be fetched, an urgent one before those that wait."""
    entry: dict[str, str | int] = {"record": "ticket", "car_origin": car.origin, "car": car.number}
    return Record(entry | {"urgent": 1} if urgent else entry)


def job_record(task: Reference, operation: Operation, car: Reference, wheelbase_mm: int) -> Record:
    """The bay's task begins."""
    entry: dict[str, str | int] = {"record": "job", "task_origin": task.origin, "task": task.number}
    entry |= {"operation": int(operation), "car_origin": car.origin, "car": car.number, "wheelbase_mm": wheelbase_mm}
    return Record(entry)


def job_over_record() -> Record:
    """The bay is free again."""
    return Record({"record": "job_over"})


def next_reference(last: int, fleet: WayFleet) -> Reference:
    """The next number of a car or task of this node; one under which a token was ever heard of is passed over.

    It goes to the journal before its token: whatever happens between the two writes, it is never used again.
    """
    for _ in range(1 << 16):
        last = successor(last, 16)
        if not fleet.tokens.is_known(car_token(fleet.node_id, last)):
            break
    return Reference(fleet.node_id, last)


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
    #: Task, operation, car and wheelbase of the task in hand, or None.
    job: tuple[Reference, Operation, Reference, int] | None = None
    #: Whether the winner has had the bay since the task began.
    was_granted: bool = False

    def read(self, entries: Iterable[Entry]) -> "BayMemory":
        """Take up all entries; those of other kinds are passed over."""
        for entry in entries:
            self._take(entry)
        return self

    def _take(self, entry: Entry) -> None:
        match entry.get("record"):
            case "car_at":
                numbers = int(entry["station"]), int(entry["version"]), int(entry["wheelbase_mm"])
                self.cars[_car(entry)] = CarAt(self.node_id, _car(entry), *numbers)
                self.winners.pop(_car(entry), None)
            case "winner":
                self._take_winner(entry)
            case "retired":
                self._forget(_car(entry))
            case "ticket":
                queue_ticket(self.tickets, _car(entry), urgent="urgent" in entry)
            case "job":
                operation = Operation(int(entry["operation"]))
                task = Reference(int(entry["task_origin"]), int(entry["task"]))
                self.job, self.was_granted = (task, operation, _car(entry), int(entry["wheelbase_mm"])), False
                if operation is Operation.RETRIEVE and _car(entry) in self.tickets:
                    self.tickets.remove(_car(entry))
            case "job_over":
                self.job = None
            case "token_given" if self.bay == (int(entry["kind"]), int(entry["number"])):
                self.was_granted = True

    def _forget(self, car: Reference) -> None:
        """It left long ago."""
        for table in (self.cars, self.winners, self.tasks):
            table.pop(car, None)
        if car in self.tickets:
            self.tickets.remove(car)

    def _take_winner(self, entry: Entry) -> None:
        car, winner = _car(entry), int(entry["winner"])
        if winner:
            self.winners[car] = winner
        else:
            self.winners.pop(car, None)
        if "version" in entry:
            task = Reference(int(entry["task_origin"]), int(entry["task"]))
            self.tasks[car] = task, int(entry["version"])


def _car(entry: Entry) -> Reference:
    return Reference(int(entry["car_origin"]), int(entry["car"]))
