"""Options of all commands that take who comes from a table of somebody else."""

import argparse
from pathlib import Path

#: Their names in the parsed command line; ``skip_bad`` is a switch, the others None unless given.
TABLE_OPTIONS = ("columns", "delimiter", "zone", "date_format", "encoding", "mapping", "skip_bad")


def add_table_options(group: argparse._ArgumentGroup | argparse.ArgumentParser) -> None:
    """Add the file of counts, how a table is written, and who is inside at the start."""
    group.add_argument(
        "--counts",
        type=Path,
        metavar="FILE",
        help="counts by the hour instead of sessions: a CSV file with the columns hour, arrivals, departures",
    )
    group.add_argument(
        "--columns",
        metavar="COLUMN=NAME,...",
        help="what the table calls its columns, such as arrival=Entry,departure=Exit; two that belong together are "
        "joined by a plus: arrival=Date+Hour",
    )
    group.add_argument(
        "--delimiter", metavar="CHAR", help="between cells: comma (default), semicolon, tab, bar, or any character"
    )
    group.add_argument("--zone", metavar="NAME", help="zone of times without an offset, such as Europe/Paris")
    group.add_argument(
        "--date-format",
        action="append",
        metavar="FORMAT",
        help="how times are written: that of strptime, such as '%%d.%%m.%%Y %%H:%%M', or epoch, or epoch_ms; several "
        "are tried in turn (default: ISO 8601)",
    )
    group.add_argument("--encoding", metavar="NAME", help="of the table (default: by its mark, else UTF-8)")
    group.add_argument("--mapping", type=Path, metavar="FILE", help="TOML file with the same words: docs/demand.md")
    group.add_argument("--skip-bad", action="store_true", help="tell and pass over bad rows (default: refuse them)")
    group.add_argument(
        "--inside",
        metavar="N",
        help="so many more cars are inside at the start; or recorded: who came before --day and was still there",
    )
