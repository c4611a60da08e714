"""How fast a real day runs: simulated seconds a second, frames a second, with all controllers and exact frame times.

Run: ``python bench/day.py``. Wall times are this machine's; the ratio of the two rows is the cost of the log.
"""

import tempfile
import time
from pathlib import Path

from bus_sim.day import DayOptions, run_day
from bus_sim.sites import find_site

#: Whole days run for each row; the median counts.
ROUNDS = 3


def measure(trace: Path | None) -> tuple[float, float, int]:
    """Wall seconds, simulated seconds and frames of one day, the median of ``ROUNDS`` by wall time."""
    found = []
    for _ in range(ROUNDS):
        started_s = time.perf_counter()
        summary = run_day(find_site("level1"), DayOptions(stalls=("AG-1F",), trace=trace, devices=True, quiet=True))
        found.append((time.perf_counter() - started_s, summary.simulated_s, summary.frames))
    return sorted(found)[ROUNDS // 2]


def main() -> None:
    """Print the table."""
    print("| the real day on level1 | wall s | times real time | fleet frames | fleet frames/s |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, trace in (("without a log", None), ("all buses logged", Path(folder) / "trace.log")):
            wall_s, simulated_s, frames = measure(trace)
            print(f"| {name} | {wall_s:.1f} | {simulated_s / wall_s:,.0f} | {frames:,} | {frames / wall_s:,.0f} |")


if __name__ == "__main__":
    main()
