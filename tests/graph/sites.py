"""Graph sites made for tests."""

import random
from collections.abc import Sequence
from typing import Any

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.systems.stage import SystemStage
from onboard.config.site import parse_site
from onboard.systems.graph.network import Graph, grid
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph

#: (after s, robot or "any", nodes).
Wanted = tuple[int, str, tuple[int, ...]]


def site_text(
    graph: Graph, homes: tuple[int, ...], orders: Sequence[Wanted], rules: Rules, capacity: int = 4, hosts: int = 2
) -> str:
    """A site file: ``hosts`` machines share the nodes, robots R1, R2, ... stand in ``homes`` at first."""
    edges = ", ".join(f"[{one}, {other}, {length}]" for (one, other), length in sorted(graph.lengths_mm.items()))
    text = f'[site]\nsystem = "graph"\nname = "made"\n\n[graph]\nrules = "{rules.value}"\ncapacity = {capacity}\n'
    text += f"load_ms = 2000\nedges = [{edges}]\n\n"
    for host in range(hosts):
        nodes = [node for node in graph.nodes if node % hosts == host]
        text += f'[[hosts]]\nname = "H{host + 1}"\nnode = {host + 1}\nnodes = {nodes}\n\n'
    text += '[[desks]]\nname = "D"\nnode = 9\n\n'
    for number, home in enumerate(homes, start=1):
        text += f'[[robots]]\nname = "R{number}"\nnode = {20 + number}\nat = {home}\n\n'
    for at_s, robot, stops in orders:
        text += f'[[orders]]\nat_s = {at_s}\nrobot = "{robot}"\nvisit = {list(stops)}\n\n'
    return text


def made(
    graph: Graph,
    homes: tuple[int, ...],
    orders: Sequence[Wanted],
    rules: Rules = Rules.EDGE_AND_NODE,
    capacity: int = 4,
) -> FactoryGraph:
    """The site of such a file."""
    site = parse_site(site_text(graph, homes, orders, rules, capacity), "made.toml")
    assert isinstance(site, FactoryGraph)
    return site


def busy_orders(graph: Graph, count: int, seed: int, every_s: int = 4) -> list[Wanted]:
    """Transports for any robot, closer together than they can be done."""
    chance = random.Random(seed)
    return [(every_s * number, "any", tuple(chance.sample(graph.nodes, 2))) for number in range(count)]


def hall(length_mm: int = 6000) -> Graph:
    """A grid of nine nodes."""
    return grid(3, 3, length_mm)


def played(site: FactoryGraph, **options: object) -> SystemStage[Any]:
    """A run to its end, quiet and without a trace."""
    return play(site, RunOptions(quiet=True, **options))  # type: ignore[arg-type]  # options by name
