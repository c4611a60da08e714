"""``onboard trace sequence`` and ``onboard trace diagram``: pictures of a log."""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from onboard.config.arguments import seconds
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.systems.registry import part
from onboard.trace.chart.over_time import Diagram
from onboard.trace.chart.sequence import as_svg, as_text, chart
from onboard.trace.chart.svg import SvgDrawing
from onboard.trace.commands.common import (
    Commands,
    TraceError,
    add_command,
    add_log,
    add_site,
    open_log,
    site_of,
    tell_faults,
    write_text,
)
from onboard.trace.commands.story import task_of
from onboard.trace.listener import Listener, LoggedMessage
from onboard.trace.readers.open_log import Log
from onboard.trace.words import Words

SEQUENCE_HELP = """\
The third column numbers the 21 steps of a car's entry (Pujo et al. 2006, Fig. 9) where a message shows one; steps of
doors, desk and shuttle need the device buses in the log (bus-sim run --devices).

examples:
  onboard trace sequence run.log IOC1/1 --site bus_sim/sites/small.toml
  onboard trace sequence run.log IOC1/1 --site bus_sim/sites/small.toml --out entry.svg
"""
DIAGRAM_HELP = """\
PNG is made by rsvg-convert (package librsvg2-bin); SVG needs nothing.

examples:
  onboard trace diagram run.log --site bus_sim/sites/small.toml --out run.svg
  onboard trace diagram run.log --site bus_sim/sites/small.toml --from 20 --until 100 --out part.png
"""
_CONVERTER = "rsvg-convert"


def register_sequence(commands: Commands) -> None:
    """Add ``sequence`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "sequence", "sequence chart of a customer's task", SEQUENCE_HELP, run_sequence)
    add_log(parser)
    parser.add_argument("task", metavar="TASK", help="such as IOC1/2, as `onboard trace calls` names it")
    add_site(parser, required=True)
    parser.add_argument("--out", type=Path, metavar="FILE", help="write .svg or .png; default: text")


def register_diagram(commands: Commands) -> None:
    """Add ``diagram`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "diagram", "what moves or lasts over time, SVG or PNG", DIAGRAM_HELP, run_diagram)
    add_log(parser)
    add_site(parser, required=True)
    parser.add_argument("--from", dest="from_s", type=seconds, metavar="S", help="seconds since the log's first frame")
    parser.add_argument("--until", dest="until_s", type=seconds, metavar="S", help="likewise")
    parser.add_argument("--out", type=Path, metavar="FILE", required=True, help="file to write: .svg or .png")


class _Heard:
    """Messages of a log, and when it began."""

    def __init__(self, log: Log, site: Site) -> None:
        self.listener = Listener(codecs_for(site))
        self.start_us = 0
        self._frames = iter(log)

    def first(self) -> Iterator[LoggedMessage]:
        """All messages; ``start_us`` is known once the first is asked for."""
        found = self.listener.messages(self._frames)
        one = next(found, None)
        if one is not None:
            self.start_us = one.time_us
            yield one
        yield from found


def run_sequence(args: argparse.Namespace) -> int:
    """Print or draw the chart."""
    site = site_of(args)
    assert site is not None, "argparse asks for it"
    task = task_of(args.task, site)
    assert task is not None, "argparse asks for it"
    words = Words(site)
    with open_log(args) as log:
        heard = _Heard(log, site)
        found = chart(site, heard.first(), task)
    if found is None:
        raise TraceError(f"{args.log}: no call for task {args.task} in it; `onboard trace calls` lists them")
    if args.out is None:
        print("\n".join(as_text(found, words, heard.start_us)))
    else:
        _write(args.out, as_svg(found, words, heard.start_us))
    sys.stdout.flush()
    tell_faults(log, heard.listener)
    return 0


def run_diagram(args: argparse.Namespace) -> int:
    """Draw what the site's system has rows for. Raises ``TraceError`` for a system without any."""
    site = site_of(args)
    assert site is not None, "argparse asks for it"
    module = part(site.system, "diagram")
    if module is None:
        raise TraceError(f"diagram: {site.name}: the system {site.system} has no diagram over time (docs/new-kind.md)")
    with open_log(args) as log:
        heard = _Heard(log, site)
        messages = heard.first()
        first = next(messages, None)
        if first is None:
            raise TraceError(f"{args.log}: no message of this contract in it; is it the log of a fleet bus?")
        start_us = first.time_us
        from_us = None if args.from_s is None else start_us + round(args.from_s * 1e6)
        until_us = None if args.until_s is None else start_us + round(args.until_s * 1e6)
        diagram: Diagram = module.DIAGRAM(site, from_us, until_us)
        for said in messages:
            if said.is_fleet:
                diagram.feed(said)
    if diagram.last_us <= diagram.first_us:
        raise TraceError(f"--from {args.from_s} --until {args.until_s}: nothing of {args.log} lies between")
    _write(args.out, diagram.draw(start_us))
    tell_faults(log, heard.listener)
    return 0


def _write(out: Path, drawing: SvgDrawing) -> None:
    if out.suffix == ".svg":
        write_text(out, str(drawing))
        return
    if out.suffix != ".png":
        raise TraceError(f"{out}: name a file that ends in .svg or .png")
    converter = shutil.which(_CONVERTER)
    if converter is None:
        raise TraceError(f"{out}: PNG needs {_CONVERTER} (apt-get install librsvg2-bin); an .svg needs nothing")
    done = subprocess.run([converter, "-o", str(out)], input=str(drawing).encode(), capture_output=True, check=False)
    if done.returncode:
        raise TraceError(f"{out}: cannot be written ({done.stderr.decode(errors='replace').strip()})")
