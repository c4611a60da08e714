"""What a run keeps, hour by hour: memory, and processor time a frame, of one process with all machines of `level1`.

Run: ``python -m bench.memory [--hours 70] [--every 10]``. The bar: less than 1 MB more after the first ten hours, and a
frame takes as long at the end as at the beginning. Memory is resident (Linux); of processor time keep the ratio.
"""

import argparse
import asyncio
import gc
import os
import sys
import time
from pathlib import Path
from typing import Any

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay

#: Seconds between cars: as many a day as the level has on its real one, all day long.
CAR_S, SPREAD_S = 630, 120


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=int, default=70)
    parser.add_argument("--every", type=int, default=10, help="hours between rows")
    args = parser.parse_args()
    print("| hours | cars | resident MB | blocks | us a frame since the last row |\n|---|---|---|---|---|")
    end_s = args.hours * 3600

    def watched(run: Any) -> None:
        last = [time.process_time(), 0]

        def row(hour: int) -> None:
            gc.collect()
            spent_s, frames = time.process_time() - last[0], run.fleet.statistics().frames - last[1]
            last[:] = [time.process_time(), run.fleet.statistics().frames]
            cost = f"{spent_s / max(1, frames) * 1e6:.0f}"
            print(
                f"| {hour} | {hour * 3600 // CAR_S} | {_resident_mb():.2f} | {sys.getallocatedblocks():,} | {cost} |",
                flush=True,
            )

        for hour in sorted({1, *range(args.every, args.hours + 1, args.every)}):
            asyncio.get_event_loop().call_later(hour * 3600, row, hour)

    demand = ParkingDay(random_s=(CAR_S, SPREAD_S), cars=end_s // CAR_S + 10)
    play(find_site("level1"), RunOptions(demand=demand, limit_s=end_s + 1), watched)


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    main()
