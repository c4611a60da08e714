"""``python -m tests.conform.mutants``: break our robot in 60 places, one at a time, and play the kit before each.

Mutations are drawn by a seed from the lines that the robot runs in the plays: a comparison turned round, ``and`` for
``or``, a ``not`` left out, a sum for a difference, a number one more, a truth for its contrary, a call left out. Left
out are those that no frame could ever tell: what goes to the telemetry only (``UNHEARD``), and files about machines
that the benches do not have (``_OF_OTHERS``). A mutant is caught where a check fails. Each is played in a process of
its own, in virtual time, ``--jobs N`` of them at a time.
"""

import argparse
import ast
import json
import random
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import spec_from_loader
from types import CodeType, FrameType, ModuleType
from typing import Any, NamedTuple

from tests.project.rows import ROOT

#: The number of the issue that asked for the kit; fixed before any mutant was played.
SEED, COUNT = 19, 60
#: This module, also where it is run as a command.
NAME = "tests.conform.mutants"
#: A mutant that never ends is caught as well, s.
LIMIT_S = 120
#: What the robot runs and neither the kit nor the plant does: a mutant must not bend the ruler.
FOLDERS = ("onboard/controller", "onboard/core", "onboard/holon", "onboard/systems/car_park", "onboard/ways")
_SHARED = frozenset(
    {
        *("onboard/core/frame.py", "onboard/core/serial.py", "onboard/core/site.py", "onboard/core/token_keys.py"),
        *("onboard/ways/site.py", "onboard/ways/kinematics.py", "onboard/systems/car_park/site.py"),
        "onboard/ways/lifts.py",
    }
)
#: What is told to the telemetry alone: counters of the negotiation, events, and reports for people.
UNHEARD = frozenset({"counters", "telemetry", "Report"})
#: What a robot runs as well, where nothing comes of it: what a compartment remembers.
_OF_OTHERS = frozenset({"onboard/systems/car_park/bay_memory.py"})
_CONTRARY: dict[type[ast.AST], Any] = {
    one: other
    for pair in (
        *((ast.Lt, ast.GtE), (ast.Gt, ast.LtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn)),
        *((ast.And, ast.Or), (ast.Add, ast.Sub)),
    )
    for one, other in (pair, pair[::-1])
}


class Mutation(NamedTuple):
    """One node of one file's tree, by its place in ``ast.walk``."""

    file: str
    node: int
    line: int
    what: str


#: The robot as it is: what it breaks every mutant would be caught by.
UNCHANGED = Mutation("", -1, 0, "")


def mutations(file: str, lines: set[int]) -> Iterator[Mutation]:
    """All that could be done to these lines of a file, inside functions."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    inside = {
        id(one)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for body in function.body
        for one in ast.walk(body)
    }
    unheard = {id(one) for statement in ast.walk(tree) if _is_unheard(statement) for one in ast.walk(statement)}
    for number, node in enumerate(ast.walk(tree)):
        line = getattr(node, "lineno", 0)
        is_drawn = id(node) in inside and id(node) not in unheard and line in lines
        what = _kind(node) if is_drawn else ""
        if what:
            yield Mutation(file, number, line, what)


def _is_unheard(node: ast.AST) -> bool:
    """Whether a statement or call does nothing else than tell the telemetry."""
    match node:
        case ast.AugAssign(target=ast.Attribute(value=ast.Attribute(attr=attr))):
            return attr in UNHEARD
        case ast.Expr(value=ast.Call(func=ast.Attribute(value=ast.Attribute(attr=attr)))):
            return attr in UNHEARD
        case ast.Call(func=ast.Name(id=name)):
            return name in UNHEARD
    return False


def _kind(node: ast.AST) -> str:
    match node:
        case ast.Compare(ops=[_]) | ast.BoolOp():
            return "contrary"
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            return "contrary"
        case ast.UnaryOp(op=ast.Not()):
            return "no not"
        case ast.Constant(value=bool()):
            return "contrary"
        case ast.Constant(value=int()):
            return "one more"
        case ast.Expr(value=ast.Call()):
            return "left out"
    return ""


def change(node: Any) -> None:
    """Break one node of a tree, which ``mutations`` has named."""
    match node:
        case ast.Compare():
            node.ops = [_CONTRARY[type(node.ops[0])]()]
        case ast.BoolOp() | ast.BinOp():
            node.op = _CONTRARY[type(node.op)]()
        case ast.UnaryOp():
            node.op, node.operand = ast.Not(), ast.UnaryOp(ast.Not(), node.operand)
        case ast.Constant(value=bool()):
            node.value = not node.value
        case ast.Constant(value=int() as value):
            node.value = value + 1
        case ast.Expr():
            node.value = ast.Constant(value=None)


def mutated(mutation: Mutation) -> CodeType:
    """The file's code with it."""
    path = ROOT / mutation.file
    tree = ast.parse(path.read_text(encoding="utf-8"))
    node: Any = list(ast.walk(tree))[mutation.node]
    change(node)
    return compile(ast.fix_missing_locations(tree), str(path), "exec")


# --- in a process of its own -------------------------------------------------------------------------------------


class _Mutant(MetaPathFinder, Loader):
    """Loads one module mutated."""

    def __init__(self, mutation: Mutation) -> None:
        self.name = mutation.file.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        self.mutation = mutation

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != self.name:
            return None
        found = PathFinder.find_spec(name, path, target)
        is_package = found is not None and found.submodule_search_locations is not None
        spec = spec_from_loader(name, self, origin=str(ROOT / self.mutation.file), is_package=is_package)
        if spec is not None and found is not None and is_package:
            spec.submodule_search_locations = found.submodule_search_locations
        return spec

    def exec_module(self, module: ModuleType) -> None:
        exec(mutated(self.mutation), module.__dict__)  # noqa: S102  # our own code


def _play(mutation: Mutation) -> None:
    """Tell which checks fail."""
    if mutation != UNCHANGED:
        sys.meta_path.insert(0, _Mutant(mutation))
    from onboard.conform.checks import Verdict
    from tests.conform.bench import SITES, play

    found: list[str] = []
    for site in SITES:
        # What the first bench catches needs no second one.
        failed = () if found else play(site=site, stops_at_first=True).findings.of(Verdict.FAILED)
        found += [f"{one.check.name} ({site.name})" for one in failed]
    print(json.dumps(found))


def _lines() -> None:
    """Tell which lines run in the play before the robot as it is."""
    from tests.conform.bench import SITES, play

    found: dict[str, set[int]] = {}
    root = f"{ROOT}/"

    #: Lines of a function that have not run yet; nothing of a function of no interest.
    left: dict[CodeType, set[int]] = {}

    def local(frame: FrameType, event: str, _: Any) -> Any:
        if event == "line":
            found.setdefault(frame.f_code.co_filename, set()).add(frame.f_lineno)
            left[frame.f_code].discard(frame.f_lineno)
        return local

    def trace(frame: FrameType, _: str, __: Any) -> Any:
        code = frame.f_code
        if code not in left:
            name = code.co_filename.removeprefix(root)
            is_its = name.startswith(FOLDERS) and name not in _SHARED | _OF_OTHERS and "/conform/" not in name
            lines = {line for *_, line in code.co_lines() if line is not None} - {code.co_firstlineno}
            left[code] = lines if is_its else set()
        return local if left[code] else None

    threading.settrace(trace)
    sys.settrace(trace)
    for site in SITES:
        play(site=site)
    sys.settrace(None)
    print(json.dumps({file.removeprefix(root): sorted(lines) for file, lines in sorted(found.items())}))


# --- the command -------------------------------------------------------------------------------------------------


def draw(seed: int, count: int) -> list[Mutation]:
    """So many of all that could be done, each as likely."""
    run = subprocess.run([sys.executable, "-m", NAME, "--lines"], cwd=ROOT, capture_output=True, check=True)
    every = [one for file, lines in json.loads(run.stdout).items() for one in mutations(file, set(lines))]
    return random.Random(seed).sample(every, count)


def judge(mutation: Mutation) -> list[str]:
    """The checks that fail; what it died of where it could not be played."""
    words = [sys.executable, "-m", NAME, "--play", json.dumps(mutation)]
    try:
        run = subprocess.run(words, cwd=ROOT, capture_output=True, check=False, timeout=LIMIT_S, text=True)
    except subprocess.TimeoutExpired:
        return [f"not over after {LIMIT_S} s"]
    if run.returncode:
        return [(run.stderr.strip().splitlines() or ["?"])[-1][:100]]
    found: list[str] = json.loads(run.stdout.splitlines()[-1])
    return found


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--lines", action="store_true", help="only tell which lines run")
    parser.add_argument("--play", help="only play this mutation")
    options = parser.parse_args()
    if options.lines:
        _lines()
        return 0
    if options.play:
        _play(Mutation(*json.loads(options.play)))
        return 0
    drawn = draw(options.seed, options.count)
    broken = judge(UNCHANGED)
    if broken:
        print(f"our robot as it is breaks {', '.join(broken)}: what a mutant breaks would tell nothing")
        return 2
    caught = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for mutation, failed in zip(drawn, pool.map(judge, drawn), strict=True):
            caught += bool(failed)
            text = (ROOT / mutation.file).read_text(encoding="utf-8").splitlines()[mutation.line - 1].strip()
            told = f"caught by {len(failed)}: {failed[0]}" if failed else "NOT CAUGHT"
            print(f"{mutation.file}:{mutation.line} [{mutation.what}] {text[:60]}\n    {told}", flush=True)
    print(f"{caught} of {len(drawn)} mutants were caught (seed {options.seed})")
    return 0 if len(drawn) - caught <= len(drawn) * 3 // 60 else 1


if __name__ == "__main__":
    sys.exit(main())
