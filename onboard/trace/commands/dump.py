"""``onboard trace dump``: a log as candump prints a bus, or a readable line a message."""

import argparse
import sys
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from onboard.bounded_file import read_bounded
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.trace.commands.common import (
    Commands,
    TraceError,
    add_command,
    add_log,
    add_site,
    open_log,
    site_of,
    tell_faults,
)
from onboard.trace.commands.proof import LogProof, proof_of
from onboard.trace.dump.decode import DbcLines, MessageLines
from onboard.trace.dump.filters import FilterSet, parse_filters
from onboard.trace.dump.formats import Look, Screen, TimeFormat, log_line, time_of_name
from onboard.trace.raw import RawFrame
from onboard.trace.readers.open_log import Log, Portion

if TYPE_CHECKING:
    from onboard.wire.dbc_file import AnyDbc

HELP = """\
filters, as candump has them; hexadecimal, an identifier of 8 digits is a 29-bit one:
  ID:MASK        frames with IDENTIFIER & MASK == ID & MASK
  ID~MASK        frames with IDENTIFIER & MASK != ID & MASK
  #ERRORMASK     error frames of these classes (linux/can/error.h); without one only -e shows error frames
  j              join: all filters must match
  fleet,ID:MASK  on this bus only; several arguments for several buses

A log that does not mark which frames its own host sent is shown as canplayer would play it: as sent (TX).

examples:
  onboard trace dump run.log
  onboard trace dump run.log -tz fleet 0C000000:1C000000
  candump -L can0 | onboard trace dump - --decode --site mysite.toml
  onboard trace dump car.log --decode --dbc car.dbc
  onboard trace dump run.log --decode --site mysite.toml --keys MR1.keys     whose seals are right, line by line
"""


def register(commands: Commands) -> None:
    """Add ``dump`` to the commands of ``onboard trace``, with its options."""
    dump = add_command(commands, "dump", "print a log as candump prints a bus, or in words", HELP, run)
    add_log(dump)
    dump.add_argument("filters", nargs="*", metavar="[BUS,]FILTER", help="what to show; default: all data frames")
    dump.add_argument("-t", dest="stamp", choices="adzA", default="", help="time: absolute, delta, zero, Absolute date")
    dump.add_argument("-c", dest="colour", action="count", default=0, help="colour (twice: the whole line)")
    dump.add_argument("-i", dest="binary", action="store_true", help="data in binary")
    dump.add_argument("-a", dest="ascii", action="store_true", help="data as ASCII too")
    dump.add_argument("-S", dest="swap", action="store_true", help="data in reverse order, marked with `")
    dump.add_argument("-l", dest="file", action="store_true", help="write a log named candump-DATE_TIME.log instead")
    dump.add_argument("-L", dest="log_format", action="store_true", help="the format of log files")
    dump.add_argument("-n", dest="count", type=int, metavar="COUNT", help="stop after so many frames")
    dump.add_argument("-e", dest="errors", action="store_true", help="error frames too, in words")
    dump.add_argument("-x", dest="extra", action="store_true", help="direction, BRS and ESI")
    dump.add_argument("--decode", action="store_true", help="one readable line a message")
    add_site(dump)
    dump.add_argument("--dbc", type=Path, metavar="FILE", help="with --decode: any DBC instead of the fleet's contract")
    dump.add_argument(
        "--keys", type=Path, metavar="FILE", help="a key file of a site with seals: tell whose seals are right"
    )


def run(args: argparse.Namespace) -> int:
    """Print, and tell what could not be printed."""
    sets = parse_filters(args.filters, errors=args.errors)
    site = site_of(args)
    proof = proof_of(args, site)
    if args.keys is not None and (args.file or args.log_format or args.dbc is not None):
        raise TraceError(
            f"--keys {args.keys}: a log file, or another's DBC, has no place for it; leave out -l, -L, --dbc"
        )
    with open_log(args) as log:
        chosen = _Chosen(log, sets, args.count, None if args.file or args.log_format else proof)
        if args.decode:
            _decode(args, site, chosen)
        elif args.file:
            _write_file(chosen)
        else:
            screen = Screen(_look(args), tuple(one.channel for one in sets if one.channel != "any"))
            _print_all((chosen.marked(map(screen.text, part.frames)), there) for part, there in chosen.portions())
            tell_faults(log)
    if chosen.errors_hidden:
        print(f"{log.name}: error frames not shown: {chosen.errors_hidden}; -e shows them", file=sys.stderr)
    return 0


class _Chosen:
    """The frames that pass; error frames that nobody asked about are counted."""

    def __init__(self, log: Log, sets: list[FilterSet], count: int | None, proof: LogProof | None) -> None:
        """``proof``: where each line is to say whether its frame is sealed."""
        self.log = log
        self.errors_hidden = 0
        self._sets = sets
        self._left = count
        self._proof = proof

    def __iter__(self) -> Iterator[RawFrame]:
        return chain.from_iterable(part.frames for part, _ in self.portions())

    def marked(self, lines: Iterable[str]) -> Iterable[str]:
        """Lines of a portion's frames as they come, with what their frames' seals are worth."""
        if self._proof is None:
            return lines
        return (line if (mark := self._proof.mark) is None else f"{line}  [{mark.value}]" for line in lines)

    def portions(self) -> Iterator[tuple[Portion, bool]]:
        """Some at a time, and whether these are there already, as the log has them."""
        if self._proof is not None:
            yield Portion(None, self._passing(self._proof.marked(self.log.one_by_one()))), False
            return
        if self._left is not None:
            # Who asks for a number of frames gets an answer as soon as they are there.
            yield Portion(None, self._passing(self.log.one_by_one())), False
            return
        for portion in self.log.portions():
            are_there = portion.block is not None
            if self._sets != [FilterSet()]:
                yield Portion(None, self._passing(portion.frames)), are_there
            elif portion.block is None or portion.block.others:
                yield Portion(None, self._data_frames(portion.frames)), are_there
            else:
                yield portion, are_there

    def _data_frames(self, frames: Iterator[RawFrame]) -> Iterator[RawFrame]:
        """What passes where nobody asks for anything else."""
        for frame in frames:
            if frame.is_error:
                self.errors_hidden += 1
            else:
                yield frame

    def _passing(self, frames: Iterator[RawFrame]) -> Iterator[RawFrame]:
        for frame in frames:
            if not any(one.passes(frame) for one in self._sets):
                self.errors_hidden += frame.is_error and not any(one.error_mask for one in self._sets)
                continue
            yield frame
            if self._left is not None:
                self._left -= 1
                if self._left <= 0:
                    return


def _look(args: argparse.Namespace) -> Look:
    return Look(
        TimeFormat(args.stamp),
        args.log_format,
        args.colour,
        args.extra,
        args.ascii,
        args.swap,
        args.binary,
        args.errors,
    )


def _decode(args: argparse.Namespace, site: Site | None, chosen: _Chosen) -> None:
    screen = Screen(Look(TimeFormat(args.stamp or "a"), colour=args.colour, errors=True))
    lines: DbcLines | MessageLines
    if args.dbc is not None:
        lines = DbcLines(_read_dbc(args.dbc), screen)
    else:
        lines = MessageLines(site, codecs_for(site), screen)
    _print_all((chosen.marked(lines.of(portion)), are_there) for portion, are_there in chosen.portions())
    tell_faults(chosen.log)
    for line in lines.report():
        print(f"{chosen.log.name}: {line}", file=sys.stderr)


def _read_dbc(path: Path) -> "AnyDbc":
    from onboard.wire.dbc_file import AnyDbc, AnyDbcError  # noqa: PLC0415  # takes a third of the start

    try:
        dbc = AnyDbc(read_bounded(path).decode("utf-8-sig", "replace"))
    except OSError as error:
        raise TraceError(f"{path}: cannot be read ({error.strerror}); name an existing DBC") from error
    except AnyDbcError as error:
        raise TraceError(f"{path}: not a DBC ({error})") from error
    if dbc.warning:
        print(f"{path}: {dbc.warning}", file=sys.stderr)
    return dbc


def _write_file(chosen: _Chosen) -> None:
    file: TextIO | None = None
    try:
        for frame in chosen:
            if file is None:
                path = Path(time_of_name(frame.time_us))
                file = path.open("w", encoding="utf-8", newline="\n")
                print(f"{path}: written", file=sys.stderr)
            file.write(f"{log_line(frame)}\n")
    except OSError as error:
        raise TraceError(f"candump log in this directory: cannot be written ({error.strerror})") from error
    finally:
        if file is not None:
            file.close()
    tell_faults(chosen.log)


def _print_all(portions: Iterator[tuple[Iterable[str], bool]]) -> None:
    """To standard output; at once where a person or a pipe waits for each line of a live bus."""
    out = sys.stdout
    for lines, are_there in portions:
        if are_there:
            text = "\n".join(lines)
            out.write(f"{text}\n" if text else "")
        else:
            out.writelines(f"{line}\n" for line in lines)
    out.flush()
