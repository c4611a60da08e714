"""The bus is folded in one place: whoever shows, counts or publishes what was said is a view of ``onboard.history``."""

import ast
from collections.abc import Iterator
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path

from onboard.contract.base import Message

ROOT = Path(__file__).parents[2]
#: Where a message is made, sent, decided by and acted on; all else only listens.
MACHINES = ("onboard/contract/", "onboard/core/", "onboard/holon/", "onboard/work/", "onboard/ways/", "onboard/wire/")
#: Parts of a system that are no machines.
PARTS = ("checks", "diagram", "gateway", "history", "scene", "words")
#: Who looks at messages of the fleet bus by their classes beside the machines, and why. Nobody else may.
LOOK = {
    "onboard/history/*.py": "the fold",
    "onboard/systems/*/history.py": "the fold of what only one system says",
    # What a message says, word by word, also where nothing else was heard.
    "onboard/trace/words.py": "one message in words",
    "onboard/systems/*/words.py": "one message in words",
    # docs/reliability.md: a fault in the fold must not hide a fault on the bus.
    "onboard/trace/check/*.py": "a judge",
    "onboard/systems/*/checks.py": "a judge",
    "onboard/systems/*/checks/*.py": "a judge",
    "bus_sim/faults/attendant.py": "what strikes at a moment that was heard",
    "bus_sim/campaign/*.py": "a judge of a trial, or what strikes at a moment that was heard",
    # What it is about decides when a word may go, and which one makes another needless.
    "onboard/controller/outgoing.py": "the words of its own machine on their way out",
    # Before any machine hears it: whether it needs a seal, and under whose key.
    "onboard/seal/*.py": "what is sealed, and to whom",
    # Who asked something on the bus waits for the answer, and remembers nothing of it.
    "onboard/gateway/own_words.py": "what a gateway may say",
    "onboard/gateway/pauses.py": "a conversation",
    "onboard/operate/blocks.py": "a conversation",
    "onboard/operate/change.py": "a conversation",
    "onboard/operate/holds.py": "a conversation",
    "onboard/operate/regenerate.py": "a conversation, whose statements count since all stand only",
    "onboard/operate/stops.py": "a conversation",
    "onboard/trace/commands/replay.py": "finds where a life begins",
    # It shares nothing with what it may judge, and answers as machines do.
    "onboard/conform/*.py": "a judge that plays all other machines",
    # Machines of other methods, machines that lie, and machines with a bug in them.
    "bus_sim/attacks/*.py": "an attacker",
    "bus_sim/systems/*/forged.py": "an attacker",
    "bus_sim/systems/*/baselines/*.py": "a machine of another method",
    "bus_sim/systems/*/compare/*.py": "a machine of another method, or what holds one to its word",
    "bus_sim/systems/*/planted/*.py": "a planted bug",
    # A run's own figures: each counts one or two messages.
    "bus_sim/systems/*/stage.py": "counts messages",
    "bus_sim/systems/*/meter.py": "counts messages",
    "bus_sim/systems/terminal/run.py": "feeds a mirror of the machines themselves, for drawing what they know",
    "bus_sim/systems/cell/view.py": "the paper's printed answer, whose offers and costs nothing else shows",
    "hil/*": "a bench that waits for a word on real buses",
    "deploy/update/health.py": "an updater that trusts no more of a program than that it beats",
}


def test_who_looks_at_messages_of_the_bus_is_the_history_or_says_why() -> None:
    found = {place: names for place in _listeners() if (names := _looks_at(place))}
    strangers = {one: names for one, names in found.items() if not any(fnmatch(one, pattern) for pattern in LOOK)}
    assert not strangers, "read onboard.history instead: its state, or the fact of a message"
    unused = [pattern for pattern in LOOK if not any(fnmatch(one, pattern) for one in found)]
    assert not unused, "nobody does that any more"


def test_awards_are_handled_in_three_places_beside_those_that_decide_and_obey() -> None:
    packages = ("onboard/history/", "onboard/trace/", "onboard/web/", "onboard/gateway/", "onboard/operate/")
    named = {
        one for one in _listeners() if one.startswith(packages) and "Award" in {c.__name__ for c in _looks_at(one)}
    }
    assert {"onboard/history" if one.startswith("onboard/history/") else one for one in named} == {
        "onboard/history",
        "onboard/trace/check/calls.py",
        "onboard/trace/check/owners.py",
    }


def _listeners() -> Iterator[str]:
    """Product files that are no machine's."""
    for package in ("onboard", "bus_sim", "hil", "deploy"):
        for file in sorted((ROOT / package).rglob("*.py")):
            place = file.relative_to(ROOT).as_posix()
            parts = place.split("/")
            is_of_machine = place.startswith(MACHINES) or (
                place.startswith("onboard/systems/") and (len(parts) < 4 or parts[3].removesuffix(".py") not in PARTS)
            )
            if not is_of_machine:
                yield place


def _looks_at(place: str) -> set[type[Message]]:
    """Messages of the fleet bus that a file tells apart: in a ``case``, by ``isinstance``, or as keys of a table."""
    tree = ast.parse((ROOT / place).read_text(encoding="utf-8"), place)
    known = _fleet_messages(tree)
    names: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.MatchClass(cls=ast.Name(id=name)):
                names.add(name)
            case ast.Call(func=ast.Name(id="isinstance"), args=[_, classes]):
                names |= {one.id for one in ast.walk(classes) if isinstance(one, ast.Name)}
            case ast.Dict(keys=keys):
                names |= {key.id for key in keys if isinstance(key, ast.Name)}
    return {known[name] for name in names & known.keys()}


def _fleet_messages(tree: ast.Module) -> dict[str, type[Message]]:
    """The messages of fleet buses that a file imports; those of a machine's own devices are nobody's history."""
    found: dict[str, type[Message]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("onboard.contract"):
            for alias in node.names:
                one = getattr(import_module(node.module), alias.name, None)
                if isinstance(one, type) and issubclass(one, Message) and not one.__module__.endswith("device"):
                    found[alias.asname or alias.name] = one
    return found
