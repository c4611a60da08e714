"""What a robot of the cell keeps in its journal: contracts that it has won, and how far each is."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from onboard.core.effects import Record
from onboard.core.messages import Reference
from onboard.systems.cell.contracts import Contract, Goal, Move
from onboard.systems.cell.geometry import Point


class Stage(Enum):
    """How far a contract is, each a point from which a robot that starts again can go on."""

    WON = "the part is not taken"
    TAKEN = "the part is aboard, or being taken"
    PUT = "the part is put down; a sub-contractor goes on"
    OVER = "the goal is achieved"


@dataclass
class Undertaking:
    """A contract in hand. ``successor`` is the sub-contractor's node-ID, 0 for nobody or not yet known.

    Until it ``was_heard`` taking the award on it may not know of it: only then is it kept in the journal.
    """

    contract: Contract
    manager: int
    sub_goal: Goal | None
    stage: Stage = Stage.WON
    successor: int = 0
    was_heard: bool = False

    @property
    def task(self) -> Reference:
        """The goal's name."""
        return self.contract.goal.task


def won_record(one: Undertaking) -> Record:
    """The whole contract. The approach is not kept: who starts again looks for its way anew."""
    goal, move = one.contract.goal, one.contract.move
    entry: dict[str, str | int] = {"record": "contract", "node": one.contract.node, "limit": goal.time_limit_ms}
    entry |= {"origin": goal.task.origin, "number": goal.task.number}
    entry |= {"part_origin": goal.part.origin, "part_number": goal.part.number}
    entry |= {"start": _text((goal.start,)), "end": _text((goal.end,)), "carry": _text(move.carry)}
    entry |= {"approach": _text(move.approach), "path": " ".join(str(node) for node in goal.path)}
    entry |= {"own": one.contract.own_cost.hex(), "cost": one.contract.cost.hex()}
    entry |= {"nodes": " ".join(str(node) for node in one.contract.nodes)}
    entry |= {"sub": one.sub_goal.task.number if one.sub_goal is not None else 0}
    return Record(entry)


def stage_record(one: Undertaking) -> Record:
    """How far it is now, and who goes on."""
    entry: dict[str, str | int] = {"record": "stage", "origin": one.task.origin, "number": one.task.number}
    return Record(entry | {"stage": one.stage.name, "next": one.successor if one.was_heard else 0})


def lost_record(one: Undertaking) -> Record:
    """It is another's now."""
    return Record({"record": "contract_lost", "origin": one.task.origin, "number": one.task.number})


def undertakings(entries: Iterable[Mapping[str, str | int]]) -> dict[Reference, Undertaking]:
    """Contracts in hand by task, from journal entries, oldest first; others are passed over."""
    found: dict[Reference, Undertaking] = {}
    for entry in entries:
        if entry.get("record") == "contract":
            one = _undertaking(entry)
            found[one.task] = one
        elif entry.get("record") == "contract_lost":
            found.pop(Reference(int(entry["origin"]), int(entry["number"])), None)
        elif entry.get("record") == "stage":
            task = Reference(int(entry["origin"]), int(entry["number"]))
            if task in found:
                found[task].stage = Stage[str(entry["stage"])]
                found[task].successor = int(entry["next"])
                found[task].was_heard = bool(found[task].successor)
    return found


def _undertaking(entry: Mapping[str, str | int]) -> Undertaking:
    task = Reference(int(entry["origin"]), int(entry["number"]))
    part = Reference(int(entry["part_origin"]), int(entry["part_number"]))
    (start,), (end,) = _points(entry["start"]), _points(entry["end"])
    path = tuple(int(node) for node in str(entry["path"]).split())
    goal = Goal(task, part, start, end, path, int(entry["limit"]))
    move = Move(_points(entry["approach"]), _points(entry["carry"]))
    node, sub = int(entry["node"]), int(entry["sub"])
    nodes = tuple(int(one) for one in str(entry["nodes"]).split())
    own, cost = float.fromhex(str(entry["own"])), float.fromhex(str(entry["cost"]))
    contract = Contract(goal, node, move, own, cost, nodes)
    return Undertaking(
        contract,
        task.origin,
        goal.part_of(node, sub, move.via) if sub else None,
    )


def _text(points: tuple[Point, ...]) -> str:
    return " ".join(f"{point.x_mm},{point.y_mm}" for point in points)


def _points(text: str | int) -> tuple[Point, ...]:
    pairs = (one.split(",") for one in str(text).split())
    return tuple(Point(int(x), int(y)) for x, y in pairs)
