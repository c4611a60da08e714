"""Where the areas, crossings and lanes of a terminal are drawn: its file names lengths and connections only."""

from typing import NamedTuple

from onboard.systems.terminal.site import Entity, EntityKind, Terminal
from onboard.trace.scene.arrange import arrange
from onboard.trace.scene.scene import Spot, spot_on

#: Plan units: between two nodes at least, a station's box, an area's rim and the row where vehicles stand.
APART, STATION_WIDTH, STATION_HEIGHT, RIM, BAY = 150.0, 92.0, 30.0, 12.0, 34.0
MARGIN = 40.0
#: An area's name stands above its stations; a vehicle in it is so wide.
NAME, VEHICLE = 24.0, 40.0
#: Stations side by side in an area.
COLUMNS = 2
#: Pieces of a bent line.
PIECES = 24

Corners = tuple[Spot, Spot]


class TerminalChart(NamedTuple):
    """Spots of areas, crossings and lanes; corners of areas and stations; lanes as lines in their direction."""

    spots: dict[int, Spot]
    corners: dict[int, Corners]
    lines: dict[int, list[Spot]]


def chart_of(site: Terminal) -> TerminalChart:
    """The chart of a terminal. A lane has a spot of its own between its ends, so that two lanes lie side by side."""
    spots = _spots(site)
    corners: dict[int, Corners] = {}
    for number in spots:
        if site.entities[number].kind is EntityKind.AREA:
            corners.update(_area(site, number, spots[number]))
    lanes = [one for one in site.entities.values() if one.kind is EntityKind.LANE]
    return TerminalChart(spots, corners, {lane.number: _line(site, lane, spots, corners) for lane in lanes})


def _spots(site: Terminal) -> dict[int, Spot]:
    nodes = [one.number for one in site.entities.values() if one.kind is not EntityKind.STATION]
    half = {one.number: max(1.0, one.length_mm / 2) for one in site.entities.values() if one.kind is EntityKind.LANE}
    usual = 2 * sum(half.values()) / max(1, len(half)) or 1.0
    lengths: dict[tuple[int, int], float] = {}
    for one in site.entities.values():
        for other in one.leads_to:
            if one.number in nodes and other in nodes:
                lengths[one.number, other] = half.get(one.number, 0) + half.get(other, 0) or usual / 2
    pad_x = MARGIN + (COLUMNS * (STATION_WIDTH + RIM) + RIM) / 2
    pad_y = MARGIN + RIM + STATION_HEIGHT + BAY
    return {number: (x + pad_x, y + pad_y) for number, (x, y) in arrange(lengths, nodes, APART).items()}


def _area(site: Terminal, number: int, middle: Spot) -> dict[int, Corners]:
    """Corners of an area around its spot, and of the stations in it."""
    stations = site.stations_in(number)
    columns, rows = max(1, min(COLUMNS, len(stations))), -(-len(stations) // COLUMNS)
    width = max(columns * (STATION_WIDTH + RIM) + RIM, len(site.vehicles) * VEHICLE + RIM)
    height = NAME + rows * (STATION_HEIGHT + RIM) + BAY
    x0, y0 = middle[0] - width / 2, middle[1] - height / 2
    found = {number: ((x0, y0), (x0 + width, y0 + height))}
    for place, station in enumerate(stations):
        x = x0 + RIM + place % COLUMNS * (STATION_WIDTH + RIM)
        y = y0 + NAME + place // COLUMNS * (STATION_HEIGHT + RIM)
        found[station] = ((x, y), (x + STATION_WIDTH, y + STATION_HEIGHT))
    return found


def _line(site: Terminal, lane: Entity, spots: dict[int, Spot], corners: dict[int, Corners]) -> list[Spot]:
    """From where one comes, through the lane's own spot, to where it leads: a parabola, less the areas."""
    before = [one.number for one in site.entities.values() if lane.number in one.leads_to]
    middle = spots[lane.number]
    start = spots[before[0]] if before else middle
    end = spots[lane.leads_to[0]] if lane.leads_to else middle
    bend = (2 * middle[0] - (start[0] + end[0]) / 2, 2 * middle[1] - (start[1] + end[1]) / 2)
    found = []
    for number in range(PIECES + 1):
        t = number / PIECES
        weights = ((1 - t) ** 2, 2 * t * (1 - t), t * t)
        x, y = (sum(w * p[axis] for w, p in zip(weights, (start, bend, end), strict=True)) for axis in (0, 1))
        found.append((x, y))
    ends = [corners[one] for one in (*before[:1], *lane.leads_to[:1]) if one in corners]
    return _outside(found, ends)


def _outside(line: list[Spot], corners: list[Corners]) -> list[Spot]:
    """What of a line is outside the areas that it joins, in as many pieces; all of it where nothing would be left."""
    dense = [spot_on(line, number / (4 * PIECES)) for number in range(4 * PIECES + 1)]
    left = [(x, y) for x, y in dense if not any(x0 <= x <= x1 and y0 <= y <= y1 for (x0, y0), (x1, y1) in corners)]
    return [spot_on(left, number / PIECES) for number in range(PIECES + 1)] if len(left) > 2 else line
