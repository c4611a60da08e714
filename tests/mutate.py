"""``python -m tests.mutate [ROW ...]``: break the product once or twice for each row, and see the row's test fail.

All tests run once as things are: one that fails anyway finds nothing. Then each mutation of ``docs/systems/*.toml`` is
made alone in a copy of the tree, and the row's test runs there. A mutation that its test does not find ends the command
with status 1. ``--jobs N`` runs several copies side by side.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

from tests.project.rows import ROOT, Mutation, Row, all_names, read_rows

#: A mutation that makes a test run for ever is found as well.
LIMIT_S = 300
#: What pytest says where tests failed; anything else but a time-out means that the test itself could not be run.
_FAILED = 1


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("rows", nargs="*", metavar="ROW", help="such as M22; default: all that have a mutation")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="copies side by side (default: processors)"
    )
    options = parser.parse_args()
    rows = read_rows()
    unknown = [name for name in options.rows if name not in rows]
    if unknown:
        parser.error(f"{unknown[0]}: no such row in docs/systems; rows are P01 to A06")
    wanted = [rows[name] for name in (options.rows or all_names()) if name in rows and rows[name].mutation is not None]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies: Queue[Path] = Queue()
        for number in range(max(1, min(options.jobs, len(wanted)))):
            copies.put(_copy(Path(folder) / str(number)))
        broken = _already_broken(wanted, copies)
        if broken:
            print(f"without any mutation: {broken}")
            return 1
        with ThreadPoolExecutor(copies.qsize()) as pool:
            made = [(row, mutation) for row in wanted for mutation in row.mutations]
            survived = [told for told in pool.map(lambda one: _judge(one[0], one[1], copies), made) if told]
    print(f"{len(made) - len(survived)} of {len(made)} mutations were found by their rows' tests")
    for line in survived:
        print(line)
    return 1 if survived else 0


def _copy(target: Path) -> Path:
    """The product and its tests, without what git does not know."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    for name in listed.stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)
    return target


def _already_broken(rows: list[Row], copies: Queue[Path]) -> str | None:
    """What the first failing test says where one fails without a mutation, else None."""
    tests = sorted({row.test for row in rows if row.test is not None})
    if not tests:
        return None
    copy = copies.get()
    status, why = _run(tests, copy, LIMIT_S * len(tests))
    copies.put(copy)
    return None if status == 0 else f"pytest's status {status}: {why}"


def _judge(row: Row, mutation: Mutation, copies: Queue[Path]) -> str | None:
    """None where the test failed with the mutation; else one line."""
    assert row.test is not None
    if mutation.mistake is not None:
        return f"{row.name}: {mutation.mistake}"
    copy = copies.get()
    file = copy / mutation.file
    whole = file.read_text(encoding="utf-8")
    try:
        file.write_text(whole.replace(mutation.old, mutation.new), encoding="utf-8")
        status, why = _run([row.test], copy)
    finally:
        file.write_text(whole, encoding="utf-8")
        copies.put(copy)
    verdict = "found" if status in (_FAILED, None) else f"SURVIVED (pytest's status {status})"
    print(f"{row.name}  {verdict:8}  {mutation.file}  {row.test}\n     {why}", flush=True)
    return (
        None if status in (_FAILED, None) else f"{row.name}: {row.test} does not fail with the mutation of {file.name}"
    )


def _run(tests: list[str], copy: Path, limit_s: int = LIMIT_S) -> tuple[int | None, str]:
    """Pytest's status, None after a time-out; and the first error that it tells, to judge by whether it is the one."""
    words = [sys.executable, "-B", "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        run = subprocess.run(
            words,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy), "COLUMNS": "200"},
            capture_output=True,
            check=False,
            timeout=limit_s,
            text=True,
        )
    except subprocess.TimeoutExpired:
        return None, f"not over after {limit_s} s"
    begins = "E " if len(tests) == 1 else "FAILED "
    told = [line.removeprefix(begins).strip() for line in run.stdout.splitlines() if line.startswith(begins)]
    return run.returncode, next(iter(told), run.stdout.strip().rpartition("\n")[2])[:160]


if __name__ == "__main__":
    sys.exit(main())
