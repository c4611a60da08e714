"""``bus-sim run turning``: orders come to the desk, lathes bid what a part costs, the winner's program is run."""

import sys
from typing import TYPE_CHECKING, cast

from bus_sim.run import BusRun
from bus_sim.systems.session import Played, SystemPlant, conclude, play
from bus_sim.systems.turning.plant import TurningPlant, make_plant
from bus_sim.systems.turning.show import board
from onboard.core.messages import Bid
from onboard.core.site import Site
from onboard.systems.turning.messages import OrderResult
from onboard.systems.turning.site import Turning

if TYPE_CHECKING:
    from bus_sim.systems.registry import SystemOptions


def run_turning(site: Site, options: "SystemOptions") -> int:
    """Run a turning cell to its end and print what came of it; the exit status."""
    assert isinstance(site, Turning)
    if not options.quiet:
        sys.stdout.write(f"site {site.name}, seed {options.seed}, {len(site.orders)} orders\n\n")

    def picture(_: BusRun, plant: SystemPlant) -> str:
        return board(cast("TurningPlant", plant))

    played = play(site, options, make_plant, picture)
    if not options.quiet:
        sys.stdout.write(board(cast("TurningPlant", played.plant)) + "\n\n")
    return conclude(played, site, options, figures(played), options.quiet)


def figures(played: Played) -> dict[str, object]:
    """What a turning cell is judged by: orders, money, use of the lathes, edges, bids, and how true the parts are."""
    plant = cast("TurningPlant", played.plant)
    done = [entry for entry in plant.entries if entry.result is OrderResult.DONE]
    elapsed_us = max(1, played.run.loop.now_us())
    return {
        "orders": len(plant.entries),
        "made": len(done),
        "refused": sum(entry.result is OrderResult.REFUSED for entry in plant.entries),
        "parts": sum(sum(device.made.values()) for device in plant.devices.values()),
        "price_eur": sum(entry.total_ct * entry.wanted.job.batch for entry in done) / 100,
        "bids": sum(isinstance(message, Bid) for _, message in played.messages),
        "edges_changed": sum(device.edges_changed for device in plant.devices.values()),
        **{f"use_of_{device.lathe.name}": device.busy_us / elapsed_us for device in plant.devices.values()},
        "worst_contour_error_mm": max(plant.errors_mm.values(), default=0.0),
    }
