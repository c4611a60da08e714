"""A run of a pick-up and delivery site: what came of it, in steps and in seconds."""

from collections import Counter
from statistics import fmean

from bus_sim.systems.mapd.orders import count
from bus_sim.systems.mapd.plant import UnitPlant
from bus_sim.systems.mapd.published import token_passing
from bus_sim.systems.mapd.show import picture
from bus_sim.systems.stage import SystemStage, Tally
from onboard.contract.mapd import StepRound
from onboard.contract.messages import CallForProposals


class MapdStage(SystemStage[UnitPlant]):
    """One run of pick-up and delivery: its carts on the floor, and the tasks that are left."""

    who = "tasks"

    def judge_end(self) -> None:
        """The oracle goes over the whole run once more, step by step."""
        self.plant.check_steps()

    def head(self) -> list[str]:
        """The usual line, and the numbers of robots and tasks."""
        site = self.plant.site
        return [f"{super().head()[0]}, {len(site.homes)} robots, {len(site.tasks)} tasks"]

    def tally(self) -> Tally:
        """What became of each task: delivered, refused, or open still."""
        return count(self.plant)

    def picture(self) -> str:
        """The floor cell by cell with its carts, in characters."""
        return picture(self.plant)

    def figures(self) -> dict[str, object]:
        """Service time and makespan in steps and seconds, and what was said for them."""
        plant, site, said = self.plant, self.plant.site, [message for _, message in self.messages]
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
