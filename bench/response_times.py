"""Response times on the fleet bus, from queueing a frame to its end: measured on the simulated bus beside their bounds.

Each shipped site runs an hour of random arrivals at 125, 250 and 500 kbit/s. Printed for each message: worst measured,
what priority queues would guarantee; below, the one bound of all messages that our nodes' first-in first-out queues
give. "Late" are messages of which a second may be queued before the first is out. A measured time above its
bound, or traffic that the bounds do not allow for, ends the run with status 1.

    python -m bench.response_times [SITE ...] [--minutes 60] [--rates 125000,250000,500000]
"""

import argparse
import sys
from collections.abc import Sequence

from bus_sim.sites import find_site
from bus_sim.systems.car_park.response import Measured, measure
from onboard.systems.car_park.traffic import operation
from onboard.trace.response import utilisation

SITES = ("level1", "small", "standard")
RATES = (125_000, 250_000, 500_000)


def _ms(value_us: int | None) -> str:
    return "none" if value_us is None else f"{value_us / 1000:.2f}"


def report(runs: list[Measured]) -> list[str]:
    """Tables of one site at several bit rates."""
    site = runs[0].site
    lines = [f"### {site.name}: {len(site.machines)} machines", ""]
    heads = [f"{run.site.bitrate // 1000} kbit/s" for run in runs]
    lines.append("| ms | " + " | ".join(f"{head}: measured | by priority" for head in heads) + " |")
    lines.append("|---|" + "---|" * (2 * len(runs)))
    by_priority = [
        _row(name, [(run.meter.worst.get((False, name)), run.bounds[name][1]) for run in runs])
        for name in runs[0].bounds
    ]
    running = [(_worst(run, at_start=False), _fifo(run)) for run in runs]
    starting = [(_worst(run, at_start=True), run.power_up_us) for run in runs]
    lines += [*by_priority, _row("**any: FIFO bound**", running), _row("all start: FIFO bound", starting)]
    return [*lines, "", *(line for run in runs for line in _summary(run)), ""]


def _row(name: str, cells: Sequence[tuple[int | None, int | None]]) -> str:
    told = [("-" if measured is None else _ms(measured), _ms(bound)) for measured, bound in cells]
    return f"| {name} | " + " | ".join(text for pair in told for text in pair) + " |"


def _worst(run: Measured, *, at_start: bool) -> int:
    return max(worst_us for (starting, _), worst_us in run.meter.worst.items() if starting is at_start)


def _fifo(run: Measured) -> int | None:
    bounds = [bound_us for bound_us, _ in run.bounds.values()]
    return None if None in bounds else max(bound_us for bound_us in bounds if bound_us is not None)


def _summary(run: Measured) -> list[str]:
    meter, tasks = run.meter, max(run.meter.tasks, 1)
    share = utilisation(operation(run.site), run.site.bitrate)
    frames = f"{meter.frames} frames, {meter.tasks} tasks done, {meter.frames / tasks:.0f} frames a task, "
    frames += f"{(meter.frames - meter.periodic) / tasks:.0f} without heartbeats"
    load = f"bus load mean {run.load:.2%}, worst second {run.worst_second:.1%}"
    late = ["all in time" if not names else f"late: {', '.join(names)}" for names in run.late]
    return [
        f"{run.site.bitrate // 1000} kbit/s: {frames}; {load}; most that the streams allow {share:.0%}; "
        f"FIFO {late[0]}; by priority {late[1]}",
        *(f"WRONG: {line}" for line in run.wrong),
    ]


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sites", nargs="*", default=SITES, metavar="SITE")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rates", default=",".join(map(str, RATES)))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    wrong = 0
    for name in options.sites:
        rates = [int(rate) for rate in options.rates.split(",")]
        runs = [measure(find_site(name), rate, options.minutes, options.seed) for rate in rates]
        wrong += sum(len(run.wrong) for run in runs)
        print("\n".join(report(runs)), flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
