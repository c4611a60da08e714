"""Pick-up and delivery on the small warehouse: service time and makespan of the auction beside Token Passing.

    python bench/mapd.py [--robots N] [--rate TASKS_A_STEP] [--bus]

By the robots' decision functions alone, or with ``--bus`` by their controllers on the virtual CAN bus. All 500 tasks of
each file that ships. The times of Token Passing are those of Ma, Li, Kumar and Koenig (AAMAS 2017). Deterministic but
for the processor time, which is given for all machines together: on board each plans for itself.
"""

import argparse
import time
from importlib.resources import as_file, files
from itertools import pairwise

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.systems.mapd.importers.command import import_files
from bus_sim.systems.mapd.importers.draft import site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand
from bus_sim.systems.mapd.plant import UnitPlant
from bus_sim.systems.mapd.published import TOKEN_PASSING
from bus_sim.systems.mapd.steps import SteppedDay
from onboard.config.site import parse_site
from onboard.contract.mapd import StepRound
from onboard.systems.mapd.site import Mapd


def site_of(robots: int, rate: str) -> Mapd:
    with as_file(files("bus_sim") / "data" / "mapd") as folder:
        draft = import_files([folder / f"kiva-{robots}-500-5.map", folder / f"kiva-{rate}.task"], DrawnDemand())
    site = parse_site(site_text(draft), "kiva")
    assert isinstance(site, Mapd)
    return site


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, choices=[10, 30], help="only with so many robots")
    parser.add_argument("--rate", choices=["0.5", "2", "10"], help="only so many tasks a step")
    parser.add_argument("--bus", action="store_true", help="controllers on the virtual bus: minutes a file")
    args = parser.parse_args()
    print("tasks a step  robots  service time   TP  below TP  makespan  served  processor")
    for (rate, robots), published in TOKEN_PASSING.items():
        if args.robots not in (None, robots) or args.rate not in (None, rate):
            continue
        site = site_of(robots, rate)
        began = time.process_time()
        service, makespan, served, more = _on_the_bus(site) if args.bus else _alone(site)
        spent = time.process_time() - began
        below = 100 * (1 - service / published)
        print(
            f"{rate:>12}  {robots:6}  {service:12.1f}  {published:5.1f}  {below:6.1f} %  {makespan:8}"
            f"  {served:6}  {spent:7.1f} s{more}",
            flush=True,
        )


def _alone(site: Mapd) -> tuple[float, int, int, str]:
    day = SteppedDay(site.floor, list(site.homes.values()), site.rests, site.tasks).run()
    return day.service_time, day.makespan, len(day.served), ""


def _on_the_bus(site: Mapd) -> tuple[float, int, int, str]:
    """Besides: frames, their share of the bus's time, the longest step, and whether the day alone was the same."""
    played = play(site, RunOptions(quiet=True))
    plant = played.plant
    assert isinstance(plant, UnitPlant)
    plant.check_steps()
    assert played.is_good, plant.violations
    release = {task.number: task.release for task in site.tasks}
    service = sum(step - release[number] for number, step in plant.served.items()) / len(plant.served)
    alone = SteppedDay(site.floor, list(site.homes.values()), site.rests, site.tasks).run()
    begun_us: dict[int, int] = {}
    for time_us, one in played.messages:
        if isinstance(one, StepRound):
            begun_us.setdefault(one.step, time_us)
    longest_us = max(later - earlier for earlier, later in pairwise(begun_us.values()))
    statistics = played.run.fleet.statistics()
    same = "as alone" if plant.served == alone.served else "NOT as alone"
    loads = f"{100 * statistics.mean_load:.1f} % (worst second {100 * statistics.worst_second_load:.1f} %)"
    more = f"  {statistics.frames} frames, load {loads}, longest step {longest_us / 1e6:.2f} s, {same}"
    return service, max(plant.served.values()), len(plant.served), more


if __name__ == "__main__":
    main()
