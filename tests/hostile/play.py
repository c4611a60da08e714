"""Runs commands one after another, each in a process of its own with bounds; says what came of each, as JSON.

``python -m tests.hostile.play``: standard input is a list of plays as JSON, standard output a list of outcomes.
All programs are loaded once; a play is a fork, which counts the memory of all that it has, as a command by itself does.
"""

import contextlib
import json
import os
import resource
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypedDict

from bus_sim import cli as bus_sim
from deploy import cli as deploy
from hil import cli as hil
from onboard import bounded_file
from onboard import cli as onboard
from onboard.trace import cli as trace

#: Processor seconds and wall seconds after which a play is ended, and address space that it may take, bytes.
MOST_CPU_S, MOST_WALL_S, MOST_SPACE = 6, 60, 2 << 30
_MOST_SAID = 100_000
PROGRAMS: dict[str, Callable[[Sequence[str]], int]] = {
    "bus-sim": bus_sim.main,
    "deploy": deploy.main,
    "hil": hil.main,
    "onboard": onboard.main,
}


class Play(TypedDict):
    """A command with its arguments; ``endless`` are pipes into which somebody could write and does not."""

    words: list[str]
    endless: list[str]


class Outcome(NamedTuple):
    """Exit status (below 0: ended by that signal), processor seconds, most memory in bytes, standard error."""

    status: int
    cpu_s: float
    memory: int
    said: str


def play(one: Play) -> Outcome:
    """One command, in a process of its own."""
    held = [os.open(path, os.O_RDWR) for path in one["endless"]]
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if not child:
            _run(one["words"], said.fileno())
        _, status, used = os.wait4(child, 0)
        said.seek(0)
        text = said.read(_MOST_SAID).decode("utf-8", "replace")
    for file in held:
        os.close(file)
    return Outcome(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, text)


def _run(words: list[str], said: int) -> None:
    """Never returns: the process ends with the command's status."""
    os.dup2(said, 2)
    os.dup2(os.open(os.devnull, os.O_RDWR), 1)
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S))
    resource.setrlimit(resource.RLIMIT_AS, (MOST_SPACE, MOST_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.alarm(MOST_WALL_S)
    status = 70
    with contextlib.suppress(BaseException):
        try:
            status = PROGRAMS[words[0]](words[1:])
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else 1
        except BaseException:  # whatever a command ends by is an outcome to tell
            sys.excepthook(*sys.exc_info())
            raise
        finally:
            sys.stderr.flush()
    os._exit(status)


def main() -> None:
    """Play them all."""
    assert trace is not None
    # Each play would load its command anew.
    bus_sim.build_parser()
    bus_sim.mistakes()
    # A person waits longer for what comes slowly; here nothing ever comes.
    bounded_file.PATIENCE_S = 0.1
    json.dump([play(one) for one in json.load(sys.stdin)], sys.stdout)


if __name__ == "__main__":
    main()
