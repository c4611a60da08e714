"""A turning cell's run: orders come to the desk, lathes bid what a part costs, the winner's program is run."""

from typing import TYPE_CHECKING

from bus_sim.systems.stage import SystemStage, Tally
from bus_sim.systems.turning.orders import count
from bus_sim.systems.turning.plant import TurningPlant
from bus_sim.systems.turning.show import board
from onboard.contract.codes import OrderResult
from onboard.contract.messages import Bid
from onboard.systems.turning.clamping import choose_clamping
from onboard.systems.turning.site import Turning

if TYPE_CHECKING:  # the page's libraries are an extra
    from bus_sim.web.run_source import RunSource


class TurningStage(SystemStage[TurningPlant]):
    """One run of a turning shop: its lathes with their tools, and the jobs that are left."""

    def head(self) -> list[str]:
        """The usual line, and the number of orders."""
        return [f"{super().head()[0]}, {len(self.plant.site.orders)} orders"]

    def tally(self) -> Tally:
        """What became of each job: done, refused, or open still."""
        return count(self.plant)

    def bring(self, site: Turning, node: int) -> None:
        """The first job of the site that lathe ``node`` has a clamping for, once more."""
        lathe = site.lathes[node]
        fits = (one for one in site.orders if choose_clamping(one.job, site.drawings[one.job.drawing], lathe))
        wanted = next(fits)
        next(iter(self.plant.counters.values())).add(wanted)

    def picture(self) -> str:
        """Lathes with their jobs and how far their tools are worn, in characters."""
        return board(self.plant)

    def source(self) -> "RunSource":
        """The run as the page shows it; a person may order any job of the site once more."""
        from bus_sim.web.orders import let_order  # noqa: PLC0415  # its libraries are an extra

        return let_order(super().source(), self.plant.counters, self.plant.site.orders)

    def figures(self) -> dict[str, object]:
        """What a turning cell is judged by: orders, money, use of the lathes, edges, bids, how true the parts are."""
        plant, elapsed_us = self.plant, max(1, self.run.loop.now_us())
        done = [entry for entry in plant.entries if entry.result is OrderResult.DONE]
        return {
            "orders": len(plant.entries),
            "made": len(done),
            "refused": sum(entry.result is OrderResult.REFUSED for entry in plant.entries),
            "parts": sum(sum(device.made.values()) for device in plant.devices.values()),
            "price_eur": sum(entry.total_ct * entry.wanted.job.batch for entry in done) / 100,
            "bids": sum(isinstance(message, Bid) for _, message in self.messages),
            "edges_changed": sum(device.edges_changed for device in plant.devices.values()),
            **{f"use_of_{device.lathe.name}": device.busy_us / elapsed_us for device in plant.devices.values()},
            "worst_contour_error_mm": max(plant.errors_mm.values(), default=0.0),
        }
