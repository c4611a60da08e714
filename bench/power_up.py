"""What all machines say that start together.

    python -m bench.power_up [MACHINES] [SEEDS] [BIT/S] [SEALS] [CARS] [WITHIN_S]

Default: 26 machines at 500 kbit/s, first without loss, then 20 seeds in which each receiver misses 10 % of all frames;
SEALS is off, watch or required (``docs/seals.md``). With CARS inside and computers that boot within WITHIN_S
seconds, by chance, it is the morning after a power cut: without loss, a run for each seed.
``bus_sim/campaign/power_up.py`` says when a machine takes part.
"""

import statistics
import sys
from functools import partial

from bench._arguments import a_count, a_number, given
from bus_sim.campaign.power_up import PowerUp, large_with, power_up
from bus_sim.systems.car_park.standing_cars import stand_drawn
from onboard.config.problems import ConfigError
from onboard.core.site import Site

LOSS = 0.1


def _line(title: str, found: PowerUp) -> str:
    most = ", ".join(f"{name} {number}" for name, number in found.frames.most_common(6))
    return f"{title}: worst second {found.worst_second:.1%}; all take part after {found.longest_s:.2f} s; {most}"


def _one_by_one(site: Site, seeds: int, cars: int, within_us: int) -> int:
    found = []
    for seed in range(1, seeds + 1):
        found.append(power_up(site, seed=seed, within_us=within_us, before=partial(stand_drawn, cars)))
        mirrors = "mirrors equal" if found[-1].mirrors == 1 else f"{found[-1].mirrors} mirrors that differ"
        print(
            _line(f"{len(site.machines)} machines, {cars} cars, seed {seed}", found[-1]), mirrors, sep="; ", flush=True
        )
    return 0 if all(len(one.parts_s) == len(site.machines) for one in found) else 1


def main() -> int:
    """Exit status 1 where somebody never takes part."""
    words = given(
        machines=(a_count, 26),
        seeds=(int, 20),
        bitrate=(a_count, 500_000),
        seals=(str, "off"),
        cars=(a_number, 0),
        within_s=(a_number, 0),
    )
    machines, seeds, bitrate, seals = words.machines, words.seeds, words.bitrate, words.seals
    try:
        site = large_with(machines, bitrate, seals)
    except (ValueError, ConfigError) as error:
        print(f"power_up.py: error: {error}", file=sys.stderr)
        return 2
    if words.cars or words.within_s:
        return _one_by_one(site, seeds, words.cars, words.within_s * 1_000_000)
    whole = power_up(site)
    print(_line(f"{machines} machines, nothing lost", whole), flush=True)
    lossy = [power_up(site, LOSS, seed) for seed in range(1, seeds + 1)]
    if lossy:
        worst = max(lossy, key=lambda one: one.worst_second)
        print(_line(f"{LOSS:.0%} lost, fullest of {seeds} seeds", worst))
        times_s = [one.longest_s for one in lossy]
        print(f"all take part: median {statistics.median(times_s):.2f} s, longest {max(times_s):.2f} s")
        print(f"mirrors equal after the time in {sum(one.mirrors == 1 for one in lossy)} of {seeds} seeds")
    return 0 if all(len(one.parts_s) == machines for one in [whole, *lossy]) else 1


if __name__ == "__main__":
    sys.exit(main())
