"""Response times on the fleet bus, from saying a frame to its end: measured on the simulated bus beside their bounds.

Each shipped site, and ``large`` with eight more robots (26 machines), runs an hour of random arrivals at 125, 250 and
500 kbit/s, after all started together; then a burst: everybody says at one instant all that a budget is for, and more
than that. Printed for each message: worst measured, how long it may wait for its sender's budgets, and what priority
queues would guarantee on the bus; below, the one bound on the bus of all messages that our nodes' first-in first-out
queues give. "Late" are messages of which as many again may be queued before they are out. A measured time above its
bound, a message without a bound, or traffic that the bounds do not allow for, ends the run with status 1.

    python -m bench.response_times [SITE ...] [--minutes 60] [--rates 125000,250000,500000]
"""

import argparse
import sys
from collections.abc import Sequence

from bus_sim.campaign.power_up import large_with
from bus_sim.sites import find_site
from bus_sim.systems.car_park.response import Measured, measure
from onboard.core.site import Site
from onboard.systems.car_park.traffic import operation
from onboard.trace.response import utilisation

#: ``large`` with so many machines is named by their number.
MACHINES = 26
SITES = ("level1", "small", "standard", str(MACHINES))
RATES = (125_000, 250_000, 500_000)


def _ms(value_us: int) -> str:
    return f"{value_us / 1000:.2f}"


def site_of(name: str, bit_rate: int) -> Site:
    """A shipped site, or ``large`` with that number of machines. Raises as their readers do."""
    return large_with(int(name), bit_rate) if name.isdigit() else find_site(name)


def report(runs: list[Measured]) -> list[str]:
    """Tables of one site at several bit rates."""
    site = runs[0].site
    lines = [f"### {site.name}: {len(site.machines)} machines", ""]
    heads = [f"{run.site.bitrate // 1000} kbit/s" for run in runs]
    lines.append("| ms | " + " | ".join(f"{head}: measured | budgets | by priority" for head in heads) + " |")
    lines.append("|---|" + "---|" * (3 * len(runs)))
    by_priority = [
        _row(name, [(run.meter.worst.get((False, name)), run.waits.get(name, 0), run.bounds[name][1]) for run in runs])
        for name in runs[0].bounds
    ]
    running = [(_worst(run, at_start=False), None, _fifo(run)) for run in runs]
    starting = [(_worst(run, at_start=True), None, run.power_up_us) for run in runs]
    bursts = [(run.burst_us, None, _fifo(run)) for run in runs]
    lines += [*by_priority, _row("**any, on the bus: FIFO bound**", running), _row("all start: FIFO bound", starting)]
    lines.append(_row("all say all at once, on the bus: FIFO bound", bursts))
    return [*lines, "", *(line for run in runs for line in _summary(run)), ""]


def _row(name: str, cells: Sequence[tuple[int | None, int | None, int | None]]) -> str:
    texts = [tuple("-" if one is None else _ms(one) for one in cell) for cell in cells]
    return f"| {name} | " + " | ".join(text for pair in texts for text in pair) + " |"


def _worst(run: Measured, *, at_start: bool) -> int:
    return max(worst_us for (starting, _), worst_us in run.meter.on_bus.items() if starting is at_start)


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
    """Measure the named sites; exit status 1 where a measured response is longer than its bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sites", nargs="*", default=SITES, metavar="SITE")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rates", default=",".join(map(str, RATES)))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    wrong = 0
    for name in options.sites:
        rates = [int(rate) for rate in options.rates.split(",")]
        runs = [measure(site_of(name, rate), rate, options.minutes, options.seed) for rate in rates]
        wrong += sum(len(run.wrong) for run in runs)
        print("\n".join(report(runs)), flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
