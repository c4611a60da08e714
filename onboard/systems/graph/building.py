"""A factory graph as a picture: nodes and edges, to scale as far as lengths without places fit a plane."""

from onboard.systems.graph.site import FactoryGraph
from onboard.systems.graph.words import node_name
from onboard.trace.chart.network_plan import PlanPlace, PlanWay, draw_plan, spread
from onboard.trace.chart.svg import SvgDrawing

#: Side of a node as it is drawn, mm; the most px a mm; and the bar that tells the scale, mm.
_NODE_MM, _MOST_SCALE, _BAR_MM = 700.0, 0.03, 5_000.0


def draw(site: FactoryGraph) -> SvgDrawing:
    """The picture of a site; raises nothing that its reader has not."""
    lengths = {ends: float(length_mm) for ends, length_mm in site.graph.lengths_mm.items()}
    spots, off = spread(lengths, site.graph.nodes)
    homes: dict[int, list[str]] = {node: [] for node in site.graph.nodes}
    for robot in site.robots.values():
        homes[robot.home.track].append(robot.name)
    places = {node: PlanPlace(spot, node_name(node), robots=tuple(homes[node])) for node, spot in sorted(spots.items())}
    ways = [PlanWay(*ends, f"{length_mm / 1000:g} m") for ends, length_mm in lengths.items()]
    fits = f"lengths are the file's; as drawn they are off by at most {100 * off:.0f} %, for a file names no places"
    return draw_plan(
        f"{site.name}: nodes and edges from above",
        [fits],
        places,
        ways,
        size=_NODE_MM,
        most_scale=_MOST_SCALE,
        bar=(_BAR_MM, f"{_BAR_MM / 1000:g} m"),
    )
