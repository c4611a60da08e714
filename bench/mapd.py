"""Pick-up and delivery on the small warehouse: service time and makespan of the auction beside Token Passing.

    python bench/mapd.py [--robots N] [--rate TASKS_A_STEP]

All 500 tasks of each file that ships. The times of Token Passing are those of Ma, Li, Kumar and Koenig (AAMAS 2017).
Deterministic but for the processor time, which is given for all robots together: on board each plans for itself.
"""

import argparse
import time
from importlib.resources import as_file, files

from bus_sim.importers.command import import_files
from bus_sim.importers.draft import site_text
from bus_sim.importers.mapf import Wanted
from bus_sim.systems.mapd.published import TOKEN_PASSING
from bus_sim.systems.mapd.steps import Day
from onboard.config.site import parse_site
from onboard.kinds.mapd.site import Mapd


def site_of(robots: int, rate: str) -> Mapd:
    with as_file(files("bus_sim") / "data" / "mapd") as folder:
        draft = import_files([folder / f"kiva-{robots}-500-5.map", folder / f"kiva-{rate}.task"], Wanted())
    site = parse_site(site_text(draft), "kiva")
    assert isinstance(site, Mapd)
    return site


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, choices=[10, 30], help="only with so many robots")
    parser.add_argument("--rate", choices=["0.5", "2", "10"], help="only so many tasks a step")
    args = parser.parse_args()
    print("tasks a step  robots  service time   TP  below TP  makespan  served  processor")
    for (rate, robots), published in TOKEN_PASSING.items():
        if args.robots not in (None, robots) or args.rate not in (None, rate):
            continue
        site = site_of(robots, rate)
        began = time.process_time()
        day = Day(site.floor, list(site.homes.values()), site.rests, site.tasks).run()
        spent = time.process_time() - began
        below = 100 * (1 - day.service_time / published)
        print(
            f"{rate:>12}  {robots:6}  {day.service_time:12.1f}  {published:5.1f}  {below:6.1f} %  {day.makespan:8}"
            f"  {len(day.served):6}  {spent:7.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
