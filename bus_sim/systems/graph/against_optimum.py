"""Time until the last robot has come to its goal, on the bus, over the exact optimum: cases drawn by chance."""

from dataclasses import dataclass, replace
from statistics import fmean

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.systems.graph.certify.optimum import least_steps, some_tasks
from bus_sim.systems.graph.certify.search import TaskSet
from bus_sim.systems.graph.plant import GraphPlant
from onboard.contract.codes import KindCode, Side
from onboard.core.site import Machine, Segment, Station
from onboard.systems.graph.network import Graph
from onboard.systems.graph.site import FactoryGraph, VisitOrder

#: Node-ID of the first robot of a case.
FIRST_ROBOT = 101


@dataclass(frozen=True)
class Ratios:
    """Makespan over optimum of each case, 1 at best."""

    robots: int
    ratios: tuple[float, ...]

    def line(self) -> str:
        """One row of the table."""
        return f"{self.robots:6}  {len(self.ratios):5}  {fmean(self.ratios):6.3f}  {max(self.ratios):6.3f}"


def case_site(site: FactoryGraph, graph: Graph, tasks: TaskSet) -> FactoryGraph:
    """A site with the machines of ``site`` but for its robots, on another graph, with one order for each robot."""
    robots = {}
    for number, start in enumerate(tasks.starts):
        node = FIRST_ROBOT + number
        home = Station(start, 1, Side.NEAR)
        robots[node] = Machine(node, f"R{number + 1}", KindCode.VEHICLE, Segment(start, 1), home)
    others = {node: one for node, one in site.machines.items() if one.kind is not KindCode.VEHICLE}
    known = [node for node, one in others.items() if one.kind is KindCode.NODE]
    hosts = {node: known[number % len(known)] for number, node in enumerate(graph.nodes)}
    return replace(
        site,
        machines=dict(sorted((others | robots).items())),
        edges=tuple((*ends, length) for ends, length in sorted(graph.lengths_mm.items())),
        hosts=hosts,
        stewards=hosts,
        orders=tuple(VisitOrder(0, node, (goal,)) for node, goal in zip(robots, tasks.goals, strict=True)),
    )


def ratio(site: FactoryGraph, graph: Graph, tasks: TaskSet) -> float:
    """One case, from the first departure to the last arrival. All edges are of one length."""
    best = least_steps(graph, tasks)
    played = play(case_site(site, graph, tasks), RunOptions(limit_s=900, quiet=True))
    if best is None or not played.is_good:
        raise RuntimeError(f"{tasks}: {played.plant.violations or 'not over'}")
    plant: GraphPlant = played.plant
    bodies = plant.bodies.values()
    begin_us = min(body.stays[0][2] for body in bodies)
    end_us = max(body.since_us for body in bodies)
    step_us = max(graph.lengths_mm.values()) * 1_000_000 / site.speed_mm_s
    return (end_us - begin_us) / (best * step_us)


def compare(site: FactoryGraph, graph: Graph, robots: int, cases: int, seed: int = 1) -> Ratios:
    """Some cases with so many robots."""
    return Ratios(robots, tuple(ratio(site, graph, tasks) for tasks in some_tasks(graph, robots, cases, seed)))
