"""What names a system outside its two folders, and other ties that would keep a system from being a plug-in.

Every file is parsed and nothing is imported. A system is named by an import of its folder, by a text that is its name,
or by its site type in ``isinstance``.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: What ships; each top folder may have files of systems below ``systems`` only.
TOPS = ("onboard", "bus_sim", "hil")
#: The systems, by the name of their folders.
SYSTEMS = tuple(sorted(one.parent.name for one in (ROOT / "onboard" / "systems").glob("*/system.py")))
#: The type of each system's site.
SITES = {
    "car_park": "CarPark",
    "cell": "Cell",
    "graph": "FactoryGraph",
    "mapd": "Mapd",
    "terminal": "Terminal",
    "turning": "Turning",
}


@cache
def files() -> dict[str, ast.Module]:
    """Every product file by its path below the root, parsed."""
    found = {}
    for top in TOPS:
        for path in sorted((ROOT / top).rglob("*.py")):
            if not path.name.startswith("test_"):
                found[path.relative_to(ROOT).as_posix()] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def home(file: str) -> str:
    """The system in whose folder a file is; empty for all others."""
    parts = file.split("/")
    return parts[2] if len(parts) > 3 and parts[1] == "systems" and parts[2] in SYSTEMS else ""


def imports(tree: ast.Module) -> Iterator[str]:
    """Every module that a file imports, also for type checkers or inside a function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{one.name}" for one in node.names)


def named_by(tree: ast.Module, *, is_home: bool) -> set[str]:
    """The systems that a file names: by an import of theirs, or by a text that is a system's name."""
    found = set()
    for module in imports(tree):
        parts = module.split(".")
        if len(parts) > 2 and parts[1] == "systems" and parts[2] in SYSTEMS:
            found.add(parts[2])
    # In the folder of another system such a word may mean another thing: a cell of a map is no cell of arms.
    for node in () if is_home else ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            word = node.value.replace("-", "_")
            if word in SYSTEMS:
                found.add(word)
    return found


@cache
def named() -> dict[str, set[str]]:
    """Of every file the systems that it names."""
    return {file: named_by(tree, is_home=bool(home(file))) for file, tree in files().items()}


def outsiders(system: str) -> set[str]:
    """Files outside its two folders that name a system."""
    return {file for file, systems in named().items() if home(file) != system and system in systems}


def _is_site(node: ast.expr) -> bool:
    return isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node).split(".")[-1].strip("_") == "site"


def asks_for_site_type() -> dict[str, int]:
    """How often each file outside a system's folder asks ``isinstance`` of a site."""
    found = {}
    for file, tree in files().items():
        calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call) and len(node.args) == 2)
        count = sum(
            isinstance(one.func, ast.Name) and one.func.id == "isinstance" and _is_site(one.args[0]) for one in calls
        )
        if count and not home(file):
            found[file] = count
    return found


def casts(top: str) -> list[str]:
    """Every call of ``typing.cast`` below a folder."""
    return [
        f"{file}:{node.lineno}"
        for file, tree in files().items()
        if file.startswith(f"{top}/")
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and _is_cast(node.func, tree)
    ]


def _is_cast(called: ast.expr, tree: ast.Module) -> bool:
    if isinstance(called, ast.Name):
        return called.id == "cast" and "typing.cast" in imports(tree)
    return isinstance(called, ast.Attribute) and called.attr == "cast" and ast.unparse(called.value) == "typing"


def circles() -> list[list[str]]:
    """Groups of files that import each other, directly or through others (Tarjan 1972, strongly connected parts)."""
    modules = {_module(file): file for file in files()}
    arrows = {name: sorted(_inside(files()[file], name, set(modules))) for name, file in modules.items()}
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(one: str) -> None:
        order[one] = low[one] = len(order)
        stack.append(one)
        for other in arrows[one]:
            if other not in order:
                visit(other)
                low[one] = min(low[one], low[other])
            elif other in stack:
                low[one] = min(low[one], order[other])
        if low[one] == order[one]:
            group = stack[stack.index(one) :]
            del stack[stack.index(one) :]
            if len(group) > 1:
                found.append(sorted(group))

    for name in modules:
        if name not in order:
            visit(name)
    return found


def _module(file: str) -> str:
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _inside(tree: ast.Module, own: str, known: set[str]) -> set[str]:
    """The project's modules that a file imports; a package counts only where nothing below it is meant."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            below = {f"{node.module}.{one.name}" for one in node.names} & known
            found |= below or {node.module}
    return (found & known) - {own}


def classes(top: str) -> list[tuple[str, str]]:
    """Every class below a folder, and its file."""
    return [
        (node.name, file)
        for file, tree in files().items()
        if file.startswith(f"{top}/")
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    ]


def makes_loop(tree: ast.Module) -> bool:
    """Whether a file makes an event loop's time pass itself, so that it holds a run of its own."""
    return any(isinstance(node, ast.Attribute) and node.attr == "run_until_complete" for node in ast.walk(tree))
