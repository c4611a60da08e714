"""The model of ``bus-sim design`` beside the plant on car parks drawn by chance (``bench.drawn``), a row for each.

    python -m bench.drawn_model [1-8] [--system car-park] [--cars 15] [--mean 45] [--sigma 15]

Mean waits in and out, and the longer 95 % of the two, s: model / plant. Exit status 0 whatever they are.
"""

import argparse
from collections.abc import Sequence

from bench.drawn import drawn_site
from bus_sim.demand import DemandError, read_seeds
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.design.days import DayPlan
from bus_sim.systems.car_park.design.measure import Outcome, Trial, modelled, played
from bus_sim.systems.car_park.design.options import size_of
from onboard.config.site import parse_site
from onboard.systems.car_park.site import car_park


def row(number: int, trial: Trial, model: Outcome, plant: Outcome) -> str:
    """One site's line, and whom the plant left waiting."""
    found = (model.wait_in.mean_s, plant.wait_in.mean_s), (model.wait_out.mean_s, plant.wait_out.mean_s)
    pairs = [*found, (model.p95_s, plant.p95_s)]
    told = [f"{one:.1f} / {two:.1f} ({one / two - 1:+.0%})" if two else f"{one:.1f} / {two:.1f}" for one, two in pairs]
    left = f", {plant.left} left waiting in the plant" if plant.left else ""
    return f"{number} ({trial.size}): in {told[0]}, out {told[1]}, 95 % {told[2]}{left}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each site."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("sites", nargs="?", default="1-8", metavar="A-B", help="their numbers (1-8)")
    parser.add_argument("--system", choices=("car-park", "lines"), default="car-park")
    parser.add_argument("--cars", type=int, default=15)
    parser.add_argument("--mean", type=float, default=45.0, metavar="SECONDS", help="between two that come")
    parser.add_argument("--sigma", type=float, default=15.0, metavar="SECONDS", help="its deviation")
    options = parser.parse_args(arguments)
    try:
        numbers = read_seeds(options.sites)
        demands = {one: Demand.by_mean(options.mean, options.sigma, one, count=options.cars) for one in numbers}
    except DemandError as error:
        parser.error(str(error).removeprefix("--seeds "))
    for number, demand in demands.items():
        text = drawn_site(options.system, number)
        size = size_of(car_park(parse_site(text, f"d{number}.toml")))
        trial = Trial(size, text, DayPlan("day", demand, number))
        print(row(number, trial, modelled(trial), played(trial)), flush=True)


if __name__ == "__main__":
    main()
