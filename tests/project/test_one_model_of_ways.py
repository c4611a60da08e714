"""Where machines move is known in one form, ``onboard.ways``: no system searches it, or keeps intervals, by itself."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import TypeGuard

import pytest

SYSTEMS = Path(__file__).parents[2] / "onboard" / "systems"
#: Queues by cost, and lists kept in order: what searches and tables of intervals are made of.
TOOLS = frozenset({"heapq", "bisect"})
#: Files that do it themselves, and why.
ELSEWHERE = {
    "car_park/generation.py": "who of those held back gives way to a plan; no places",
    "car_park/reader/machines.py": "which fixed machine is how many tracks from a track, for its steward; nobody moves",
    "car_park/reader/joints.py": "which way alleys lie, from those they go off; nobody moves",
    "cell/geometry.py": "motions of an arm in the plane, around corners of what stands there",
    "terminal/routes.py": "several ways each without a circle, through entities with gates (row M25)",
    "terminal/dates.py": "dates of steps from constraints between them",
}


def own_searches(source: str) -> Iterator[str]:
    """Each place of a file that has a queue by cost of its own, or goes from place to place while any is left."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            yield from (f"line {node.lineno}: imports {name}" for name in names if name in TOOLS)
        if isinstance(node, ast.While) and isinstance(node.test, ast.Name) and _grows(node, node.test.id):
            yield f"line {node.lineno}: goes on while any {node.test.id} is left"


def _grows(loop: ast.While, name: str) -> bool:
    """Whether a loop takes out of what it ends with and puts more in, or makes the next of it from each of the last."""
    inside = [node for part in loop.body for node in ast.walk(part)]
    called = {node.func.attr for node in inside if isinstance(node, ast.Call) and _is_of(node.func, name)}
    added = any(
        isinstance(one, ast.AugAssign) and isinstance(one.op, ast.Add) and _is(one.target, name) for one in inside
    )
    if called & {"pop", "popleft"} and (added or called & {"append", "appendleft", "extend"}):
        return True
    looked_at = any(isinstance(one, ast.For | ast.comprehension) and _is(one.iter, name) for one in inside)
    return looked_at and any(isinstance(one, ast.Assign) and any(_is(to, name) for to in one.targets) for one in inside)


def _is(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _is_of(node: ast.AST, name: str) -> TypeGuard[ast.Attribute]:
    return isinstance(node, ast.Attribute) and _is(node.value, name)


def test_no_system_has_a_search_or_a_table_of_intervals_of_its_own() -> None:
    found = {
        file.relative_to(SYSTEMS).as_posix(): [*own_searches(file.read_text(encoding="utf-8"))]
        for file in sorted(SYSTEMS.rglob("*.py"))
    }
    assert {file: places for file, places in found.items() if places and file not in ELSEWHERE} == {}
    assert all(found[file] for file in ELSEWHERE), "a file that is named here and searches nothing"


@pytest.mark.parametrize(
    "source",
    [
        "from heapq import heappop",
        "import bisect",
        "def f(a, w):\n    while a:\n        here = a.pop()\n        a += w[here]",
        "def f(a, w):\n    while a:\n        a.extend(w[a.popleft()])",
        "def f(b, w):\n    while b:\n        b = [to for cell in b for to in w[cell]]",
    ],
)
def test_a_search_is_noticed(source: str) -> None:
    assert [*own_searches(source)]


@pytest.mark.parametrize(
    "source", ["import math", "def f(a):\n    while a:\n        a.pop()", "while True:\n    a = 1"]
)
def test_what_only_ends_is_no_search(source: str) -> None:
    assert not [*own_searches(source)]


@pytest.mark.parametrize("system", ["car_park", "graph", "mapd"])
def test_they_use_the_one_network(system: str) -> None:
    imported = {
        node.module
        for file in (SYSTEMS / system).rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom)
    }
    shared = {"car_park": "onboard.ways.sipp", "graph": "onboard.ways.network", "mapd": "onboard.ways.sipp"}
    assert shared[system] in imported
