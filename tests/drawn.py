"""``python -m tests.drawn ROW ...``: a second mutation of a row, drawn from the function of its first.

The draw is that of ``tests.conform.mutants``, with a seed that was fixed before any was played: the issue's number and
the row's name. Behind what can be done to that function comes what can be done to the whole file, and where that is a
table, to the file that reads it. It is printed as the row's table in ``docs/systems/*.toml`` has it (``drawn``). Where
nothing could tell one ``--skip N`` passes over the first N of the row's draw; why, is said beside the table.
"""

import argparse
import ast
import json
import random

from tests.conform.mutants import SEED, change, mutations
from tests.conform.mutants import Mutation as Drawn
from tests.project.rows import ROOT, Mutation, read_rows


def draw(row: str, skip: int = 0) -> Mutation:
    """The draw of a row. Raises ``ValueError`` where it has no mutation."""
    made = read_rows()[row].mutation
    if made is None:
        raise ValueError(f"{row} has no mutation")
    whole = (ROOT / made.file).read_text(encoding="utf-8")
    line = whole[: whole.index(made.old) + len(made.old) - len(made.old.lstrip())].count("\n") + 1
    tree = ast.parse(whole)
    around = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef) and one.lineno <= line]
    around = [one for one in around if line <= (one.end_lineno or 0)]
    inside: set[int] = set()
    if around:
        function = max(around, key=lambda one: one.lineno)
        inside = set(range(function.lineno, (function.end_lineno or 0) + 1))
    first = list(mutations(made.file, inside))
    rest = [one for one in _of_file(made.file) if one not in first]
    drawn = random.Random(f"{SEED} {row}").sample(first, len(first))
    behind = rest or _of_file(_reader(made.file))
    chosen = [*drawn, *random.Random(f"{SEED} {row}").sample(behind, len(behind))][skip]
    whole = (ROOT / chosen.file).read_text(encoding="utf-8")
    return _as_text(chosen.file, whole, list(ast.walk(ast.parse(whole)))[chosen.node])


def _of_file(file: str) -> list[Drawn]:
    return list(mutations(file, set(range(1, (ROOT / file).read_text(encoding="utf-8").count("\n") + 2))))


def _reader(file: str) -> str:
    """The first file of the folder that imports from this one, which is a table without functions."""
    module = file.removesuffix(".py").replace("/", ".")
    beside = sorted((ROOT / file).parent.glob("*.py"))
    found = next(one for one in beside if f"from {module} import" in one.read_text(encoding="utf-8"))
    return str(found.relative_to(ROOT))


def _as_text(file: str, whole: str, node: ast.AST) -> Mutation:
    """The lines of a node, with as many before them as make them stand once, and what becomes of them."""
    lines = whole.splitlines(keepends=True)
    segment = ast.get_source_segment(whole, node) or ""
    first, last = node.lineno - 1, node.end_lineno  # type: ignore[attr-defined]  # what `mutations` names has a line
    column = len(lines[first].encode()[: node.col_offset].decode())  # type: ignore[attr-defined]  # and a column
    change(node)
    new = "pass" if isinstance(node, ast.Expr) else ast.unparse(node)
    text = "".join(lines[first:last])
    broken = text[:column] + new + text[column + len(segment) :]
    while whole.count(text) > 1:
        first -= 1
        text, broken = lines[first] + text, lines[first] + broken
    return Mutation(file, text, broken)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("rows", nargs="+", metavar="ROW", help="such as M22")
    parser.add_argument("--skip", type=int, default=0, metavar="N", help="pass over the first N of each row's draw")
    options = parser.parse_args()
    for row in options.rows:
        one = draw(row, options.skip)
        # A string of JSON is one of TOML as well.
        old, new = (json.dumps(text, ensure_ascii=False) for text in (one.old, one.new))
        print(f'[{row}]\ndrawn = {{ file = "{one.file}", old = {old}, new = {new} }}')


if __name__ == "__main__":
    main()
