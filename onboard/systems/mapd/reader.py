"""The site file of a pick-up and delivery site; docs/import.md describes every key."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

from onboard.config.fleet import FleetReader
from onboard.config.problems import nearest
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.core.site import Segment
from onboard.systems.mapd.fields import MOST_WAYS
from onboard.systems.mapd.site import (
    FREE,
    Floor,
    Mapd,
    NetworkLine,
    TransportTask,
    cell_station,
    grid_floor,
    network_floor,
)
from onboard.ways.rests import lasting_rests

_NOWHERE = Segment(0, 0)
#: A cell's token is that of a station, of which there are so many (kinds/mapd/rights.py).
MAX_CELLS = 64_000
#: Longest line of a network, steps.
MAX_STEPS = 1_000
#: Step of the latest release: with steps of a second more than a day.
MAX_RELEASE = 100_000
BLOCKED = "@TO#W"


def read(root: TomlTable, common: Common) -> Mapd:
    """Floor, robots with their homes, desk, endpoints and the tasks that a run of the site brings."""
    step_ms = root.table("steps").integer("step_ms", 100, 60_000, 1_000)
    rows, (points, lines, zones) = _read_floor(root)
    floor: Floor | None = None
    if root.problems.none_in("map|network"):
        floor = grid_floor(rows) if rows else network_floor(points, lines, zones)
        if floor.size > MAX_CELLS:
            root.bad("map" if rows else "network", floor.size, "too many cells", f"have at most {MAX_CELLS}")
            floor = None
        elif max(map(len, floor.ways)) > MOST_WAYS:
            crowded = max(range(floor.size), key=lambda cell: len(floor.ways[cell]))
            what = f"{len(floor.ways[crowded])} ways lead from it"
            root.bad("network", floor.names[crowded], what, f"have at most {MOST_WAYS}, by a point beside it")
    cells = {} if floor is None else {name: cell for cell, name in enumerate(floor.names) if _open(floor, cell)}
    fleet, homes = _read_machines(root, cells if floor is not None else None, floor)
    demand = root.table("demand")
    endpoints = _read_endpoints(demand, cells if floor is not None else None)
    tasks = _read_tasks(demand, cells if floor is not None else None, endpoints)
    if floor is not None and homes and endpoints and root.problems.none_in("map|network"):
        _check_ways(root, demand, floor, homes, endpoints)
    timing = read_timing(root.table("timing"), max(1, len(homes)), max(1, len(fleet.by_node)), common.bitrate)
    return Mapd(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        machines=dict(sorted(fleet.by_node.items())),
        timing=timing,
        stewards=_stewards(fleet, floor),
        rows=rows,
        points=points,
        lines=lines,
        zones=zones,
        homes=dict(sorted(homes.items())),
        endpoints=endpoints,
        tasks=tasks,
        step_ms=step_ms,
    )


def _stewards(fleet: FleetReader, floor: Floor | None) -> dict[int, int]:
    """The desk has the rights to all cells but the robots' first ones, until somebody asks for them."""
    desks = [node for node, one in fleet.by_node.items() if one.kind is KindCode.DESK]
    if floor is None or not desks:
        return {}
    return dict.fromkeys(range(1, cell_station(floor.size - 1).track + 1), desks[0])


def _open(floor: Floor, cell: int) -> bool:
    return bool(floor.ways[cell] or floor.network.back[cell])


_Network = tuple[tuple[str, ...], tuple[NetworkLine, ...], tuple[tuple[str, ...], ...]]


def _read_floor(root: TomlTable) -> tuple[tuple[str, ...], _Network]:
    if root.has("map") == root.has("network"):
        root.bad("map", None, "neither or both of [map] and [network]", "give the floor as one of them")
        return (), ((), (), ())
    if root.has("map"):
        return _read_rows(root.table("map")), ((), (), ())
    return (), _read_network(root.table("network"))


def _read_rows(table: TomlTable) -> tuple[str, ...]:
    rows = table.items("rows", "a list of texts, one a row")
    if not rows:
        table.bad("rows", rows, "no rows", "write the map, one text a row")
        return ()
    width = usual_width(rows)
    for number, row in enumerate(rows):
        if not isinstance(row, str) or not row:
            table.bad("rows", row, "not a row", "write a text of cells", item=number)
        elif len(row) != width:
            table.bad("rows", row, f"{len(row)} cells", f"write {width}, as in other rows", item=number)
        elif odd := sorted({*row} - FREE - {*BLOCKED}):
            words = f"write . e r S G for free cells, {' '.join(BLOCKED)} for blocked ones"
            table.bad("rows", odd[0], "unknown cell", words, item=number)
    return tuple(rows)


def usual_width(rows: Sequence[object]) -> int:
    """How many cells most rows of a map have, of as many the first; 0 where none is a text."""
    widths = Counter(len(row) for row in rows if isinstance(row, str))
    return max(widths, key=widths.__getitem__, default=0)


def _read_network(table: TomlTable) -> _Network:
    points = _names(table, "points", [])
    if not points:
        table.bad("points", None, "no points", "name at least two")
    lines = [one for number, value in enumerate(_items(table, "lines")) if (one := _line(table, number, value, points))]
    known = [*points, *(f"{line.start}>{line.end}" for line in lines)]
    zones = []
    for number, value in enumerate(_items(table, "zones")):
        if not isinstance(value, list) or not value or any(name not in known for name in value):
            table.bad("zones", value, "not a list of points and lines", 'write names like "A" and "A>B"', item=number)
        else:
            zones.append(tuple(value))
    return tuple(points), tuple(lines), tuple(zones)


def _line(table: TomlTable, number: int, value: Any, points: list[str]) -> NetworkLine | None:
    form = f'write ["start", "end", steps] or ["start", "end", steps, "one-way"], steps 1 to {MAX_STEPS}'
    if not isinstance(value, list) or len(value) not in (3, 4) or type(value[2]) is not int:
        table.bad("lines", value, "not a line", form, item=number)
        return None
    for name in value[:2]:
        if name not in points:
            table.bad("lines", name, "no point of the network", nearest(str(name), points), item=number)
            return None
    if not 1 <= value[2] <= MAX_STEPS or value[3:] not in ([], ["one-way"]) or value[0] == value[1]:
        table.bad("lines", value, "not a line", form, item=number)
        return None
    return NetworkLine(value[0], value[1], value[2], one_way=len(value) == 4)


def _items(table: TomlTable, name: str) -> list[Any]:
    return table.items(name, "a list") or []


def _names(table: TomlTable, key: str, found: list[str]) -> list[str]:
    for number, name in enumerate(_items(table, key)):
        if not isinstance(name, str) or not name or ">" in name:
            table.bad(key, name, "not a name", "write a text without >", item=number)
        elif name in found:
            table.bad(key, name, "named twice", "write each once", item=number)
        else:
            found.append(name)
    return found


def _read_machines(
    root: TomlTable, cells: dict[str, int] | None, floor: Floor | None
) -> tuple[FleetReader, dict[int, int]]:
    fleet = FleetReader()
    homes: dict[int, int] = {}
    for table in root.tables("desks"):
        fleet.add(table, KindCode.DESK, _NOWHERE)
    for table in root.tables("robots"):
        name = table.text("home")
        cell = _cell(table, "home", name, cells)
        if cell is not None and cell in homes.values():
            table.bad("home", name, "another robot's home", "give each robot a home of its own")
        # The right to its first cell is the robot's own from the beginning.
        own = None if cell is None or floor is None else cell_station(floor.resources[cell])
        robot = fleet.add(table, KindCode.VEHICLE, _NOWHERE, own)
        if cell is not None:
            homes[robot.node_id] = cell
    for key, words in (("robots", "robot"), ("desks", "order desk")):
        if not root.values.get(key):
            root.bad(key, None, f"no {words}", f"add at least one [[{key}]] table")
    if sum(one.kind is KindCode.DESK for one in fleet.by_node.values()) > 1:
        root.bad("desks", len(root.values["desks"]), "more than one desk", "keep one: it opens every step")
    return fleet, homes


def _cell(table: TomlTable, key: str, name: Any, cells: dict[str, int] | None, item: int | None = None) -> int | None:
    """The free cell of a name; None, noted, where there is none, and None where the floor is not known."""
    if cells is None or key in table.wrong:
        return None
    cell = cells.get(name) if isinstance(name, str) else None
    if cell is None:
        table.bad(key, name, "no free cell of the floor", 'write "row,column" from 0, or a point\'s name', item=item)
    return cell


def _read_endpoints(demand: TomlTable, cells: dict[str, int] | None) -> tuple[int, ...]:
    found: list[int] = []
    for number, name in enumerate(_items(demand, "endpoints")):
        cell = _cell(demand, "endpoints", name, cells, number)
        if cell in found:
            demand.bad("endpoints", name, "named twice", "write each once", item=number)
        elif cell is not None:
            found.append(cell)
    if not found and cells is not None and "endpoints" not in demand.wrong:
        demand.bad("endpoints", None, "no endpoints", "name the cells where tasks begin and end")
    return tuple(found)


def _read_tasks(
    demand: TomlTable, cells: dict[str, int] | None, endpoints: tuple[int, ...]
) -> tuple[TransportTask, ...]:
    form = f'write [release step from 0 to {MAX_RELEASE}, "from", "to"], both endpoints'
    tasks = []
    # Where one of them is mistaken, any cell may be meant to be one.
    known = {*endpoints, *(cells or {}).values()} if "endpoints" in demand.wrong else set(endpoints)
    for number, value in enumerate(_items(demand, "tasks")):
        good = isinstance(value, list) and len(value) == 3 and type(value[0]) is int and 0 <= value[0] <= MAX_RELEASE
        if not good:
            demand.bad("tasks", value, "not a task", form, item=number)
        elif cells is not None:
            start, end = (cells.get(name) if isinstance(name, str) else None for name in value[1:])
            if start is not None and end is not None and {start, end} <= known:
                tasks.append(TransportTask(number, value[0], start, end))
            elif not all(name in _items(demand, "endpoints") for name in value[1:]):
                # An endpoint that is mistaken is told there.
                demand.bad("tasks", value, "not between endpoints", form, item=number)
    return tuple(tasks)


def _check_ways(
    root: TomlTable, demand: TomlTable, floor: Floor, homes: dict[int, int], endpoints: tuple[int, ...]
) -> None:
    """That all robots but one may stay at home for ever and the last one still gets everywhere."""
    first = next(iter(homes.values()))
    ground = floor.network.ground((first,))
    what = f"no way from and to {floor.names[first]}"
    # A list: what is written may be anything, a table too.
    cut_off = [floor.names[cell] for cell in (*endpoints, *homes.values()) if cell not in ground]
    for number, name in enumerate(demand.values["endpoints"]):
        if name in cut_off:
            demand.bad("endpoints", name, what, "join them", item=number)
    written = [robot.get("home") for robot in root.values["robots"]]
    for number, name in enumerate(written):
        if name in cut_off:
            root.bad("robots", name, what, "join them", item=number)
    if cut_off or not root.problems.none_in("robots|demand", "name|node|tasks"):
        return
    rests = lasting_rests(floor.network, list(homes.values()), endpoints)
    for node, cell in homes.items():
        if cell not in rests:
            what = f"node {node} at home would shut others in"
            remedy = "let it live where nobody must pass, or have fewer robots"
            root.bad("robots", floor.names[cell], what, remedy, item=written.index(floor.names[cell]))
