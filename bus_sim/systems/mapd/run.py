"""``bus-sim run`` on a pick-up and delivery site: the day step by step, without frames, and its figures."""

import json
import sys
from typing import TYPE_CHECKING

from bus_sim.demand import DemandError
from bus_sim.systems.mapd.steps import Day
from onboard.core.site import Site
from onboard.kinds.mapd.site import Mapd

if TYPE_CHECKING:
    from bus_sim.systems.registry import SystemOptions

#: A day that has not ended by then has somebody who waits for ever.
MOST_STEPS = 200_000


def run_mapd(site: Site, options: "SystemOptions") -> int:
    """Play the site's tasks; 1 where one was not served. The judge raises where robots met.

    Raises ``DemandError`` for a fault asked for.
    """
    assert isinstance(site, Mapd)
    if options.faults:
        raise DemandError(f"--fault: {site.name} is played without a bus, so nothing can fail on it; leave it out")
    limit = MOST_STEPS if options.limit_s is None else round(options.limit_s * 1000 / site.step_ms)
    day = Day(site.floor, list(site.homes.values()), site.rests, site.tasks).run(limit)
    figures: dict[str, object] = {
        "site": site.name,
        "robots": len(site.homes),
        "tasks": len(site.tasks),
        "served": len(day.served),
        "steps": day.step,
        "step_ms": site.step_ms,
        "searches": day.searches,
        "kept_former_path": day.failures,
    }
    if day.served:
        figures |= {"mean_service_steps": round(day.service_time, 2), "makespan_steps": day.makespan}
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    if not options.quiet:
        sys.stdout.write("without a bus: the robots' own decisions, step by step; no trace is written\n")
        sys.stdout.writelines(f"{name.replace('_', ' ')}: {value}\n" for name, value in figures.items())
    return 0 if day.is_over else 1
