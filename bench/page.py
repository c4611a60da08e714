"""The page's figures: updates a second and share of a processor at real time, memory after an hour, loading a log.

    python -m bench.page [--only live|memory|log] [--seconds 30] [--minutes 60] [--hours 24]

The large site runs at the clock's pace with a car every 20 s; its page has no viewer, then one that takes all it is
sent, as a browser does. The hour is a virtual one, hurried: a snapshot as JSON each simulated second, ten times fewer
than a viewer gets, in a process of its own beside one without a page. The log is a run of the large site, repeated to
so many hours. Processor time is counted, not the clock's, so other work on the machine does little harm.
"""

import argparse
import asyncio
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from websockets.sync.client import connect

from bus_sim.options import RunOptions
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.page import CarParkSource
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.systems.contract import codecs_for
from onboard.trace.readers.open_log import Log
from onboard.web.film import Film

SITE = "large"
ROOT = Path(__file__).parents[1]
#: Cars come and go at these intervals, s: mean and standard deviation.
EVERY_S = (20.0, 5.0)
#: Before counting the site fills, simulated s.
FILL_S = 60


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--minutes", type=int, default=60)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--only", choices=["live", "memory", "log"])
    parser.add_argument("--child", choices=["with", "without", "load"], help=argparse.SUPPRESS)
    parser.add_argument("--log", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child == "load":
        print(json.dumps(_load(args.log)))
    elif args.child is not None:
        print(json.dumps(_hurry(args.minutes, is_shown=args.child == "with")))
    else:
        with tempfile.TemporaryDirectory() as name:
            parts: dict[str, Callable[[], None]] = {
                "live": lambda: _live(args.seconds, Path(name)),
                "memory": lambda: _memory(args.minutes),
                "log": lambda: _loading(args.hours, Path(name)),
            }
            for part, measure in parts.items():
                if args.only in (None, part):
                    measure()


# --- at real time ----------------------------------------------------------------------------------------------------


def _live(seconds: float, folder: Path) -> None:
    print("\n| large site at real time | updates a second | kB a second | share of a processor |\n|---|---|---|---|")
    for viewers in (0, 1):
        updates, kilobytes, share = _watch(viewers, seconds, folder)
        print(f"| {viewers} viewers | {updates:.1f} | {kilobytes:.0f} | {share:.1%} |")


def _watch(viewers: int, seconds: float, folder: Path) -> tuple[float, float, float]:
    mean, sigma = EVERY_S
    words = ["run", SITE, "--random", str(mean), str(sigma), "--cars", "1000", "--speed", "1", "--web", "0"]
    command = [sys.executable, "-u", "-m", "bus_sim.cli", *words, "--trace", str(folder / "live.log")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=_environment()) as process:
        assert process.stdout is not None
        line = next(line for line in process.stdout if "picture at" in line)
        found = re.search(r"http://(\S+)/(\S+)", line)
        assert found is not None
        try:
            _go_on(process, FILL_S)
            begin_s, spent_s = time.monotonic(), _processor_s(process.pid)
            updates = octets = 0
            if viewers:
                with connect(f"ws://{found[1]}/live{found[2]}") as socket:
                    while time.monotonic() - begin_s < seconds:
                        octets += len(socket.recv())
                        updates += 1
            else:
                _go_on(process, seconds)
            passed_s = time.monotonic() - begin_s
            return updates / passed_s, octets / passed_s / 1e3, (_processor_s(process.pid) - spent_s) / passed_s
        finally:
            process.terminate()
            process.stdout.close()


def _go_on(process: subprocess.Popen[str], seconds: float) -> None:
    """Let a program run for so long."""
    try:
        process.wait(timeout=seconds)
    except subprocess.TimeoutExpired:
        return
    raise SystemExit(f"the run ended by itself: exit status {process.returncode}")


def _processor_s(pid: int) -> float:
    """Processor time of a process so far (proc(5), fields 14 and 15 of stat)."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


# --- memory ----------------------------------------------------------------------------------------------------------


def _memory(minutes: int) -> None:
    print(f"\n| {minutes} virtual minutes of the large site, hurried | peak MB | processor s |\n|---|---|---|")
    for child in ("without", "with"):
        for length in (minutes // 4, minutes):
            found = _child("--child", child, "--minutes", str(length))
            print(f"| {child} a page, {length} min | {found['peak_mb']:.1f} | {found['spent_s']:.1f} |")
            if "snapshot_ms" in found:
                print(f"| a snapshot as JSON | {found['snapshot_kb']:.1f} kB | {found['snapshot_ms']:.2f} ms |")


def _hurry(minutes: int, *, is_shown: bool) -> dict[str, float]:
    loop = VirtualTimeLoop()
    asyncio.set_event_loop(loop)
    simulation = build(find_site(SITE), RunOptions(seed=1), loop)
    demand = Demand.by_mean(*EVERY_S, 1, count=minutes * 60 // round(EVERY_S[0]))
    simulation.plant.street.add_all(demand, 1_000_000)
    source = CarParkSource(simulation, datetime(2000, 1, 1, tzinfo=UTC)) if is_shown else None
    found = loop.run_until_complete(_play(simulation, source, minutes))
    return {
        **found,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "spent_s": time.process_time(),
    }


async def _play(simulation: Simulation, source: CarParkSource | None, minutes: int) -> dict[str, float]:
    simulation.start()
    spent_s, octets = 0.0, 0
    for _ in range(minutes * 60):
        await asyncio.sleep(1)
        if source is not None:
            begin_s = time.process_time()
            octets += len(json.dumps(source.snapshot()))
            spent_s += time.process_time() - begin_s
    count = minutes * 60
    return {"snapshot_ms": spent_s / count * 1e3, "snapshot_kb": octets / count / 1e3} if source is not None else {}


# --- a log -----------------------------------------------------------------------------------------------------------


def _loading(hours: float, folder: Path) -> None:
    run, log = folder / "run.log", folder / "day.log"
    words = ["run", SITE, "--random", "60", "20", "--cars", "30", "--for", "1800", "--trace", str(run)]
    subprocess.run(
        [sys.executable, "-m", "bus_sim.cli", *words], env=_environment(), stdout=subprocess.DEVNULL, check=False
    )
    frames = _repeated(run, hours, log)
    found = _child("--child", "load", "--log", str(log))
    print(
        f"\n| a log of {hours:g} h, {log.stat().st_size / 1e6:.0f} MB, {frames} frames | s | peak MB |\n|---|---|---|"
    )
    print(f"| loading | {found['load_s']:.1f} | {found['peak_mb']:.0f} |")
    print(
        f"| a moment chosen with the slider, mean and worst of 40 | {found['seek_s']:.2f}, {found['worst_s']:.2f} | |"
    )


def _repeated(run: Path, hours: float, out: Path) -> int:
    """The run again and again, each after the one before, by the stamps of its lines."""
    lines = run.read_bytes().splitlines()
    stamps = [line[1 : line.index(b")")].split(b".") for line in lines]
    first_us = int(stamps[0][0]) * 1_000_000 + int(stamps[0][1])
    times_us = [int(seconds) * 1_000_000 + int(fraction) - first_us for seconds, fraction in stamps]
    frames, begin_us = 0, 0
    with out.open("wb") as file:
        while begin_us < hours * 3.6e9:
            for at_us, line in zip(times_us, lines, strict=True):
                seconds, fraction = divmod(begin_us + at_us, 1_000_000)
                file.write(b"(%d.%06d)%s\n" % (seconds, fraction, line[line.index(b")") + 1 :]))
            frames += len(lines)
            begin_us += times_us[-1] + 1_000
    return frames


def _load(path: Path) -> dict[str, float]:
    site = find_site(SITE)
    with Film(site, codecs_for(site)) as film, Log(str(path)) as log:
        load_s = _timed(lambda: film.read(log))
        span_us = film.last_us - film.first_us
        moments = [film.first_us + span_us * (number * 17 % 40) // 40 for number in range(40)]
        seeks_s = [_timed(lambda moment=moment: film.show(moment)) for moment in moments]  # type: ignore[misc]  # a lambda's default
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"load_s": load_s, "peak_mb": peak_mb, "seek_s": sum(seeks_s) / len(seeks_s), "worst_s": max(seeks_s)}


def _timed(what: Callable[[], object]) -> float:
    begin_s = time.process_time()
    what()
    return time.process_time() - begin_s


# --- processes -------------------------------------------------------------------------------------------------------


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}


def _child(*words: str) -> dict[str, float]:
    """This file in a process of its own, whose memory is nobody else's."""
    command = [sys.executable, "-m", "bench.page", *words]
    done = subprocess.run(command, cwd=ROOT, env=_environment(), capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


if __name__ == "__main__":
    main()
