"""``bus-sim run cell``: goals come to the counter, robots negotiate, carry and hand over; the outcome is printed."""

import sys
from typing import TYPE_CHECKING, cast

from bus_sim.run import BusRun
from bus_sim.systems.cell.plant import CellPlant, make_plant
from bus_sim.systems.cell.show import plan
from bus_sim.systems.cell.tree import ContractTree
from bus_sim.systems.cell.view import CellView
from bus_sim.systems.session import Played, SystemPlant, conclude, play
from onboard.core.messages import Reference
from onboard.core.site import Site
from onboard.systems.cell.contracts import Goal
from onboard.systems.cell.messages import OrderResult
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.cell.site import Cell

if TYPE_CHECKING:
    from bus_sim.systems.registry import SystemOptions


def run_cell(site: Site, options: "SystemOptions") -> int:
    """Run a cell to its end, print the paper's text for each goal and the indicators; the exit status."""
    assert isinstance(site, Cell)
    if not options.quiet:
        sys.stdout.write(f"site {site.name}, seed {options.seed}, {len(site.wishes)} goals\n")
    view = CellView(site)

    def prepare(run: BusRun) -> None:
        run.observers.append(lambda message, _: view.feed(message))

    def picture(_: BusRun, plant: SystemPlant) -> str:
        return plan(cast("CellPlant", plant), view)

    played = play(site, options, make_plant, picture, prepare)
    plant = cast("CellPlant", played.plant)
    if not options.quiet:
        for node, counter in plant.counters.items():
            for entry in counter.entries:
                sys.stdout.write(f"\nGoal {entry.number}\n{view.text(Reference(node, entry.number))}")
        sys.stdout.write("\n" + plan(plant, view) + "\n\n")
    return conclude(played, site, options, figures(played, site, view), options.quiet)


def figures(played: Played, site: Cell, view: CellView) -> dict[str, object]:
    """What a cell is judged by: goals, time to achieve them, cost beside the exhaustive optimum, goal messages."""
    plant = cast("CellPlant", played.plant)
    done = [entry for entry in plant.entries if entry.result is OrderResult.DONE and entry.ended_us is not None]
    seconds = [(entry.ended_us - entry.begun_us) / 1e6 for entry in done if entry.ended_us is not None]
    in_time = [s for s, e in zip(seconds, done, strict=True) if not e.wish.within_ms or s * 1000 <= e.wish.within_ms]
    robots = [one for one in _behaviours(played) if isinstance(one, ArmRobot)]
    generations = [one.generation for one in robots]
    return {
        "goals": len(plant.entries),
        "achieved": len(done),
        "in_time": len(in_time),
        "refused": sum(entry.result is OrderResult.REFUSED for entry in plant.entries),
        "mean_time_s": sum(seconds) / len(seconds) if seconds else 0.0,
        "cost": sum(entry.cost_mm for entry in done) / 1000,
        "hand_overs": len(plant.takes) - len({part for part, _ in plant.takes}),
        "first_cost_over_optimum": _over_optimum(site, plant),
        "calls_for_goals": view.goal_messages,
        "deepest_level": view.deepest,
        "goals_passed_over": sum(sum(one.passed_over.values()) for one in generations),
        "goals_looked_at": sum(one.looked_at for one in generations),
    }


def _behaviours(played: Played) -> list[object]:
    return [controller.holon.behaviour for controller in played.run.controllers.values()]


def _over_optimum(site: Cell, plant: CellPlant) -> float:
    """Cost of the first goal, when all robots were at home, over the exhaustive search's; 0 where there is none."""
    entry = next(iter(plant.entries), None)
    if entry is None or not entry.cost_mm:
        return 0.0
    homes = {node: arm.home for node, arm in site.arms.items()}
    goal = Goal(Reference(0, 1), Reference(0, 1), entry.wish.start, entry.wish.end)
    best = ContractTree(tuple(site.arms.values()), homes, site.obstacles).solve(goal)
    return entry.cost_mm / 1000 / best.cost if best is not None else 0.0
