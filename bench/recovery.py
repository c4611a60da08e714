"""The longest recovery times: ``python -m bench.recovery [SITE] [RUNS] [BIT/S]`` (default: small, 20 of each kind).

Each measure has scenes of its own, with one fault at a moment that the seed draws, while a car comes and goes; what is
told is the maximum over all runs, never the mean. ``bus_sim/campaign/recovery.py`` says what is measured from when.
"""

import random
import sys
import time
from collections.abc import Callable
from dataclasses import replace

from bench._arguments import a_count, a_site, given
from bus_sim.campaign.points import Single, count, points, reference
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.sites import find_site
from onboard.core.site import Site

#: The scene's car is gone by then, s.
SPAN_S = (15.0, 200.0)
Draw = Callable[[random.Random, str], AnyFault]

SCENES: dict[str, Draw] = {
    "a controller killed, off for 10 s": lambda c, name: Injection(
        "crash", {"target": name, "at_s": _moment(c), "restart_s": 10.0}
    ),
    "a controller killed, off for 0.5 s": lambda c, name: Injection(
        "crash", {"target": name, "at_s": _moment(c), "restart_s": 0.5}
    ),
    "a sender off the bus": lambda c, name: Injection("bus_off", {"target": name, "at_s": _moment(c), "for_s": 0.5}),
    "a machine cut off for 8 s": lambda c, name: Injection(
        "partition", {"members": name, "at_s": _moment(c), "for_s": 8.0}
    ),
    "all power cut for 10 s": lambda c, _: Injection(
        "power_cut", {"at_s": _moment(c), "for_s": 10.0, "seed": c.randrange(10**6)}
    ),
}


def _moment(chance: random.Random) -> float:
    return round(chance.uniform(*SPAN_S), 3)


def faults_of(site: Site, runs: int, chance: random.Random) -> dict[str, list[AnyFault]]:
    """The faults of each scene, one a run; single omissions are drawn from all of the reference scene's."""
    names = [machine.name for machine in site.machines.values()]
    found = {title: [draw(chance, chance.choice(names)) for _ in range(runs)] for title, draw in SCENES.items()}
    counts = count(site, reference(site.name, 3_600.0))
    omissions = points(site, Single.OMISSION, counts)
    return {**found, "one frame lost at one receiver": chance.sample(omissions, min(5 * runs, len(omissions)))}


def main() -> int:
    words = given(site=(a_site, "small"), runs=(a_count, 20), bitrate=(a_count, 0))
    site, runs = find_site(words.site), words.runs
    site = replace(site, bitrate=words.bitrate or site.bitrate)
    alone = reference(site.name, None)
    began_s, longest, seen, hours = time.process_time(), dict[str, int](), dict[str, int](), 0.0
    for title, faults in faults_of(site, runs, random.Random(1)).items():
        for number, fault in enumerate(faults):
            report = play(site, replace(alone, seed=number, limit_s=1_200.0, faults=(fault,)))
            hours += report.simulated_s / 3600
            for measure, us in report.recovery:
                longest[measure] = max(longest.get(measure, 0), us)
                seen[measure] = seen.get(measure, 0) + 1
        print(f"played: {title}, {len(faults)} runs")
    for measure, us in sorted(longest.items()):
        print(f"{measure:<22} at most {us / 1e6:8.3f} s (seen in {seen[measure]} runs)")
    print(f"{hours:.1f} simulated hours, {time.process_time() - began_s:.0f} s of processor time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
