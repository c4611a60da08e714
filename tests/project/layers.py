"""Who may import whom: the table of the design, section 2, and a checker that reads import statements.

Nothing is imported to find out: every file is parsed, so a wrong import shows even where it would fail or is only for
type checkers. Reports are one line each: file, line, what, and the rule it breaks.
"""

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

#: What holds no decision: values and names that every layer may share.
CORE_TYPES = (
    "onboard.contract",
    "onboard.core.frame",
    "onboard.core.journal_records",
    "onboard.core.journal_state",
    "onboard.core.records",
    "onboard.holon.remedies",
    "onboard.core.serial",
    "onboard.core.site",
    "onboard.ways.site",
    "onboard.work.timing",
)

FOLDER = Path(__file__).parents[2] / "onboard" / "systems"
#: The systems: each is a folder.
SYSTEMS = tuple(sorted(folder.name for folder in FOLDER.iterdir() if (folder / "system.py").is_file()))

#: How the parts of a site's own system are found.
REGISTRY = ("onboard.systems.contract", "onboard.systems.registry", "onboard.systems.words")

#: Standard modules without I/O, clock, chance or tasks: all that decisions may use.
PURE_STDLIB = frozenset(
    {
        *("__future__", "abc", "array", "bisect", "collections", "contextlib", "copy", "dataclasses", "enum"),
        *("fractions", "functools", "heapq", "itertools", "math", "numbers", "operator", "string", "struct"),
        *("binascii", "types", "typing", "zlib"),
    }
)

#: Standard modules by which a clock, chance or a thread comes in through the back door.
CLOCK_AND_CHANCE = frozenset(
    ["concurrent", "datetime", "logging", "multiprocessing", "random", "secrets", "threading", "time", "uuid"]
)

#: Built-in functions that read, print, run text, or differ with the hash seed.
IMPURE_BUILTINS = frozenset({"breakpoint", "compile", "eval", "exec", "hash", "input", "open", "print"})

#: What puts things into an order; an order by identity differs from run to run.
ORDERING = frozenset({"heappush", "heapify", "insort", "max", "min", "nlargest", "nsmallest", "sort", "sorted"})

ALL_OF_ONBOARD = (
    "onboard.bounded_file",
    "onboard.config",
    "onboard.contract",
    "onboard.controller",
    "onboard.core",
    "onboard.history",
    "onboard.holon",
    "onboard.io",
    "onboard.ports",
    "onboard.seal",
    "onboard.systems",
    "onboard.ways",
    "onboard.wire",
    "onboard.work",
)


@dataclass(frozen=True, slots=True)
class Layer:
    """What the files of one layer may import: ``projects`` and below, third-party ``libraries``, standard modules.

    ``only_stdlib`` None allows the whole standard library but ``not_stdlib``. A layer may always import itself.
    """

    projects: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()
    only_stdlib: frozenset[str] | None = None
    not_stdlib: frozenset[str] = frozenset()
    pure: bool = False


def _parts_of(system: str) -> Iterator[tuple[str, Layer]]:
    """The layers of one system's folder: its machines decide and nothing else; reader, judges and drawing do not."""
    own = f"onboard.systems.{system}"
    machines = ("onboard.core", "onboard.ways", "onboard.work", "onboard.systems.system")
    yield own, Layer(machines, only_stdlib=PURE_STDLIB, pure=True)
    config = Layer(
        ("onboard.config", "onboard.core", "onboard.ways", own), not_stdlib=CLOCK_AND_CHANCE | {"asyncio", "socket"}
    )
    history = Layer(
        (*CORE_TYPES, own, "onboard.history", "onboard.trace", "onboard.ways", "onboard.wire"),
        not_stdlib=frozenset({"asyncio", "random", "threading"}),
    )
    fold = Layer((*CORE_TYPES, own, "onboard.history"), only_stdlib=PURE_STDLIB, pure=True)
    words = Layer((*CORE_TYPES, own, "onboard.systems.words"), only_stdlib=PURE_STDLIB, pure=True)
    edge = Layer(
        (*CORE_TYPES, own, "onboard.gateway", "onboard.history", "onboard.trace.view"),
        not_stdlib=frozenset({"random", "socket", "threading", "time"}),
    )
    kit = (*CORE_TYPES, own, "onboard.conform", "onboard.core.token_keys")
    parts = {
        "conform": Layer(kit, only_stdlib=PURE_STDLIB, pure=True),
        "gateway": edge,
        "history": fold,
        "words": words,
        "tickets": Layer(machines, only_stdlib=PURE_STDLIB | {"hashlib", "hmac"}, pure=True),
        **dict.fromkeys(("constants", "layout", "machines", "missions_reader", "reader", "report", "room"), config),
        **dict.fromkeys(("building", "chart", "checks", "diagram", "scene", "traffic"), history),
    }
    folder = FOLDER / system
    yield from ((f"{own}.{noun}", rule) for noun, rule in parts.items() if _is_part(folder / noun))


def _is_part(place: Path) -> bool:
    return place.is_dir() or place.with_suffix(".py").is_file()


#: The one file that loads modules by computed names: parts of systems.
FINDER = "onboard/systems/folders.py"

#: The longest name that fits decides. ``onboard`` itself is the composition root: ``cli``, ``entry``, ``life`` and
#: ``__main__``.
LAYERS: dict[str, Layer] = {
    "onboard.contract": Layer(only_stdlib=PURE_STDLIB),
    # Whoever reads a file of others.
    "onboard.bounded_file": Layer(not_stdlib=frozenset({"asyncio", "random", "socket", "threading"})),
    "onboard.nesting": Layer(only_stdlib=PURE_STDLIB),
    # Writes the rest of it; runs where somebody changes a DBC, never on a board.
    "onboard.contract.generate": Layer(("onboard.wire.dbc_file", "dbc")),
    "onboard.core": Layer(only_stdlib=PURE_STDLIB, pure=True),
    # One machine put together of the core's parts; the core does not know it.
    "onboard.holon": Layer(("onboard.core",), only_stdlib=PURE_STDLIB, pure=True),
    # Proof of who said a frame, between the bus and whoever listens: no machine's decision knows of it.
    "onboard.seal": Layer(("onboard.core.frame",), only_stdlib=PURE_STDLIB | {"hashlib"}, pure=True),
    "onboard.ways": Layer(("onboard.core",), only_stdlib=PURE_STDLIB, pure=True),
    "onboard.work": Layer(("onboard.core", "onboard.ways"), only_stdlib=PURE_STDLIB, pure=True),
    # It knows no system by name; a system's parts are found by the name of their folder.
    "onboard.systems": Layer(("onboard.core", "onboard.work.compaction")),
    "onboard.systems.contract": Layer(("onboard.core.site", "onboard.systems.registry", "onboard.wire")),
    **{layer: rule for system in SYSTEMS for layer, rule in _parts_of(system)},
    # The one fold of the bus: whoever shows, counts or publishes it is a view of this.
    "onboard.history": Layer((*CORE_TYPES, *REGISTRY), only_stdlib=PURE_STDLIB, pure=True),
    "onboard.wire": Layer(
        (*CORE_TYPES, "onboard.core.effects", "dbc"),
        ("cantools",),
        not_stdlib=CLOCK_AND_CHANCE | {"asyncio", "socket"},
    ),
    "onboard.ports": Layer(CORE_TYPES, not_stdlib=CLOCK_AND_CHANCE | {"asyncio", "socket"}),
    "onboard.config": Layer(
        (
            *("onboard.bounded_file", "onboard.core", "onboard.nesting", "onboard.seal.keys", "onboard.systems"),
            *("onboard.ways", "onboard.work.timing"),
        ),
        not_stdlib=CLOCK_AND_CHANCE | {"asyncio", "socket"},
    ),
    "onboard.controller": Layer(
        ("onboard.core", "onboard.holon", "onboard.wire", "onboard.ports"),
        not_stdlib=CLOCK_AND_CHANCE | {"socket", "os", "pathlib"},
    ),
    "onboard.io": Layer(
        ("onboard.bounded_file", "onboard.ports", "onboard.core", "onboard.seal", "onboard.wire"), ("can", "aiomqtt")
    ),
    # Runs where somebody commissions a site, never on a board.
    "onboard.keys": Layer(
        (
            *("onboard.config", "onboard.core.site", "onboard.seal.keys"),
            *("onboard.systems.registry", "onboard.systems.system"),
        )
    ),
    "onboard.trace": Layer(
        (*CORE_TYPES, *REGISTRY, "onboard.history", "onboard.seal.heard", "onboard.wire"),
        not_stdlib=frozenset({"asyncio", "random", "threading"}),
    ),
    # Logs a million frames at a time: on a desk, never on a board; the rest of the trace does without.
    "onboard.trace.columns": Layer(
        (*CORE_TYPES, "onboard.trace", "onboard.wire"),
        ("numpy", "pyarrow"),
        not_stdlib=frozenset({"asyncio", "random", "threading"}),
    ),
    # What python-can reads, python-can reads.
    "onboard.trace.readers.python_can": Layer(
        ("onboard.core.frame", "onboard.trace"), ("can",), not_stdlib=frozenset({"asyncio", "random", "threading"})
    ),
    # The trace's own command line reads site files; the composition root loads it where it is asked for.
    "onboard.trace.cli": Layer((*CORE_TYPES, "onboard.config", "onboard.trace")),
    # Its commands are a composition root too: they name the contract of a site's system, and replay runs a controller.
    "onboard.trace.commands": Layer((*ALL_OF_ONBOARD, "onboard.trace")),
    # Judges nothing: it runs the very code of a controller, and only compares what comes out.
    "onboard.trace.replay": Layer((*ALL_OF_ONBOARD, "onboard.trace")),
    # The page shows what the trace knows; only its own command line opens files and buses.
    "onboard.web": Layer(
        (*CORE_TYPES, "onboard.history", "onboard.seal", "onboard.trace", "onboard.wire"), ("starlette", "uvicorn")
    ),
    "onboard.web.cli": Layer(
        (
            *(*CORE_TYPES, "onboard.config", "onboard.io", "onboard.seal.keys"),
            *("onboard.systems", "onboard.trace", "onboard.web", "onboard.wire"),
        )
    ),
    # What is published is decided from the decoded bus alone; sessions, files and buses come in through ports.
    "onboard.gateway": Layer(
        (
            *CORE_TYPES,
            *REGISTRY,
            "onboard.history",
            "onboard.nesting",
            "onboard.ports",
            "onboard.trace",
            "onboard.web.picture",
            "onboard.wire",
        ),
        not_stdlib=frozenset({"random", "socket", "threading", "time"}),
    ),
    # Its command line is a composition root: it opens the bus, the journal and the broker.
    "onboard.gateway.cli": Layer(
        (
            *CORE_TYPES,
            "onboard.config",
            "onboard.gateway",
            "onboard.io",
            "onboard.systems",
            "onboard.ports",
            "onboard.seal.keys",
            "onboard.wire",
        )
    ),
    # The kit decides as machines do, from frames and times alone; it knows no controller that it may judge.
    "onboard.conform": Layer(
        (*CORE_TYPES, *REGISTRY, "onboard.core.token_keys", "onboard.wire"), only_stdlib=PURE_STDLIB, pure=True
    ),
    "onboard.conform.report": Layer(("onboard.conform", "onboard.core.frame"), only_stdlib=PURE_STDLIB | {"xml"}),
    # Its command line is a composition root: it opens the bus, the site file and what switches the node.
    "onboard.conform.cli": Layer(
        (
            *(*CORE_TYPES, "onboard", "onboard.config", "onboard.conform", "onboard.io", "onboard.ports.bus"),
            *("onboard.systems", "onboard.wire"),
        )
    ),
    # What a person says is decided from the history of the bus alone; the gateway's words for a held machine are its
    # own.
    "onboard.operate": Layer(
        (
            *CORE_TYPES,
            "onboard.config.problems",
            *(f"onboard.core.{name}" for name in ("assignments", "authority")),
            *(f"onboard.holon.{name}" for name in ("holding", "regeneration")),
            "onboard.ways.lifts",
            "onboard.gateway.edge",
            "onboard.ways.tokens",
            "onboard.gateway.pauses",
            "onboard.gateway.positions",
            "onboard.history",
            "onboard.ports",
            "onboard.wire",
        ),
        not_stdlib=frozenset({"random", "socket", "threading", "time"}),
    ),
    # Its command line is a composition root: it opens the bus and the site file.
    "onboard.operate.cli": Layer(
        (
            *CORE_TYPES,
            *("onboard.config", "onboard.io", "onboard.systems", "onboard.operate", "onboard.ports.bus"),
            *("onboard.seal.keys", "onboard.wire"),
        )
    ),
    "onboard.gateway.roles_file": Layer((*CORE_TYPES, "onboard.config", "onboard.gateway")),
    "onboard.gateway.options": Layer((*CORE_TYPES, "onboard.bounded_file", "onboard.gateway", "onboard.io")),
    "onboard": Layer(
        (
            *ALL_OF_ONBOARD,
            *(
                "onboard.cli",
                "onboard.conform.cli",
                "onboard.entry",
                "onboard.keys.cli",
                "onboard.life",
                "onboard.operate.cli",
            ),
            "onboard.trace.cli",
            *("onboard.web.address", "onboard.web.cli"),
            *(f"onboard.gateway.{name}" for name in ("cli", "gateway", "options", "settings")),
        ),
        not_stdlib=frozenset({"random", "threading", "time"}),
    ),
    "dbc": Layer(not_stdlib=CLOCK_AND_CHANCE | {"asyncio"}),
    "bus_sim": Layer(
        (
            *("onboard", "onboard.entry", "onboard.gateway", "onboard.operate", "onboard.trace", "onboard.web"),
            *(*ALL_OF_ONBOARD, "dbc"),
        ),
        ("distributed", "numpy", "ortools", "rich", "yaml"),
        not_stdlib=frozenset({"threading"}),
    ),
    # A board's updater listens for its own controller's heartbeats.
    "deploy": Layer(
        (
            *(
                "onboard",
                "onboard.bounded_file",
                "onboard.config",
                "onboard.entry",
                *CORE_TYPES,
                "onboard.io.journal",
                # Which kinds keep secrets that must not be said on the fleet bus.
                "onboard.systems.registry",
                "onboard.systems.system",
                "onboard.wire",
            ),
            *("hil.guest.effort", "hil.guest.initrd", "hil.guest.kernel"),
        ),
        ("pytest",),
    ),
    # A bench starts the programs themselves.
    "hil": Layer(
        ("onboard", "onboard.cli", "onboard.entry", "onboard.trace", *ALL_OF_ONBOARD, "bus_sim", "dbc"), ("pytest",)
    ),
}

#: What is said on a bus is everybody's to name; only ``dbc``, of which it is made, is below it.
LAYERS = {
    name: replace(rule, projects=("onboard.contract", *rule.projects)) if name.startswith("onboard.") else rule
    for name, rule in LAYERS.items()
}

#: Libraries that only these files may know, because their interfaces move.
EXCLUSIVE: dict[str, tuple[str, ...]] = {
    "aiomqtt": ("onboard/io/mqtt.py",),
    "can": ("onboard/io/pycan.py", "onboard/trace/readers/python_can.py"),
    "cantools": ("onboard/wire/dbc_file.py",),
    "distributed": ("bus_sim/engine.py",),
    "pyarrow": ("onboard/trace/columns/parquet.py",),
    "ortools": ("bus_sim/systems/car_park/compare/optimum.py",),
}


@dataclass(frozen=True, slots=True)
class Import:
    """One imported module: absolute dotted name and the line that asks for it."""

    module: str
    line: int


def check_tree(root: Path) -> list[str]:
    """All breaches of the table in the packages below ``root``, one line each, in the order of file and line."""
    breaches: list[str] = []
    for package in sorted({name.partition(".")[0] for name in LAYERS}):
        for file in sorted((root / package).rglob("*.py")):
            breaches += _check_file(root, file)
    return breaches


def _check_file(root: Path, file: Path) -> Iterator[str]:
    place = file.relative_to(root).as_posix()
    module = _module_name(root, file)
    own = layer_of(module)
    layer = LAYERS[own]
    tree = ast.parse(file.read_text(encoding="utf-8"), place)
    for found in imports_of(tree, root, module, is_package=file.name == "__init__.py"):
        wrong = _breach(found.module, own, layer, place)
        if wrong:
            yield f"{place}:{found.line}: {own} imports {found.module}: {wrong}"
    for line, what in _dynamic_imports(tree) if place != FINDER else ():
        yield f"{place}:{line}: {what}: a computed import cannot be checked; write an import statement"
    if layer.pure:
        for line, what in _impure_calls(tree):
            yield f"{place}:{line}: {own} {what}: decisions do no I/O and depend on no memory order or hash seed"


def layer_of(module: str) -> str:
    """The layer that a module belongs to. Raises ``KeyError`` for a package that has no line in the table."""
    parts = module.split(".")
    if parts[0] == "onboard" and len(parts) > 1 and ".".join(parts[:2]) not in LAYERS:
        if len(parts) > 2 or parts[1] not in ("cli", "entry", "life", "__main__"):
            raise KeyError(f"{module}: no layer; add a line to the table and to docs/decisions.md")
        return "onboard"
    for length in range(len(parts), 0, -1):
        name = ".".join(parts[:length])
        if name in LAYERS:
            return name
    raise KeyError(f"{module}: no layer")


def imports_of(tree: ast.AST, root: Path, module: str, *, is_package: bool) -> Iterator[Import]:
    """Every module that a file asks for, wherever the statement stands; ``from a import b`` is ``a.b`` if a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(alias.name, node.lineno)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, module, is_package=is_package)
            for alias in node.names:
                below = f"{base}.{alias.name}"
                yield Import(below if _is_module(root, below) else base, node.lineno)


def _absolute(node: ast.ImportFrom, module: str, *, is_package: bool) -> str:
    if node.level == 0:
        return node.module or ""
    parts = module.split(".")
    parts = parts[: len(parts) - node.level + (1 if is_package else 0)]
    return ".".join([*parts, *([node.module] if node.module else [])])


def _module_name(root: Path, file: Path) -> str:
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _is_module(root: Path, name: str) -> bool:
    path = root.joinpath(*name.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def _breach(module: str, own: str, layer: Layer, place: str) -> str:
    """Why ``module`` must not be imported in this place; empty where it may."""
    top = module.partition(".")[0]
    if top in {name.partition(".")[0] for name in LAYERS} | {"tests", "bench"}:
        return "" if _project_allowed(module, own, layer) else f"it may import {_words(layer.projects)}"
    if top in sys.stdlib_module_names:
        if layer.only_stdlib is not None and top not in layer.only_stdlib:
            return "this layer may use only standard modules without I/O, clock, chance or tasks"
        return "time, chance and I/O come in as arguments or through a port" if top in layer.not_stdlib else ""
    if top in EXCLUSIVE and place not in EXCLUSIVE[top]:
        return f"only {_words(EXCLUSIVE[top])} may know this library"
    return "" if top in layer.libraries else f"its libraries are {_words(layer.libraries)}"


def _project_allowed(module: str, own: str, layer: Layer) -> bool:
    if own == "onboard" and module == "onboard.trace":
        return False
    # The bare root package holds the version number only: to allow it is not to allow what is below it.
    below = [f"{name}." for name in (own, *layer.projects) if name != "onboard"]
    return module in (own, *layer.projects) or module.startswith(tuple(below))


def _called(node: ast.Call) -> str:
    """Last part of the name of what is called; empty where it has none."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _dynamic_imports(tree: ast.AST) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _called(node) in ("__import__", "import_module", "run_module", "run_path"):
            yield node.lineno, f"{_called(node)}()"


def _impure_calls(tree: ast.AST) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        if isinstance(node.func, ast.Name) and node.func.id in IMPURE_BUILTINS:
            yield node.lineno, f"calls {node.func.id}()"
        if _called(node) in ORDERING and any(isinstance(n, ast.Name) and n.id == "id" for n in ast.walk(node)):
            yield node.lineno, f"orders by identity in {_called(node)}()"


def _words(names: tuple[str, ...]) -> str:
    return ", ".join(names) if names else "none"
