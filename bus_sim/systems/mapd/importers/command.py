"""``bus-sim import``: files of others to a site file, all or nothing, and a list of what could not be carried over."""

import argparse
import re
import sys
from pathlib import Path

from bus_sim.systems.mapd.importers.draft import Draft, site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand, import_map
from bus_sim.systems.mapd.importers.opentcs import import_opentcs
from onboard.bounded_file import MOST_EXPORT
from onboard.config.files import read_text
from onboard.config.problems import ConfigError, Problems
from onboard.config.site import parse_site
from onboard.holon.witness import FIRST_SLOT_US

#: A frame of the start with what arbitration and stuffing make of it, as measured: 294 us at 500 kbit/s.
START_FRAME_BITS = 147
#: What each machine says at a start before others ask it alone, as measured with 121 of them.
START_FRAMES = 9

_KINDS = "a map (.map, with a .task file or without), an openTCS model (.xml) or an Open-RMF building (.yaml)"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which files, where the site goes, and what is drawn where they say nothing."""
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help=_KINDS)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="SITE", help="the site file to write")
    parser.add_argument(
        "--robots", type=_positive, metavar="N", help="so many robots (default: all that the file names)"
    )
    parser.add_argument("--tasks", type=_positive, default=20, metavar="N", help="tasks to draw where it has none")
    parser.add_argument("--every", type=_positive, default=5, metavar="STEPS", help="steps between two tasks drawn")
    parser.add_argument("--seed", type=int, default=1, help="seed of everything that is drawn (default: 1)")


def most_machines(bitrate: int) -> int:
    """So many can start together: all ask all, and answer, before any is asked alone (``onboard.holon.witness``).

    Of more of them each would ask those whose answers still wait, and all would wait longer (docs/figures.md).
    """
    return bitrate * FIRST_SLOT_US // 1_000_000 // (START_FRAMES * START_FRAME_BITS)


def _positive(text: str) -> int:
    number = int(text) if re.fullmatch(r"\d{1,5}", text) else 0
    if not 1 <= number <= 10_000:
        raise argparse.ArgumentTypeError(f"{text}: write a whole number from 1 to 10000")
    return number


def run(args: argparse.Namespace) -> int:
    """Import, check by reading the result as any site file is read, then write. Raises ``ConfigError``."""
    draft = import_files(args.files, DrawnDemand(args.robots, args.tasks, args.every, args.seed))
    text = site_text(draft)
    site = parse_site(text, str(args.output))
    problems = Problems(str(args.files[0]))
    most = most_machines(site.bitrate)
    if len(site.machines) > most:
        what = f"{len(site.machines)} machines with the desk, whose start fills a bus of {site.bitrate} bit/s"
        problems.add(0, "robots", len(site.machines) - 1, what, f"import at most {most - 1} of them (--robots)")
        problems.raise_if_any()
    problems = Problems(str(args.output))
    half = args.output.with_name(f".{args.output.name}.new")
    try:
        half.write_text(text, encoding="utf-8")
        half.replace(args.output)
    except OSError as error:
        half.unlink(missing_ok=True)
        problems.add(0, "", None, f"cannot be written: {error.strerror}", "name a file in a folder that you may write")
        raise ConfigError(problems.found) from error
    for element, why in draft.losses:
        sys.stdout.write(f"not carried over: {element}: {why}\n")
    robots = sum(1 for _ in draft.robots)
    sys.stdout.write(f"{args.output}: {site.name}, {robots} robots, {len(draft.tasks)} tasks\n")
    return 0


def import_files(files: list[Path], wanted: DrawnDemand) -> Draft:
    """The draft of one file, or of a map and its tasks. Raises ``ConfigError``."""
    first, *others = sorted(files, key=lambda path: path.suffix == ".task")
    problems = Problems(str(first))
    if first.suffix not in _IMPORTERS:
        problems.add(0, "", first.suffix or first.name, "unknown kind of file", f"give {_KINDS}")
    for other in others:
        if first.suffix != ".map" or other.suffix != ".task" or len(others) > 1:
            Problems.add(problems, 0, "", other.name, "does not go with it", "give one file, or a .map and its .task")
    problems.raise_if_any()
    text = read_text(first, "import", MOST_EXPORT)
    if first.suffix == ".map":
        tasks = (others[0], read_text(others[0], "task", MOST_EXPORT)) if others else None
        return import_map(first, text, tasks, wanted)
    return _IMPORTERS[first.suffix](first, text, wanted)


def _building(path: Path, text: str, wanted: DrawnDemand) -> Draft:
    # Not before it is needed: PyYAML is in an extra, and boards do not carry it.
    from bus_sim.systems.mapd.importers.rmf import import_building  # noqa: PLC0415  # see above

    return import_building(path, text, wanted)


def _map(path: Path, text: str, wanted: DrawnDemand) -> Draft:
    return import_map(path, text, None, wanted)


_IMPORTERS = {".map": _map, ".xml": import_opentcs, ".yaml": _building, ".yml": _building}
