"""What a car park's machines write into their journals; who reads each is named beside it. Lengths in mm."""

from dataclasses import dataclass, field

from onboard.contract.codes import DoorAction, DoorName, Operation
from onboard.contract.messages import Reference
from onboard.core.journal_records import UNSAID, JournalRecord, Keep, RecordEnd, RecordTypes, Which
from onboard.systems.car_park.program import CarHandling, HandlingPhase

_CAR = ("car",)
_TASK = ("task",)


# --- a robot's: recovery.py ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class AwardRecord(JournalRecord):
    """A task taken on under ``version``; stations by number, ``source`` 0 where none was written down.

    It is in hand until its car is left, or it is another's.
    """

    NAME = "award"
    RULES = (Keep("award", _TASK),)

    initiator: int
    call: int
    task: Reference
    operation: Operation
    car: Reference
    wheelbase_mm: int
    from_station: int
    to_station: int
    deadline_ms: int
    source: int = 0
    sink: int = 0
    version: int = 1


@dataclass(frozen=True, slots=True)
class SinkRecord(JournalRecord):
    """The car of a task is to be left at another station than the award says."""

    NAME = "sink"
    RULES = (Keep("sink", _TASK),)

    task: Reference
    station: int


@dataclass(frozen=True, slots=True)
class ForfeitedRecord(JournalRecord):
    """A task was given back, or is another's."""

    NAME = "forfeited"
    RULES = (RecordEnd(("award", "handled", "sink"), _TASK),)

    task: Reference


@dataclass(frozen=True, slots=True)
class HandledRecord(JournalRecord):
    """A handling is over, and with it the shuttle's step; the last car that was left is told to whoever asks."""

    NAME = "handled"
    RULES = (
        Keep("handled", _TASK),
        Keep("last_handled"),
        RecordEnd(("award", "handled", "sink"), _TASK, ("handling", (CarHandling.LEAVE,))),
        Keep("left", ("handling",)),
    )

    task: Reference
    handling: CarHandling
    station: int = 0
    car: Reference | None = None


@dataclass(frozen=True, slots=True)
class StepRecord(JournalRecord):
    """The shuttle's step that is about to be ordered; ``car`` is its number.

    ``wheelbase_mm`` where the award had none: the car was called for before it was measured.
    """

    NAME = "step"
    RULES = (Keep("step"),)

    phase: HandlingPhase
    handling: CarHandling
    station: int
    car: int
    wheelbase_mm: int = field(default=0, metadata=UNSAID)


@dataclass(frozen=True, slots=True)
class RidingRecord(JournalRecord):
    """A ride begins: from now on the floor is the lift's business."""

    NAME = "riding"
    RULES = (Keep("riding"),)

    lift: int
    board: int
    leave: int


@dataclass(frozen=True, slots=True)
class FloorRecord(JournalRecord):
    """The track on which the carrier is: after a ride, or about to turn into a spur."""

    NAME = "floor"
    RULES = (Keep("floor"), RecordEnd(("riding",)))

    track: int


# --- custody of cars, and the bay's own task: bay_memory.py. The core's ``retired`` ends what is about a car ---


@dataclass(frozen=True, slots=True)
class CarRecord(JournalRecord):
    """What is about a car."""

    car: Reference

    def load_number(self) -> int | None:
        """The car's number in its token."""
        return self.car.origin << 16 | self.car.number


@dataclass(frozen=True, slots=True)
class CarAtRecord(CarRecord):
    """Where a car in this node's custody stands, as it is told. In the order in which cars first came."""

    NAME = "car_at"
    RULES = (Keep("stands", _CAR, Which.FIRST_AND_NEWEST),)

    station: int
    version: int
    wheelbase_mm: int


@dataclass(frozen=True, slots=True)
class WinnerRecord(CarRecord):
    """Who may fetch a car, for which task and under which version of it; 0 for nobody any more."""

    NAME = "winner"
    RULES = (Keep("winner", _CAR),)

    winner: int
    task: Reference | None = None
    version: int | None = None


@dataclass(frozen=True, slots=True)
class FetchTimeRecord(CarRecord):
    """When the driver of a car that came in here means to come for it, bus ms."""

    NAME = "fetch_time"
    RULES = (Keep("fetch_time", _CAR),)

    fetch_ms: int


@dataclass(frozen=True, slots=True)
class TicketRecord(JournalRecord):
    """A ticket came, or is this bay's to serve; an urgent one goes before those that wait."""

    NAME = "ticket"
    RULES = (Keep("ticket", _CAR, Which.ALL), RecordEnd(("desk_for",), _CAR))

    car: Reference
    urgent: bool = field(default=False, metadata=UNSAID)


@dataclass(frozen=True, slots=True)
class DeskForRecord(CarRecord):
    """A ticket read here is called for under ``version`` of a task, and which compartment has taken it; 0: none yet."""

    NAME = "desk_for"
    RULES = (Keep("desk_for", _CAR),)

    task: Reference
    version: int
    winner: int


@dataclass(frozen=True, slots=True)
class ReceivedRecord(CarRecord):
    """A ticket that was read at another desk is this compartment's, for a task of that desk."""

    NAME = "received"
    RULES = (Keep("received", _CAR),)

    task: Reference
    version: int


@dataclass(frozen=True, slots=True)
class TicketGoneRecord(CarRecord):
    """That desk has given the ticket to another compartment."""

    NAME = "ticket_gone"
    RULES = (RecordEnd(("ticket", "received"), _CAR),)


@dataclass(frozen=True, slots=True)
class BayJobRecord(JournalRecord):
    """A task of the bay begins, for this car; its class matters where it is to be parked."""

    NAME = "job"
    RULES = (
        Keep("job"),
        RecordEnd(("ticket",), _CAR, ("operation", (Operation.RETRIEVE,))),
        RecordEnd(("ahead",), _TASK),
    )

    task: Reference
    operation: Operation
    car: Reference
    wheelbase_mm: int
    car_class: int = field(default=0, metadata=UNSAID)


@dataclass(frozen=True, slots=True)
class AheadRecord(JournalRecord):
    """A car is called for that is to come into the bay after the task in hand; the bay's task ends it."""

    NAME = "ahead"
    RULES = (Keep("ahead", _TASK), RecordEnd(("ticket",), _CAR))

    task: Reference
    car: Reference
    wheelbase_mm: int


@dataclass(frozen=True, slots=True)
class AheadOverRecord(JournalRecord):
    """That car has left another way."""

    NAME = "ahead_over"
    RULES = (RecordEnd(("ahead",), _TASK),)

    task: Reference


@dataclass(frozen=True, slots=True)
class BayFreeRecord(JournalRecord):
    """The bay is free again."""

    NAME = "job_over"
    RULES = (RecordEnd(("job",)),)


@dataclass(frozen=True, slots=True)
class NumberRecord(JournalRecord):
    """The last number that a compartment gave to a car or a task; bay_memory.py reads it."""

    NAME = "number"
    RULES = (Keep("number"),)

    number: int


@dataclass(frozen=True, slots=True)
class DoorRecord(JournalRecord):
    """A door was ordered (outputs.py): for people, nobody reads it."""

    NAME = "door"
    RULES = (Keep("door", ("door",)),)

    door: DoorName
    action: DoorAction


# --- a lift's: lift.py -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RideRecord(JournalRecord):
    """A ride with ``robot`` aboard begins; ``board`` and ``leave`` are floors of the shaft."""

    NAME = "ride"
    RULES = (Keep("ride"),)

    robot: int
    board: int
    leave: int


@dataclass(frozen=True, slots=True)
class RideOverRecord(JournalRecord):
    """The robot's ride has ended at its floor."""

    NAME = "ride_over"
    RULES = (RecordEnd(("ride",)),)

    robot: int


RECORDS: RecordTypes = (
    AwardRecord,
    SinkRecord,
    ForfeitedRecord,
    HandledRecord,
    StepRecord,
    RidingRecord,
    FloorRecord,
    CarAtRecord,
    WinnerRecord,
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
    DoorRecord,
    RideRecord,
    RideOverRecord,
)
