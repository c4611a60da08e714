"""``onboard trace export``: a log as tables for other tools."""

import argparse
import sys
from pathlib import Path

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

HELP = """\
One table a message: time_us, channel, sender, with --site the sender's name as machine, then the message's signals.
With --site the machines of the site are a table too. docs/trace.md has queries to begin with.

examples:
  onboard trace export run.log --parquet tables --site bus_sim/sites/small.toml
  duckdb -c "select machine, count(*) from 'tables/Bid.parquet' group by all"
"""


def register(commands: Commands) -> None:
    """Add ``export`` to the commands of ``onboard trace``, with its options."""
    export = add_command(commands, "export", "write a log as tables, one a message", HELP, run)
    add_log(export)
    add_site(export)
    export.add_argument("--parquet", type=Path, metavar="DIR", required=True, help="new folder for the tables")


def run(args: argparse.Namespace) -> int:
    """Write the tables, and tell what is in none. Raises ``TraceError``."""
    try:
        from onboard.trace.columns.parquet import export  # noqa: PLC0415  # its libraries are an extra
        from onboard.trace.columns.reading import blocks_of  # noqa: PLC0415  # its libraries are an extra
        from onboard.trace.columns.signals import SignalDecoder  # noqa: PLC0415  # its libraries are an extra
    except ImportError as error:
        raise TraceError("export: its libraries are missing; pip install 'onboard-fleet[parquet]'") from error
    site, folder = site_of(args), args.parquet
    decoder = SignalDecoder(site.system if site is not None else "")
    with open_log(args) as log:
        try:
            rows = export(blocks_of(log), decoder, folder, site)
        except FileExistsError as error:
            raise TraceError(f"{folder}: holds tables already, or is no folder; name a new one") from error
        except OSError as error:
            raise TraceError(f"{folder}: cannot be written ({error.strerror}); name another folder") from error
    print(f"{folder}: {sum(rows.values())} rows in {len(rows)} tables")
    sys.stdout.flush()
    tell_faults(log)
    for reason, count in sorted(decoder.drops.items()):
        print(f"{log.name}: frames in no table ({reason.name.lower().replace('_', ' ')}): {count}", file=sys.stderr)
    return 0
