"""Pick-up and delivery: mean, 95 % and greatest service time of the auction on any map and task file.

    python bench/mapd.py [MAP TASKS] [--robots N] [--rate TASKS_A_STEP] [--rules NAME ...] [--bus]
    python bench/mapd.py --all [--seed N] [--keep FILE] [--rules NAME ...]
    python bench/mapd.py --great ROBOTS TASKS [--bus [--seconds S]] [--rules NAME ...]
    python bench/mapd.py --write FOLDER [--seed N]

Without files those that ship, beside the times of Token Passing by Ma, Li, Kumar and Koenig (AAMAS 2017). ``--all``
plays their 35 combinations of robots and tasks a step; what does not ship is drawn, with ``--seed`` all tasks are. With
``--keep`` what was played is written to a file, and not played again. ``--great`` is a floor of 41 rows of 75 with all
tasks at once; with ``--seconds`` only so much of it is played. ``--write`` writes the drawn files. By the
robots' decision functions alone, or with ``--bus`` by their controllers on the virtual CAN bus. Service time is in
steps from release to delivery. Deterministic but for the processor time, which is given for all machines together: on
board each plans for itself.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from importlib.resources import as_file, files
from itertools import pairwise
from pathlib import Path
from statistics import fmean

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.systems.mapd.importers.command import import_files
from bus_sim.systems.mapd.importers.draft import site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand, import_map
from bus_sim.systems.mapd.plant import UnitPlant
from bus_sim.systems.mapd.published import TOKEN_PASSING
from bus_sim.systems.mapd.steps import SteppedDay
from bus_sim.systems.mapd.warehouse import RATES, ROBOTS, great_floor, map_text, task_text
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.contract.mapd import StepRound
from onboard.systems.mapd.auction import BidWeights
from onboard.systems.mapd.site import Mapd
from onboard.trace.durations import percentile


@dataclass(frozen=True)
class Rule:
    """By what robots bid, and whether they go where the next call is near."""

    bids: BidWeights
    waits: bool


#: The same whatever is open.
BEFORE = BidWeights(younger=0, younger_at_last=0, crowded_wait=100, crowded_loaded=50, nearby=0, shorter=0)
#: The rule of the robots, the one before it, and that one with nothing for the way with the load.
RULES = {
    "negotiated": Rule(BidWeights(), waits=True),
    "before": Rule(BEFORE, waits=False),
    "without-loaded": Rule(replace(BEFORE, loaded=0, crowded_loaded=0), waits=False),
}


@dataclass(frozen=True)
class Times:
    """Steps from release to delivery: mean, 95 % and most; the step of the last delivery; processor time in s."""

    mean: float
    p95: float
    most: int
    makespan: int
    served: int
    spent_s: float

    @classmethod
    def of(cls, site: Mapd, served: dict[int, int], spent_s: float) -> "Times":
        """Of the step at which each task was delivered."""
        release = {task.number: task.release for task in site.tasks}
        steps = sorted(step - release[number] for number, step in served.items()) or [0]
        p95, makespan = percentile(steps, 0.95), max(served.values(), default=0)
        return cls(fmean(steps), p95, steps[-1], makespan, len(served), round(spent_s, 2))

    def __str__(self) -> str:
        """As one part of a row."""
        return f"{self.mean:8.2f} {self.p95:6.0f} {self.most:5} {self.makespan:9} {self.served:7} {self.spent_s:8.1f} s"


HEAD = "    mean    95 %   max  makespan  served  processor"


def read_site(paths: list[Path]) -> Mapd:
    """The site of a map and its tasks, or of any file that ``bus-sim import`` takes. Raises ``ConfigError``."""
    return _as_site(site_text(import_files(paths, DrawnDemand())))


def drawn_site(robots: int, rate: str, seed: int) -> Mapd:
    """The small warehouse with so many robots and tasks a step."""
    tasks = Path(f"kiva-{rate}.task"), task_text(rate, seed)
    return _as_site(site_text(import_map(Path(map_name(robots)), map_text(robots), tasks, DrawnDemand())))


def map_name(robots: int) -> str:
    """As Ma et al. call their maps."""
    return f"kiva-{robots}-500-5.map"


def _as_site(text: str) -> Mapd:
    site = parse_site(text, "kiva")
    assert isinstance(site, Mapd)
    return site


def main() -> int:
    args = _arguments()
    try:
        if args.write:
            _write(args.write, args.seed)
        elif args.all:
            _play_all(args)
        elif args.files or args.great:
            site = read_site(args.files) if args.files else _as_site(site_text(great_floor(*args.great)))
            print(f"{'rule':16}{HEAD}")
            for name in args.rules:
                print(f"{name:16}{_play(site, RULES[name], on_bus=args.bus, seconds=args.seconds)}", flush=True)
        else:
            _play_shipped(args)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="a map and its task file")
    parser.add_argument("--robots", type=int, choices=ROBOTS, help="only with so many robots")
    parser.add_argument("--rate", choices=RATES, help="only so many tasks a step")
    parser.add_argument("--rules", nargs="+", choices=RULES, default=list(RULES), help="only these rules")
    parser.add_argument("--great", nargs=2, type=int, metavar=("ROBOTS", "TASKS"), help="a great floor")
    parser.add_argument("--seconds", type=float, metavar="S", help="on the bus: of bus time, and no further")
    parser.add_argument("--all", action="store_true", help="all 35 combinations")
    parser.add_argument("--seed", type=int, default=0, help="draw the tasks' ends by it (default: those that ship)")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="with --all: go on where this file ends")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write maps and task files there, and play none")
    parser.add_argument("--bus", action="store_true", help="controllers on the virtual bus: minutes a file")
    return parser.parse_args()


def _write(folder: Path, seed: int) -> None:
    """All maps and task files, in the shipped format."""
    folder.mkdir(parents=True, exist_ok=True)
    for robots in ROBOTS:
        (folder / map_name(robots)).write_text(map_text(robots), encoding="utf-8")
    for rate in RATES:
        (folder / f"kiva-{rate}.task").write_text(task_text(rate, seed), encoding="utf-8")


# --- what is played ----------------------------------------------------------------------------------------------


def _play_shipped(args: argparse.Namespace) -> None:
    """The six files that ship, beside Token Passing."""
    print(f"tasks a step  robots     TP  below TP  {HEAD}")
    for (rate, robots), published in TOKEN_PASSING.items():
        if args.robots not in (None, robots) or args.rate not in (None, rate):
            continue
        with as_file(files("bus_sim") / "data" / "mapd") as folder:
            site = read_site([folder / map_name(robots), folder / f"kiva-{rate}.task"])
        told = _play(site, RULES[args.rules[0]], on_bus=args.bus)
        below = 100 * (1 - told.times.mean / published)
        print(f"{rate:>12}  {robots:6}  {published:5.1f}  {below:6.1f} %  {told}", flush=True)


def _play_all(args: argparse.Namespace) -> None:
    """A row a combination, and in it each rule's mean, 95 % and maximum."""
    kept = dict(_read_kept(args.keep)) if args.keep is not None else {}
    print("tasks a step  robots" + "".join(f"  {name + ': mean, 95 %, max':>28}" for name in args.rules))
    for rate in RATES:
        for robots in ROBOTS:
            if args.robots not in (None, robots) or args.rate not in (None, rate):
                continue
            row = f"{rate:>12}  {robots:6}"
            for name in args.rules:
                key = f"{name} {robots} {rate} {args.seed}"
                if key not in kept:
                    kept[key] = _play(drawn_site(robots, rate, args.seed), RULES[name], on_bus=args.bus).times
                    if args.keep is not None:
                        with args.keep.open("a", encoding="utf-8") as file:
                            file.write(json.dumps({"key": key, **asdict(kept[key])}) + "\n")
                times = kept[key]
                row += f"  {times.mean:14.2f} {times.p95:6.0f} {times.most:6}"
            print(row, flush=True)


def _read_kept(path: Path) -> Iterator[tuple[str, Times]]:
    """What was played before; nothing where there is no such file."""
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        fields = json.loads(line)
        yield fields.pop("key"), Times(**fields)


@dataclass(frozen=True)
class Played:
    """The times, and what there is to tell of a bus."""

    times: Times
    more: str = ""

    def __str__(self) -> str:
        """As the end of a row."""
        return f"{self.times}{self.more}"


def _play(site: Mapd, rule: Rule, *, on_bus: bool, seconds: float | None = None) -> Played:
    began = time.process_time()
    if on_bus:
        return _on_the_bus(site, began, seconds)
    day = _alone(site, rule)
    return Played(Times.of(site, day.served, time.process_time() - began))


def _alone(site: Mapd, rule: Rule) -> SteppedDay:
    homes, ends = list(site.homes.values()), site.endpoints
    return SteppedDay(site.floor, homes, site.rests, site.tasks, rule.bids, ends, rule.waits).run()


def _on_the_bus(site: Mapd, began: float, seconds: float | None) -> Played:
    """Besides: frames, their share of the bus's time, the longest step, and whether the day alone was the same."""
    played = play(site, RunOptions(quiet=True, limit_s=seconds))
    spent_s = time.process_time() - began
    plant = played.plant
    assert isinstance(plant, UnitPlant)
    plant.check_steps()
    assert not plant.violations, plant.violations
    assert seconds is not None or played.is_good
    begun_us: dict[int, int] = {}
    for time_us, one in played.messages:
        if isinstance(one, StepRound):
            begun_us.setdefault(one.step, time_us)
    longest_us = max(later - earlier for earlier, later in pairwise(begun_us.values()))
    statistics = played.run.fleet.statistics()
    if seconds is not None:
        same = f"{len(begun_us)} steps"
    else:
        same = "as alone" if plant.served == _alone(site, RULES["negotiated"]).served else "NOT as alone"
    loads = f"{100 * statistics.mean_load:.1f} % (worst second {100 * statistics.worst_second_load:.1f} %)"
    each_ms = 1000 * spent_s / len(begun_us) / len(site.homes)
    more = f"  {statistics.frames} frames, load {loads}, longest step {longest_us / 1e6:.2f} s"
    return Played(Times.of(site, plant.served, spent_s), f"{more}, {each_ms:.1f} ms a robot and step, {same}")


if __name__ == "__main__":
    sys.exit(main())
