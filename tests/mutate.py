"""``python -m tests.mutate [ROW ...]``: break the product twice for each row, and see a test of the row's name fail.

All tests run once as things are: one that fails anyway finds nothing. Then each mutation of ``docs/systems/*.toml`` is
made alone in a copy of the tree, and the row's test runs there, and where it passes all others of the row's name. A
mutation that none of them finds ends the command with status 1. ``--jobs N`` runs several copies side by side.

What was found, by which test and in how many seconds, is kept in mutate.toml at once: ``--left`` goes on where a run
was broken off. ``--gate`` plays a minute's worth of those again, chosen by the commit's hash.
"""

import argparse
import hashlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import NamedTuple

from tests.project.rows import ROOT, Mutation, Row, all_names, by_row, read_rows

STORED = Path(__file__).with_name("mutate.toml")
#: What `--gate` may take by the times that are kept, s.
GATE_S = 60
#: A mutation that makes a test run for ever is found as well: a test's share of processor time, and by the clock.
LIMIT_S, CLOCK_LIMIT_S = 30, 600
#: What pytest says where tests failed; anything else but a time-out means that the test itself could not be run.
_FAILED = 1


class Played(NamedTuple):
    """One mutation of a row: ``kind`` is its key in the row's table."""

    row: Row
    kind: str
    mutation: Mutation

    @property
    def name(self) -> str:
        """As mutate.toml calls it."""
        return f"{self.row.name} {self.kind}"

    @property
    def digest(self) -> str:
        """Of what is changed: another mutation under the same name was not played."""
        one = self.mutation
        return hashlib.sha256("\0".join((one.file, one.old, one.new)).encode()).hexdigest()[:8]


class Finding(NamedTuple):
    """What became of one mutation: ``test`` is None where none failed."""

    played: Played
    test: str | None
    took_s: float


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("rows", nargs="*", metavar="ROW", help="such as M22; default: all that have a mutation")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="copies side by side (default: processors)"
    )
    parser.add_argument("--left", action="store_true", help="only what mutate.toml does not have as it is")
    parser.add_argument("--gate", action="store_true", help="a minute's worth of what was found, by the commit's hash")
    options = parser.parse_args()
    rows = read_rows()
    unknown = [name for name in options.rows if name not in rows]
    if unknown:
        parser.error(f"{unknown[0]}: no such row in docs/systems; rows are P01 to A06")
    wanted = [rows[name] for name in (options.rows or all_names()) if name in rows and rows[name].mutation is not None]
    made = _made(wanted)
    if options.left:
        made = [one for one in made if one not in found(made, _stored())]
    if options.gate:
        made = chosen(made, _stored(), _commit())
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies: Queue[Path] = Queue()
        for number in range(max(1, min(options.jobs, len(made)))):
            copies.put(_copy(Path(folder) / str(number)))
        # In the gate all tests have just passed.
        broken = None if options.gate else _already_broken(wanted, copies)
        if broken:
            print(f"without any mutation: {broken}")
            return 1
        with ThreadPoolExecutor(copies.qsize()) as pool:
            findings = []
            for one in pool.map(lambda one: _judge(one, copies), made):
                findings.append(one)
                if not options.gate:
                    _store(one)
    survived = [one.played.name for one in findings if one.test is None]
    print(f"{len(made) - len(survived)} of {len(made)} mutations were found by tests of their rows' names")
    for name in survived:
        print(f"{name}: no test of its name fails")
    return 1 if survived else 0


def _made(rows: list[Row]) -> list[Played]:
    return [Played(row, kind, one) for row in rows for kind, one in row.mutations.items()]


def found(made: list[Played], stored: dict[str, str]) -> list[Played]:
    """Those that were found as they are."""
    return [one for one in made if stored.get(one.name, "").startswith(f"{one.digest} ")]


def chosen(made: list[Played], stored: dict[str, str], commit: str) -> list[Played]:
    """What the gate plays: of those that were found as they are, by the commit's hash, no more than ``GATE_S``."""
    left_s, picked = float(GATE_S), list[Played]()
    known = found(made, stored)
    for one in random.Random(commit).sample(known, len(known)):
        took_s = float(stored[one.name].split()[1])
        if took_s <= left_s:
            left_s -= took_s
            picked.append(one)
    return picked


def _commit() -> str:
    run = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, check=True, capture_output=True, text=True)
    return run.stdout.strip()


def _stored() -> dict[str, str]:
    return tomllib.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}


def _store(one: Finding) -> None:
    """Keep what was found, as soon as it was; what was not is kept no more."""
    kept = _stored()
    kept.pop(one.played.name, None)
    if one.test is not None:
        kept[one.played.name] = f"{one.played.digest} {one.took_s:.1f} {one.test}"
    lines = [f'"{name}" = "{kept[name]}"\n' for name in sorted(kept)]
    STORED.write_text(
        "# Written by `python -m tests.mutate`: a mutation's digest, s until a test failed, and which one.\n"
        + "".join(lines),
        encoding="utf-8",
    )


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
    status, why = _run(tests, copy)
    copies.put(copy)
    return None if status == 0 else f"pytest's status {status}: {why}"


def _judge(played: Played, copies: Queue[Path]) -> Finding:
    """Which test fails with the mutation."""
    row, mutation = played.row, played.mutation
    assert row.test is not None
    if mutation.mistake is not None:
        print(f"{played.name}: {mutation.mistake}")
        return Finding(played, None, 0)
    copy = copies.get()
    file = copy / mutation.file
    whole = file.read_text(encoding="utf-8")
    try:
        file.write_text(whole.replace(mutation.old, mutation.new), encoding="utf-8")
        test, took_s, why = _first_failing(row, row.test, copy)
    finally:
        file.write_text(whole, encoding="utf-8")
        # A file of one size and one second is taken for the same.
        for compiled in file.parent.glob(f"__pycache__/{file.stem}.*"):
            compiled.unlink()
        copies.put(copy)
    verdict = "found" if test else "SURVIVED"
    print(f"{played.name:12}  {verdict:8}  {mutation.file}  {took_s:.1f} s  {test or row.test}\n     {why}", flush=True)
    return Finding(played, test, took_s)


def _first_failing(row: Row, own: str, copy: Path) -> tuple[str | None, float, str]:
    """Which test fails, the row's ``own`` or another of its name, or None; how long these ran, s; and what was said."""
    others = [test for test in by_row().get(row.name, []) if test != own]
    took_s, why = 0.0, ""
    for tests in filter(None, ([own], others)):
        began = time.monotonic()
        status, why = _run(tests, copy)
        took_s = time.monotonic() - began
        if status in (_FAILED, None):
            return _who_failed(why) or tests[0], took_s, why
    return None, took_s, why


def _who_failed(why: str) -> str | None:
    found = re.match(r"(tests/\S+?::\w+)", why)
    return found.group(1) if found else None


def _run(tests: list[str], copy: Path) -> tuple[int | None, str]:
    """Pytest's status, None after a time-out; and the first error that it tells, to judge by whether it is the one."""
    limited = ["sh", "-c", f'ulimit -St {LIMIT_S * len(tests)}; exec "$@"', "sh"]
    words = [*limited, sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    # To compile all anew takes twice as long as most tests.
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    try:
        run = subprocess.run(
            words,
            cwd=copy,
            env={**kept, "PYTHONPATH": str(copy), "COLUMNS": "200"},
            capture_output=True,
            check=False,
            timeout=CLOCK_LIMIT_S * len(tests),
            text=True,
        )
    except subprocess.TimeoutExpired:
        return None, f"not over after {CLOCK_LIMIT_S} s each"
    if run.returncode == -signal.SIGXCPU:
        return None, f"not over after {LIMIT_S} s of processor time each"
    begins = "E " if len(tests) == 1 else "FAILED "
    told = [line.removeprefix(begins).strip() for line in run.stdout.splitlines() if line.startswith(begins)]
    return run.returncode, next(iter(told), run.stdout.strip().rpartition("\n")[2])[:160]


if __name__ == "__main__":
    sys.exit(main())
