"""What three fixed runs take, counted: ``python -m tests.work_done``; ``--write`` owns up to what has changed.

Two counts, kept in work_done.toml by the version of Python, as each version's interpreter does the same in another way:
instructions in user mode, by ``perf stat``, where the processor has a counter for them (in many virtual machines it has
none) and the version of the counts is stored; and calls of the project's own functions, which every machine counts.
What else the machine does changes neither by more than a thousandth.
"""

import cProfile
import os
import pstats
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
STORED = Path(__file__).with_name("work_done.toml")
#: Options of `bus-sim run`: a car park, boxes in a terminal, and plates in a graph.
RUNS = ("small --random 40 15 --cars 2", "terminal --for 60", "graph --for 150")
#: What a run may take more than stored, and how much less before it is worth to be stored, in hundredths.
MOST_GROWTH = 3
VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
CALLS, INSTRUCTIONS = "calls", "instructions"


def words(options: str) -> list[str]:
    """The options of a run that shows nothing and keeps its log in the working directory."""
    return ["run", *options.split(), "--seed", "1", "--speed", "max", "--no-web", "--trace", "run.log"]


def _outcome(command: list[str]) -> str:
    """What a command prints in a folder of its own, with names hashed as ever."""
    environment = os.environ | {"PYTHONHASHSEED": "0", "PYTHONPATH": str(ROOT), "LC_ALL": "C"}
    with TemporaryDirectory() as folder:
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, check=False)
    return done.stdout + done.stderr


def calls(options: str) -> int:
    """Calls of functions of the project in one run."""
    return int(_outcome([sys.executable, "-m", "tests.work_done", "--count", options]).split()[-1])


def _count_here(options: str) -> int:
    from bus_sim.cli import main  # only where a run is counted

    profile = cProfile.Profile(builtins=False)
    profile.runcall(main, words(options))
    counted: dict[tuple[str, int, str], tuple[int, int]] = vars(pstats.Stats(profile))["stats"]
    return sum(
        entry[1] for (file, _, _), entry in counted.items() if file.startswith(str(ROOT)) and ".venv" not in file
    )


def instructions(options: str) -> int | str:
    """Instructions of one run in user mode, or why they cannot be counted here."""
    perf = shutil.which("perf")
    if perf is None:
        return "perf is not installed"
    run = [sys.executable, "-m", "bus_sim", *words(options)]
    told = _outcome([perf, "stat", "-e", "instructions:u", "-x", ",", *run])
    counted = next((line.split(",")[0] for line in told.splitlines() if "instructions:u" in line), "")
    return int(counted) if counted.isdigit() else "this processor, or its virtual machine, has no counter for them"


def stored(what: str) -> dict[str, int]:
    """The counts of this version of Python; empty where there are none."""
    found: dict[str, dict[str, dict[str, int]]] = tomllib.loads(STORED.read_text(encoding="utf-8"))
    return found.get(what, {}).get(VERSION, {})


def growth(now: int, before: int) -> float:
    """How much more a run takes, in hundredths."""
    return 100 * (now - before) / before


def _write(what: str, counts: dict[str, int]) -> None:
    known = tomllib.loads(STORED.read_text(encoding="utf-8"))
    known.setdefault(what, {})[VERSION] = counts
    text = "# Written by `python -m tests.work_done --write`: what the runs of that file take, by version of Python.\n"
    for kind, versions in sorted(known.items()):
        for version, runs in sorted(versions.items()):
            lines = "".join(f'"{run}" = {count}\n' for run, count in runs.items())
            text += f'\n[{kind}."{version}"]\n{lines}'
    STORED.write_text(text, encoding="utf-8")


def main(arguments: list[str]) -> int:
    """Print what the runs take and took, and store it where that is asked for."""
    if arguments[:1] == ["--count"]:
        print(_count_here(arguments[1]))
        return 0
    found: dict[str, dict[str, int]] = {CALLS: {}, INSTRUCTIONS: {}}
    status = 0
    for options in RUNS:
        for what, now in ((CALLS, calls(options)), (INSTRUCTIONS, instructions(options))):
            before = stored(what).get(options)
            if isinstance(now, str):
                print(f"{options}: {what} not counted: {now}")
                continue
            found[what][options] = now
            change = "none stored" if before is None else f"{growth(now, before):+.1f} % of {before:,}"
            print(f"{options}: {now:,} {what}, {change}")
            status |= before is not None and growth(now, before) > MOST_GROWTH
    if "--write" not in arguments:
        return int(status)
    for what, counts in found.items():
        if counts:
            _write(what, counts)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
