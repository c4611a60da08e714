"""What a cell's machines write into their journals: robots their contracts (memory.py), the desk its orders."""

from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.messages import Reference
from onboard.core.journal_records import MOST_OVER, JournalRecord, Keep, RecordEnd, RecordTypes, Which, stored_as
from onboard.work.order_records import OrderRecord, OrderStateRecord


class ContractStage(Enum):
    """How far a contract is, each a point from which a robot that starts again can go on."""

    WON = "the part is not taken"
    TAKEN = "the part is aboard, or being taken"
    PUT = "the part is put down; a sub-contractor goes on"
    OVER = "the goal is achieved"


@dataclass(frozen=True, slots=True)
class ContractRecord(JournalRecord):
    """A contract that was won. Points are words ``X,Y`` in mm; ``limit`` is bus time in ms, ``sub`` a goal's number."""

    NAME = "contract"
    RULES = (Keep("contract", ("task",), Which.FIRST_AND_NEWEST),)

    task: Reference = field(metadata=stored_as("origin", "number"))
    part: Reference = field(metadata=stored_as("part_origin", "part_number"))
    node: int
    limit: int
    start: str
    end: str
    carry: str
    approach: str
    path: tuple[int, ...]
    own: float
    cost: float
    nodes: tuple[int, ...]
    sub: int


@dataclass(frozen=True, slots=True)
class StageRecord(JournalRecord):
    """How far a contract is; ``next`` is the node-ID of the sub-contractor that was heard, else 0."""

    NAME = "stage"
    RULES = (
        Keep("stage", ("task",)),
        RecordEnd(("contract", "stage"), ("task",), ("stage", (ContractStage.OVER,)), MOST_OVER),
    )

    task: Reference = field(metadata=stored_as("origin", "number"))
    stage: ContractStage
    next: int


@dataclass(frozen=True, slots=True)
class ContractLostRecord(JournalRecord):
    """Another has the contract now, and this robot forgets it."""

    NAME = "contract_lost"
    RULES = (RecordEnd(("contract", "stage"), ("task",)),)

    task: Reference = field(metadata=stored_as("origin", "number"))


@dataclass(frozen=True, slots=True)
class GoalOrderRecord(OrderRecord):
    """A part is wanted elsewhere: places in mm; ``limit`` is bus time in ms, 0 for none."""

    limit: int
    from_x: int
    from_y: int
    to_x: int
    to_y: int


@dataclass(frozen=True, slots=True)
class GoalStateRecord(OrderStateRecord):
    """With what its contract costs, and whether the chain of robots would be too long."""

    cost: float
    is_too_deep: bool = False


RECORDS: RecordTypes = (ContractRecord, StageRecord, ContractLostRecord, GoalOrderRecord, GoalStateRecord)
