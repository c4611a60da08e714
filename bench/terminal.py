"""Decentralised over central on equal terminal missions: waiting, finishing, plans made anew for each disturbance.

Five sets of missions on the shipped network, drawn by seed: two loads and two transhipments each, and a blocked lane.
Same plant, same bus, same robots, same durations; only who decides differs.
"""

import random
from dataclasses import replace

from bench._arguments import given
from bus_sim.options import RunOptions
from bus_sim.sites import find_site
from bus_sim.systems.terminal.central import play_auction, play_central
from bus_sim.systems.terminal.run import TerminalOutcome
from onboard.systems.terminal.site import Blockage, Mission, Terminal
from onboard.systems.terminal.vehicle import terminal

SEEDS = range(1, 6)
LIMIT_US = 3_600_000_000


def missions(site: Terminal, seed: int) -> Terminal:
    """A day's missions by seed."""
    chance = random.Random(f"bench:{seed}")
    names = site.by_name
    targets = [names[name].number for name in ("S10", "S1", "S4")]
    source = names["A4"].number
    by_name = {box.name: number for number, box in enumerate(site.boxes, 1)}
    typed = [
        Mission(chance.randrange(5, 90) * 1_000_000, site.desk, chance.choice(targets), count, "T1", source)
        for count in (2, 3)
    ]
    tops = [("B14", "B13"), ("B12", "B11")]
    typed += [
        Mission(
            chance.randrange(5, 120) * 1_000_000,
            site.desk,
            chance.choice(targets),
            boxes=tuple(by_name[name] for name in pair),
        )
        for pair in tops
    ]
    lane = names[chance.choice(["L11", "L2", "L8"])].number
    at_us = chance.randrange(40, 120) * 1_000_000
    return replace(site, missions=tuple(typed), blockages=(Blockage(lane, at_us, at_us + 60_000_000),))


def main() -> None:
    given()
    site = terminal(find_site("terminal"))
    print("seed  decided by  boxes  waiting mean/max s  finishing mean/max s  last s  plans anew  frames")
    totals: dict[str, list[tuple[float, float]]] = {"auction": [], "central": []}
    for seed in SEEDS:
        day = missions(site, seed)
        for name, play in (("auction", play_auction), ("central", play_central)):
            found = play(day, RunOptions(seed=seed), limit_us=LIMIT_US)
            totals[name].append((found.mean_s(lambda one: one.waited_us), found.mean_s(lambda one: one.finished_us)))
            print(line(seed, name, found))
    waiting, finishing = (
        sum(one[n] for one in totals["auction"]) / sum(one[n] for one in totals["central"]) for n in (0, 1)
    )
    print(f"auction over central: waiting {waiting:.3f}, finishing {finishing:.3f}")


def line(seed: int, name: str, found: TerminalOutcome) -> str:
    waits = [one.waited_us / 1e6 for one in found.deliveries]
    ends = [one.finished_us / 1e6 for one in found.deliveries]
    done = f"{len(found.deliveries)}/{found.ordered}"
    good = "" if found.is_good else "  NOT GOOD"
    return (
        f"{seed:4}  {name:10} {done:>6}  {sum(waits) / len(waits):8.1f} / {max(waits):6.1f} "
        f"{sum(ends) / len(ends):10.1f} / {max(ends):6.1f}  {found.ended_us / 1e6:7.1f} {found.touched:10}  "
        f"{found.frames:6}{good}"
    )


if __name__ == "__main__":
    main()
