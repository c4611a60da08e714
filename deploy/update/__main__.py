"""``onboard-update``: take an update, on a board that was flashed with our image."""

import argparse
import fcntl
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from deploy.update.board import BoardFiles, this_board
from deploy.update.health import wait_for_health
from deploy.update.install import install
from deploy.update.judge import judge
from deploy.update.manifest import UpdateError
from deploy.update.slots import UpdatePhase
from onboard.config.arguments import Parser

#: From the start of the controller's service until a system on trial has shown that it works.
HEALTH_LIMIT_S = 180.0
#: A controller on trial that was started again more often than this does not work.
RESTARTS_LIMIT = 3
SUFFIX = ".update"
_LOCK = Path("/run/onboard-update.lock")
HELP = """\
exit status:
  0  done
  1  --judge: the system on trial is not healthy; its service then starts the board anew
  2  the update is not taken, or something is missing; one line says why, and nothing was changed

A new system is tried at the next start of the board. It stays where its controller's heartbeats are on the bus;
otherwise the board goes back to the old one by itself.
"""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard-update``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard-update",
        description="Update this board's system (deploy/README.md).",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("file", nargs="?", type=Path, metavar="FILE", help="update file to take")
    what.add_argument("--stick", type=Path, metavar="DIR", help=f"take the last of the *{SUFFIX} files in a folder")
    what.add_argument("--status", action="store_true", help="which slot runs, and what will be started next")
    what.add_argument("--judge", action="store_true", help="at every start: keep or give up a system on trial")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    args = build_parser().parse_args(argv)
    try:
        return _carry_out(args, this_board())
    except UpdateError as error:
        about = f"{args.file or args.stick}: " if args.file or args.stick else ""
        print(f"onboard-update: {about}{error}", file=sys.stderr)
    except OSError as error:
        print(f"onboard-update: {error.filename or 'the medium'}: {error.strerror}", file=sys.stderr)
    return 2


def _carry_out(args: argparse.Namespace, place: BoardFiles) -> int:
    if args.status:
        print(status(place))
        return 0
    with _LOCK.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if args.judge:
            return _judge(place)
        file = args.file or last_update(args.stick)
        manifest = install(file, place, _tell)
    _tell(f"version {manifest.version} is written, and tried at the next start of this board")
    return 0


def _tell(line: str) -> None:
    print(f"onboard-update: {line}", flush=True)


def last_update(folder: Path) -> Path:
    """The update file in a folder whose name comes last. Raises ``UpdateError`` where there is none."""
    found = sorted(folder.glob(f"*{SUFFIX}"))
    if not found:
        raise UpdateError(f"there is no file that ends in {SUFFIX}")
    return found[-1]


def status(place: BoardFiles) -> str:
    """One line: what runs, and what will be started next."""
    state, version = place.state(), place.itself().version
    said = f"version {version} runs in slot {place.running}"
    if place.running == state.trial:
        return f"{said}, on trial"
    if state.phase is UpdatePhase.PENDING:
        return f"{said}; version {state.version} in slot {state.trial} is tried at the next start"
    return f"{said}; version {state.failed} was given up" if state.failed else said


def _judge(place: BoardFiles) -> int:
    machine = place.machine()
    verdict = judge(place, lambda: machine is not None and wait_for_health(machine, HEALTH_LIMIT_S, _has_failed))
    if verdict.line:
        _tell(verdict.line)
    return 0 if verdict.is_good else 1


def _has_failed() -> bool:
    """Whether the supervisor has given the controller up, or starts it again and again."""
    words = ["systemctl", "show", "--value", "--property", "ActiveState,NRestarts", "onboard.service"]
    said = subprocess.run(words, capture_output=True, text=True, check=False).stdout.split()
    return "failed" in said or any(word.isdecimal() and int(word) > RESTARTS_LIMIT for word in said)


if __name__ == "__main__":
    sys.exit(main())
