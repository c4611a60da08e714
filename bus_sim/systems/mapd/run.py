"""``bus-sim run`` on a pick-up and delivery site: what came of it, in steps and in seconds."""

import sys
from collections import Counter
from statistics import fmean
from typing import TYPE_CHECKING, cast

from bus_sim.run import BusRun
from bus_sim.systems.mapd.plant import UnitPlant, make_plant
from bus_sim.systems.mapd.published import token_passing
from bus_sim.systems.mapd.show import picture
from bus_sim.systems.session import Played, SystemPlant, conclude, play
from onboard.core.messages import CallForProposals
from onboard.core.site import Site
from onboard.systems.mapd.messages import StepRound
from onboard.systems.mapd.site import Mapd

if TYPE_CHECKING:
    from bus_sim.systems.registry import SystemOptions


def run_mapd(site: Site, options: "SystemOptions") -> int:
    """Play the site's tasks on the virtual bus; 1 where one was not served, or where robots met."""
    assert isinstance(site, Mapd)
    played = play_day(site, options)
    if not options.quiet:
        sys.stdout.write(picture(cast("UnitPlant", played.plant)) + "\n\n")
    return conclude(played, site, options, figures(played), options.quiet)


def play_day(site: Mapd, options: "SystemOptions") -> Played:
    """The run, judged once more step by step at its end."""

    def show(_: BusRun, plant: SystemPlant) -> str:
        return picture(cast("UnitPlant", plant))

    played = play(site, options, make_plant, show)
    cast("UnitPlant", played.plant).check_steps()
    return played


def figures(played: Played) -> dict[str, object]:
    """Service time and makespan in steps and seconds, and what was said for them."""
    plant = cast("UnitPlant", played.plant)
    site, said = plant.site, [message for _, message in played.messages]
    served = [one for one in plant.goods.values() if one.served_step is not None and one.served_us is not None]
    steps = [one.served_step - one.task.release for one in served if one.served_step is not None]
    seconds = [(one.served_us - one.ordered_us) / 1e6 for one in served if one.served_us is not None]
    counts = Counter(type(one).__name__ for one in said)
    published = token_passing(site.name, len(site.tasks))
    return {
        "robots": len(site.homes),
        "tasks": len(site.tasks),
        "served": len(served),
        "step_ms": site.step_ms,
        "steps": max((one.step for one in said if isinstance(one, StepRound)), default=0),
        "mean_service_steps": round(fmean(steps), 2) if steps else 0.0,
        **({} if published is None else {"token_passing_published": published}),
        "makespan_steps": max((one.served_step or 0 for one in served), default=0),
        "mean_service_s": fmean(seconds) if seconds else 0.0,
        "calls": len({one.call for one in said if isinstance(one, CallForProposals)}),
        "bids": counts["Bid"],
        "awards": counts["Award"],
        "paths": counts["PathHead"],
    }
