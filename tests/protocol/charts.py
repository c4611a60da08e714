"""State charts of docs/protocol.md, drawn from the tables of the code."""

import ast
import inspect
from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Any, NamedTuple

from onboard.core.negotiation import initiator, participant
from onboard.holon import holding
from onboard.systems.car_park import compartment, handling, lift_steps, starting
from onboard.work import undertaking
from tests.protocol import walked
from tests.protocol.walked import Edge


class Chart(NamedTuple):
    """One machine of states; ``words`` explains its states, events and deeds, in this order, by name."""

    first: str
    edges: tuple[Edge, ...]
    words: tuple[tuple[str, Mapping[str, str]], ...] = ()


def of_table(table: Mapping[Any, Any]) -> tuple[Edge, ...]:
    """The arrows of a table (state, event) to the next state, or to the next state and what is done."""
    edges = []
    for (state, event), entry in table.items():
        following, deed = entry if isinstance(entry, tuple) else (entry, None)
        edges.append(Edge(state.name, event.name, following.name, _deed(deed)))
    return tuple(edges)


def _deed(deed: Any) -> str:
    if deed is None:
        return ""
    name: str = deed.name if isinstance(deed, Enum) else deed.__name__
    return "" if name in ("rest", "NOTHING") else name


def _of_enum(members: type[Enum]) -> dict[str, str]:
    return {one.name: one.value for one in members if isinstance(one.value, str)}


def _of_actions(owner: type, edges: Iterable[Edge]) -> dict[str, str]:
    """What the methods of a table do, by the first sentence of each."""
    names = dict.fromkeys(edge.deed for edge in edges if edge.deed)
    return {name: (inspect.getdoc(getattr(owner, name)) or "").split("\n")[0] for name in names}


def _negotiating(module: Any, owner: type, states: type[Enum], events: type[Enum], first: str) -> Chart:
    edges = of_table(module.TABLE)
    words = (("state", _of_enum(states)), ("event", _of_enum(events)), ("done", _of_actions(owner, edges)))
    return Chart(first, edges, words)


def _handling() -> Chart:
    edges = tuple(
        Edge(phase.name, how.name, following.name, "" if order is None else order.name)
        for (phase, how), (order, following) in handling.TABLE.items()
    )
    return Chart("ACQUIRE", edges)


def _phases_of_bay() -> Chart:
    """A compartment's phases: from each to those that its method, and what that calls, goes on to."""
    source = ast.parse(inspect.getsource(compartment))
    bay = next(one for one in source.body if isinstance(one, ast.ClassDef) and one.name == "Compartment")
    methods = {one.name: one for one in bay.body if isinstance(one, ast.FunctionDef)}
    found: dict[str, list[str]] = {}
    for node in ast.walk(methods["__post_init__"]):
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Attribute) and isinstance(value, ast.Attribute):
                    found[key.attr] = _goes(methods, value.attr, set())
    for name, method in methods.items():
        for node in ast.walk(method):
            if not name.startswith("_when") and isinstance(node, ast.If):
                for phase in _phases(node.test):
                    found[phase] += [one for inner in node.body for one in _goes_in(methods, inner, set())]
    pairs = dict.fromkeys((phase, to) for phase, targets in found.items() for to in targets if to != phase)
    return Chart("STARTING", tuple(Edge(phase, "", to, "") for phase, to in pairs))


def _goes(methods: Mapping[str, ast.FunctionDef], name: str, seen: set[str]) -> list[str]:
    if name in seen or name not in methods:
        return []
    seen.add(name)
    return [one for inner in methods[name].body for one in _goes_in(methods, inner, seen)]


def _goes_in(methods: Mapping[str, ast.FunctionDef], node: ast.AST, seen: set[str]) -> list[str]:
    found = []
    for call in ast.walk(node):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute):
            if call.func.attr == "_go":
                found += [one for argument in call.args for one in _phases(argument)]
            elif not call.func.attr.startswith("_when") and ast.unparse(call.func.value) == "self":
                found += _goes(methods, call.func.attr, seen)
    return found


def _phases(node: ast.AST) -> list[str]:
    return [
        one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute) and ast.unparse(one.value) == "BayPhase"
    ]


def charts() -> dict[str, Chart]:
    """All charts by the name of their block in the page."""
    start, hold, lift, won = starting, holding, lift_steps, undertaking
    return {
        "presence": Chart("UNKNOWN", walked.edges(walked.PRESENCE)),
        "start": Chart("UNPLACED", of_table(start.TABLE), (("stage", _of_enum(start.StartStage)),)),
        "sync": Chart("ASKS", walked.edges(walked.SYNC)),
        "participant": _negotiating(
            participant,
            participant.Participant,
            participant.ParticipantState,
            participant.ParticipantEvent,
            "WAITING_BOUND",
        ),
        "initiator": _negotiating(
            initiator, initiator.Initiator, initiator.InitiatorState, initiator.InitiatorEvent, "OPEN"
        ),
        "undertaking": Chart(
            "UNKNOWN",
            of_table(won.TABLE),
            (
                ("standing", _of_enum(won.TaskStanding)),
                ("event", _of_enum(won.TaskEvent)),
                ("said", _of_enum(won.UndertakingAnswer)),
            ),
        ),
        "token": Chart("ELSEWHERE", walked.edges(walked.TOKEN)),
        "lift": Chart(
            "STARTING",
            of_table(lift.LIFT_TABLE),
            (("finding", _of_enum(lift.LiftFinding)), ("deed", _of_enum(lift.LiftDeed))),
        ),
        "handling": _handling(),
        "bay": _phases_of_bay(),
        "hold": Chart(
            "ACTING",
            of_table(hold.TABLE),
            (
                ("state", _of_enum(hold.HoldState)),
                ("event", _of_enum(hold.HoldEvent)),
                ("done", _of_enum(hold.HoldResponse)),
            ),
        ),
    }


def drawn(chart: Chart) -> str:
    """The chart as a Mermaid diagram; behind it a table of each sort of its words."""
    together: dict[tuple[str, str, str], list[str]] = {}
    for state, event, following, deed in chart.edges:
        together.setdefault((state, following, deed), []).append(event)
    lines = ["```mermaid", "stateDiagram-v2", f"    [*] --> {chart.first}"]
    for (state, following, deed), events in together.items():
        label = ", ".join(event for event in events if event) + (f" / {deed}" if deed else "")
        lines.append(f"    {state} --> {following}" + (f" : {label}" if label else ""))
    lines.append("```")
    used = {word for edge in chart.edges for word in edge}
    for sort, words in chart.words:
        rows = [f"| `{name}` | {text} |" for name, text in words.items() if name in used]
        if rows:
            lines += ["", f"| {sort} | meaning |", "|---|---|", *rows]
    return "\n".join(lines)
