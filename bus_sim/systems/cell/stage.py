"""A cell's run: goals come to the counter, robots negotiate, carry and hand over; what came of it."""

from dataclasses import replace
from typing import TYPE_CHECKING

from bus_sim.run import BusRun
from bus_sim.systems.cell.orders import count, draw
from bus_sim.systems.cell.plant import CellPlant
from bus_sim.systems.cell.show import plan
from bus_sim.systems.cell.tree import ContractTree
from bus_sim.systems.cell.view import CellView
from bus_sim.systems.orders import OrderArrivals
from bus_sim.systems.stage import SystemStage, Tally
from onboard.contract.codes import OrderResult
from onboard.contract.messages import Reference
from onboard.systems.cell.contracts import Goal
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.cell.site import Cell

if TYPE_CHECKING:  # the page's libraries are an extra
    from bus_sim.web.run_source import RunSource


class CellStage(SystemStage[CellPlant]):
    """One run of a cell: its arms in their workspaces, and the goals that are left."""

    who = "goals"

    def __init__(self, run: BusRun[CellPlant]) -> None:
        super().__init__(run)
        self.view = CellView(run.plant.site)

    def head(self) -> list[str]:
        """The usual line, and the number of goals."""
        return [f"{super().head()[0]}, {len(self.plant.site.goals)} goals"]

    def listen(self) -> None:
        """Every message of the fleet bus also goes to the view that the picture is drawn of."""
        super().listen()
        self.run.observers.append(lambda message, _: self.view.feed(message))

    def tally(self) -> Tally:
        """What became of each goal: done, refused, or open still."""
        return count(self.plant)

    def bring(self, site: Cell, node: int) -> None:
        """A goal within the workspace of arm ``node``, drawn by the run's seed."""
        alone = replace(site, arms={node: site.arms[node]})
        next(iter(self.plant.counters.values())).add(draw(alone, OrderArrivals(1, 1.0), self.run.options.seed).goals[0])

    def picture(self) -> str:
        """The plan of the cell with arms and parts, in characters."""
        return plan(self.plant, self.view)

    def remarks(self) -> list[str]:
        """The paper's text for each goal, then the picture."""
        lines = []
        for node, counter in self.plant.counters.items():
            for entry in counter.entries:
                text = self.view.text(Reference(node, entry.number))
                lines += ["", f"Goal {entry.number}", *text.removesuffix("\n").split("\n")]
        return [*lines, *super().remarks()]

    def source(self) -> "RunSource":
        """The run as the page shows it; a person may order any goal of the site once more."""
        from bus_sim.web.orders import let_order  # noqa: PLC0415  # its libraries are an extra

        return let_order(super().source(), self.plant.counters, self.plant.site.goals)

    def figures(self) -> dict[str, object]:
        """What a cell is judged by: goals, time to achieve them, cost beside the exhaustive optimum, goal messages."""
        plant, view = self.plant, self.view
        done = [entry for entry in plant.entries if entry.result is OrderResult.DONE and entry.ended_us is not None]
        seconds = [(entry.ended_us - entry.begun_us) / 1e6 for entry in done if entry.ended_us is not None]
        in_time = [
            s for s, e in zip(seconds, done, strict=True) if not e.demand.within_ms or s * 1000 <= e.demand.within_ms
        ]
        behaviours = [controller.holon.behaviour for controller in self.run.controllers.values()]
        generations = [one.generation for one in behaviours if isinstance(one, ArmRobot)]
        return {
            "goals": len(plant.entries),
            "achieved": len(done),
            "in_time": len(in_time),
            "refused": sum(entry.result is OrderResult.REFUSED for entry in plant.entries),
            "mean_time_s": sum(seconds) / len(seconds) if seconds else 0.0,
            "cost": sum(entry.cost_mm for entry in done) / 1000,
            "hand_overs": len(plant.takes) - len({part for part, _ in plant.takes}),
            "first_cost_over_optimum": _over_optimum(plant),
            "calls_for_goals": view.goal_messages,
            "deepest_level": view.deepest,
            "goals_passed_over": sum(sum(one.passed_over.values()) for one in generations),
            "goals_looked_at": sum(one.looked_at for one in generations),
        }


def _over_optimum(plant: CellPlant) -> float:
    """Cost of the first goal, when all robots were at home, over the exhaustive search's; 0 where there is none."""
    site, entry = plant.site, next(iter(plant.entries), None)
    if entry is None or not entry.cost_mm:
        return 0.0
    homes = {node: arm.home for node, arm in site.arms.items()}
    goal = Goal(Reference(0, 1), Reference(0, 1), entry.demand.start, entry.demand.end)
    best = ContractTree(tuple(site.arms.values()), homes, site.obstacles).solve(goal)
    return entry.cost_mm / 1000 / best.cost if best is not None else 0.0
