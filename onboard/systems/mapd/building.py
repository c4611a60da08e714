"""A floor of cells as a picture: a map as it is written, a network as far as steps without places fit a plane."""

from onboard.systems.mapd.site import FREE, Mapd
from onboard.trace.chart.network_plan import PlanPlace, PlanWay, draw_plan, spread
from onboard.trace.chart.svg import SvgDrawing
from onboard.trace.scene.scene import Spot

#: The most px a step, and the bar that tells the scale, steps.
_MOST_SCALE, _BAR = 30.0, 5.0
#: Side of a cell, in steps: of a map, and of a network, between whose cells the ways are to be seen.
_MAP_CELL, _NETWORK_CELL = 0.92, 0.5
_CELL, _ENDPOINT, _REST = "#e4e4e4", "#E69F00", "#56B4E9"


def draw(site: Mapd) -> SvgDrawing:
    """The picture of a site; raises nothing that its reader has not."""
    spots, ways, note = _map(site) if site.rows else _network(site)
    homes = {cell: site.machines[node].name for node, cell in site.homes.items()}
    places = {
        cell: PlanPlace(
            spot,
            site.floor.names[cell] if cell in site.endpoints and not site.rows else "",
            _ENDPOINT if cell in site.endpoints else _REST if cell in site.rests else _CELL,
            (homes[cell],) if cell in homes else (),
        )
        for cell, spot in sorted(spots.items())
    }
    colours = "orange: endpoints; blue: other rests; black: robots at home"
    return draw_plan(
        f"{site.name}: the floor from above",
        [colours, note],
        places,
        ways,
        size=_MAP_CELL if site.rows else _NETWORK_CELL,
        most_scale=_MOST_SCALE,
        bar=(_BAR, f"{_BAR:g} steps"),
    )


def _map(site: Mapd) -> tuple[dict[int, Spot], list[PlanWay], str]:
    wide = len(site.rows[0])
    marks = "".join(site.rows)
    spots = {cell: (float(cell % wide), float(cell // wide)) for cell, mark in enumerate(marks) if mark in FREE}
    return spots, [], "each square is a cell; white is blocked"


def _network(site: Mapd) -> tuple[dict[int, Spot], list[PlanWay], str]:
    steps = site.floor.ways
    ways = [
        PlanWay(one, other, is_one_way=one not in steps[other])
        for one, ahead in enumerate(steps)
        for other in ahead
        if one < other or one not in steps[other]
    ]
    lengths = {(way.start, way.end): 1.0 for way in ways}
    spots, off = spread(lengths, range(site.floor.size))
    return spots, ways, f"each way is one step; as drawn they are off by at most {100 * off:.0f} %"
