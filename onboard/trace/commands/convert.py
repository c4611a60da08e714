"""``onboard trace convert``: a log in another format."""

import argparse
from pathlib import Path

from onboard.trace.commands.common import Commands, TraceError, add_command, add_log, open_log, tell_faults
from onboard.trace.dump.formats import log_line
from onboard.trace.readers.asc_writer import AscWriter
from onboard.trace.readers.open_log import Log
from onboard.trace.readers.pcapng_writer import PcapngWriter

HELP = """\
examples:
  onboard trace convert run.log run.pcapng     one named interface for each bus; for Wireshark
  onboard trace convert trace.blf trace.log    as candump -L writes it
  onboard trace convert run.log run.asc        for CANalyzer and other tools of the desk
"""


def register(commands: Commands) -> None:
    """Add ``convert`` to the commands of ``onboard trace``, with its options."""
    convert = add_command(commands, "convert", "write a log as candump -L, ASC or pcapng", HELP, run)
    add_log(convert)
    convert.add_argument(
        "out", type=Path, metavar="OUT", help="file to write: .pcapng, .asc, else as candump -L writes it"
    )


def run(args: argparse.Namespace) -> int:
    """Write every frame, and tell what gave none."""
    out: Path = args.out
    with open_log(args) as log:
        try:
            if out.suffix == ".pcapng":
                _write_pcapng(log, out)
            elif out.suffix == ".asc":
                _write_asc(log, out)
            else:
                _write_candump(log, out)
        except OSError as error:
            raise TraceError(f"{out}: cannot be written ({error.strerror}); name another file") from error
    tell_faults(log)
    print(f"{out}: {log.faults.frames} frames")
    return 0


def _write_pcapng(log: Log, out: Path) -> None:
    with out.open("wb") as file:
        writer = PcapngWriter(file)
        for frame in log:
            writer.write(frame)


def _write_asc(log: Log, out: Path) -> None:
    with out.open("w", encoding="utf-8", newline="\n") as file:
        writer = AscWriter(file)
        for frame in log:
            writer.write(frame)
        writer.close()


def _write_candump(log: Log, out: Path) -> None:
    with out.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"{log_line(frame)}\n" for frame in log)
