"""The graph in a terminal: every node with the robots in it, every edge with the robot on it, and the orders."""

from bus_sim.systems.graph.plant import GraphPlant
from onboard.contract.graph import BodyPlace

#: Characters of an edge.
WIDTH = 24


def picture(plant: GraphPlant) -> str:
    """One line a node, one an edge, one an order."""
    site, now_us = plant.site, plant.timers.now_us()
    lines = []
    for node in site.graph.nodes:
        inside = [one.machine.name for one in plant.bodies.values() if _is_in(one.place, one.node, node)]
        lines.append(f"N{node:<3} [{' '.join(inside):12}]")
    on_edges = {body.edge: body for body in plant.bodies.values() if body.edge is not None}
    for one, other in sorted(site.graph.lengths_mm):
        body, line = on_edges.get((one, other)), "-" * WIDTH
        if body is not None:
            share = body.offset_mm(now_us) / body.length_mm
            at = round((share if body.behind == one else 1 - share) * (WIDTH - len(body.machine.name) - 1))
            name = f"{body.machine.name}>" if body.behind == one else f"<{body.machine.name}"
            line = line[:at] + name + line[at + len(name) :]
        lines.append(f"N{one:<3} {line} N{other}")
    for entry in plant.entries:
        word = entry.result.name.lower().replace("_", " ") if entry.result is not None else "at the counter"
        who = site.machines[entry.robot].name if entry.robot else "anybody"
        lines.append(f"order {entry.number}: {who} visits {_ways(entry.order.stops)}: {word}")
    lines.append(f"{now_us / 1e6:8.1f} s")
    return "\n".join(lines)


def _is_in(place: BodyPlace, at: int, node: int) -> bool:
    return place is BodyPlace.IN_NODE and at == node


def _ways(stops: tuple[int, ...]) -> str:
    return ", ".join(f"N{stop}" for stop in stops)
