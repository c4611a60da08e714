"""Decoding a log beside ``cantools decode``: seconds for the same log of a fleet bus, peak memory, and the ratio.

    python -m bench.trace [--megabytes 5] [--long 100]

The log is a run of the small site, repeated; each program prints one decoded line a frame or message into a file.
``--long`` reads one of that many megabytes with ours alone, for its memory. Absolute times drift; keep the ratio.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bus_sim.cli import main as bus_sim
from bus_sim.sites import find_site
from onboard.wire.site_dbc import site_dbc

SITE = Path(__file__).parents[1] / "bus_sim" / "sites" / "small.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--megabytes", type=float, default=5.0)
    parser.add_argument("--long", type=float, default=0.0)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run, dbc = folder / "run.log", folder / "site.dbc"
        bus_sim(["run", "small", "--random", "60", "20", "--cars", "8", "--speed", "max", "--trace", str(run)])
        dbc.write_text(site_dbc(find_site("small")))
        log = _repeated(run, args.megabytes, folder / "log")
        ours = [sys.executable, "-m", "onboard", "trace", "dump"]
        rows = [
            ("cantools decode, site's DBC", [sys.executable, "-m", "cantools", "decode", "--single-line", str(dbc)]),
            ("dump --decode --site", [*ours, "-", "--decode", "--site", str(SITE)]),
            ("dump --decode --dbc, site's DBC", [*ours, "-", "--decode", "--dbc", str(dbc)]),
            ("dump", [*ours, "-"]),
        ]
        print(
            f"\n{log.stat().st_size / 1e6:.1f} MB\n\n| what | s | times cantools' speed | peak MB |\n|---|---|---|---|"
        )
        reference_s = 0.0
        for what, command in rows:
            spent_s, peak_mb = _timed(command, log)
            reference_s = reference_s or spent_s
            print(f"| {what} | {spent_s:.1f} | {reference_s / spent_s:.1f} | {peak_mb:.0f} |")
        if args.long:
            log = _repeated(run, args.long, folder / "long")
            spent_s, peak_mb = _timed([*ours, "-"], log)
            print(f"| dump of {args.long:.0f} MB | {spent_s:.1f} | | {peak_mb:.0f} |")


def _repeated(run: Path, megabytes: float, out: Path) -> Path:
    text = run.read_bytes()
    with out.open("wb") as file:
        for _ in range(max(1, round(megabytes * 1e6 / len(text)))):
            file.write(text)
    return out


def _timed(command: list[str], log: Path) -> tuple[float, float]:
    """Seconds and peak resident megabytes of a command that reads a log from its standard input."""
    started_s = time.perf_counter()
    with (
        log.open("rb") as lines,
        subprocess.Popen(command, stdin=lines, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process,
    ):
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)}: exit status {process.returncode}")
    return time.perf_counter() - started_s, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
