"""Calls are folded in one place: whoever shows, counts or publishes them is a view of ``onboard.history``."""

import ast
from pathlib import Path

from tests.project.layers import imports_of

ROOT = Path(__file__).parents[2]
#: Where awards are decided, sent and acted on, or written down as messages.
DECIDES = ("onboard/core/", "onboard/contract/", "onboard/holon/", "onboard/systems/", "onboard/work/")
#: Simulated machines that call or obey on the bus themselves, bugs planted into machines, and how a system counts what
#: was said in one run: they fold nothing.
SPEAKERS = ("bus_sim/systems/",)
#: A bench that waits for one award on real buses.
BENCHES = ("hil/scenarios/",)
#: The fold; and judges, which must not believe what they judge.
FOLDS = {"onboard/history", "onboard/trace/check/calls.py", "onboard/trace/check/owners.py"}


def test_awards_are_handled_in_three_places_beside_those_that_decide_and_obey() -> None:
    found = set()
    for package in ("onboard", "bus_sim", "hil", "deploy"):
        for file in sorted((ROOT / package).rglob("*.py")):
            place = file.relative_to(ROOT).as_posix()
            if not place.startswith((*DECIDES, *SPEAKERS, *BENCHES)) and _names_award(file, place):
                found.add("onboard/history" if place.startswith("onboard/history/") else place)
    assert found == FOLDS


def _names_award(file: Path, place: str) -> bool:
    tree = ast.parse(file.read_text(encoding="utf-8"), place)
    if "Award" not in {
        alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names
    }:
        return False
    module = place.removesuffix(".py").replace("/", ".")
    return any(found.module.startswith("onboard.") for found in imports_of(tree, ROOT, module, is_package=False))
