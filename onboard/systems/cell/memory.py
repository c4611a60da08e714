"""What a robot of the cell keeps in its journal: contracts that it has won, and how far each is."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.messages import Reference
from onboard.core.effects import Record
from onboard.core.journal_records import Entry, records_in
from onboard.systems.cell.contracts import ArmMove, Contract, Goal
from onboard.systems.cell.fields import MAX_PATH
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.records import ContractLostRecord, ContractRecord, ContractStage, StageRecord


@dataclass
class Undertaking:
    """A contract in hand. ``successor`` is the sub-contractor's node-ID, 0 for nobody or not yet known.

    Until it ``was_heard`` taking the award on it may not know of it: only then is it kept in the journal.
    """

    contract: Contract
    manager: int
    sub_goal: Goal | None
    stage: ContractStage = ContractStage.WON
    successor: int = 0
    was_heard: bool = False

    @property
    def task(self) -> Reference:
        """Origin and number of the goal that the contract is about."""
        return self.contract.goal.task


def won_record(one: Undertaking) -> Record:
    """The whole contract. The approach is not kept: who starts again looks for its way anew."""
    contract, goal, move = one.contract, one.contract.goal, one.contract.move
    return Record(
        ContractRecord(
            goal.task,
            goal.part,
            contract.node,
            goal.time_limit_ms,
            start=_text((goal.start,)),
            end=_text((goal.end,)),
            carry=_text(move.carry),
            approach=_text(move.approach),
            path=goal.path,
            own=contract.own_cost,
            cost=contract.cost,
            nodes=contract.nodes,
            sub=one.sub_goal.task.number if one.sub_goal is not None else 0,
        )
    )


def stage_record(one: Undertaking) -> Record:
    """How far it is now, and who goes on."""
    return Record(StageRecord(one.task, one.stage, one.successor if one.was_heard else 0))


def lost_record(one: Undertaking) -> Record:
    """The journal's word that the contract is another's now."""
    return Record(ContractLostRecord(one.task))


def undertakings(entries: Iterable[Entry]) -> dict[Reference, Undertaking]:
    """Contracts in hand by task, from journal entries, oldest first; others are passed over."""
    found: dict[Reference, Undertaking] = {}
    for record in records_in(entries, ContractRecord, ContractLostRecord, StageRecord):
        match record:
            case ContractRecord():
                found[record.task] = _undertaking(record)
            case ContractLostRecord():
                found.pop(record.task, None)
            case StageRecord() if record.task in found:
                one = found[record.task]
                one.stage, one.successor, one.was_heard = record.stage, record.next, bool(record.next)
    return found


def _undertaking(record: ContractRecord) -> Undertaking:
    (start,), (end,) = _points(record.start), _points(record.end)
    goal = Goal(record.task, record.part, start, end, record.path, record.limit, MAX_PATH)
    move = ArmMove(_points(record.approach), _points(record.carry))
    contract = Contract(goal, record.node, move, record.own, record.cost, record.nodes)
    return Undertaking(
        contract,
        record.task.origin,
        goal.part_of(record.node, record.sub, move.via) if record.sub else None,
    )


def _text(points: tuple[Point, ...]) -> str:
    return " ".join(f"{point.x_mm},{point.y_mm}" for point in points)


def _points(text: str) -> tuple[Point, ...]:
    pairs = (one.split(",") for one in text.split())
    return tuple(Point(int(x), int(y)) for x, y in pairs)
