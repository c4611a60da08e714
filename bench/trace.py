"""Decoding a log beside ``cantools decode``: seconds for the same log of a fleet bus, peak memory, and the ratio.

    python -m bench.trace [--megabytes 5] [--long 100] [--log LOG --site SITE] [--before DIR]

The log is a run of the small site, repeated, or LOG of SITE; each program prints one decoded line a frame or message,
and `export` writes columns. ``--before`` names another checkout of this project, measured in the same run; SITE is
one that both can read. ``--long`` reads one of that many megabytes with ours alone, for its memory. Times are of the
processor; absolute times drift, keep the ratio. A log that was repeated is kind to what remembers frames: give a LOG
for figures.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from bus_sim.cli import main as bus_sim
from onboard.config.site import load_site
from onboard.wire.site_dbc import site_dbc

#: Reads a log to columns of every signal of every message, and does nothing with them.
_COLUMNS = """
import sys
from onboard.trace.columns.reading import blocks_of
from onboard.trace.columns.signals import SignalDecoder
from onboard.trace.readers.open_log import Log
decoder = SignalDecoder("car_park")
with Log(sys.argv[1]) as log:
    print(sum(len(one.rows) for block in blocks_of(log) for one in decoder.decode(block)))
"""
SITE = Path(__file__).parents[1] / "bus_sim" / "sites" / "small.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--megabytes", type=float, default=5.0)
    parser.add_argument("--long", type=float, default=0.0)
    parser.add_argument("--log", type=Path)
    parser.add_argument("--site", type=Path, default=SITE)
    parser.add_argument("--before", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run, dbc = folder / "run.log", folder / "site.dbc"
        if args.log is None:
            bus_sim(["run", "small", "--random", "60", "20", "--cars", "8", "--speed", "max", "--trace", str(run)])
        log = args.log or _repeated(run, args.megabytes, folder / "log")
        dbc.write_text(site_dbc(load_site(args.site)))
        ours = [sys.executable, "-m", "onboard", "trace"]
        site = ["--site", str(args.site.resolve())]
        commands = {
            "dump --decode --site": [*ours, "dump", "-", "--decode", *site],
            "check --site": [*ours, "check", "-", *site],
            "dump --decode --dbc, site's DBC": [*ours, "dump", "-", "--decode", "--dbc", str(dbc)],
            "dump": [*ours, "dump", "-"],
        }
        with log.open("rb") as lines:
            frames = sum(1 for _ in lines)
        print(f"\n{frames:,} frames, {log.stat().st_size / 1e6:.1f} MB\n")
        print("| what | s | times cantools' speed | peak MB |\n|---|---|---|---|")
        reference = [sys.executable, "-m", "cantools", "decode", "--single-line", str(dbc)]
        reference_s = _row("cantools decode, site's DBC", reference, log)
        _row("columns of all signals", [sys.executable, "-c", _COLUMNS, str(log)], log, reference_s)
        _row("export --parquet", [*ours, "export", "-", "--parquet", str(folder / "tables"), *site], log, reference_s)
        for what, command in commands.items():
            _row(what, command, log, reference_s)
            if args.before is not None:
                _row(f"{what}, before", command, log, reference_s, args.before)
        if args.long:
            log = _repeated(run, args.long, folder / "long")
            spent_s, peak_mb = _timed(commands["dump"], log)
            print(f"| dump of {args.long:.0f} MB | {spent_s:.1f} | | {peak_mb:.0f} |")


def _row(what: str, command: list[str], log: Path, reference_s: float = 0.0, where: Path | None = None) -> float:
    spent_s, peak_mb = _timed(command, log, where)
    times = (reference_s or spent_s) / spent_s
    print(f"| {what} | {spent_s:.1f} | {times:.1f} | {peak_mb:.0f} |", flush=True)
    return spent_s


def _repeated(run: Path, megabytes: float, out: Path) -> Path:
    text = run.read_bytes()
    with out.open("wb") as file:
        for _ in range(max(1, round(megabytes * 1e6 / len(text)))):
            file.write(text)
    return out


def _timed(command: list[str], log: Path, where: Path | None = None) -> tuple[float, float]:
    """Seconds of the processor and peak resident megabytes of a command that reads a log from its standard input."""
    with (
        log.open("rb") as lines,
        subprocess.Popen(
            command, stdin=lines, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=where
        ) as process,
    ):
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    # A check that finds something has done its work too.
    if process.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(command)}: exit status {process.returncode}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
