"""The site file of a manufacturing cell; docs/cell.md describes every key."""

from collections.abc import Sequence
from dataclasses import replace

from onboard.config.fleet import FleetReader
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.core.site import Segment
from onboard.systems.cell.site import MAX_COORDINATE_MM, Area, Arm, Cell, GoalDemand, Point

_NOWHERE = Segment(0, 0)
#: A call for a goal holds calls within calls: a chain of eight robots takes this long, each level with this share of
#: what is left to the one above (the last has 0.5 s).
CALL_WINDOW_MS, SUB_CALL_PERCENT = 3_000, 80


def read(root: TomlTable, common: Common) -> Cell:
    """Robots with their areas, goal managers, obstacles, and the goals that a run of the site brings."""
    fleet = FleetReader()
    arms: dict[int, Arm] = {}
    obstacles = tuple(
        area
        for table in root.tables("obstacles")
        if table.text("name") and (area := _area(table, "area_mm")) is not None
    )
    for table in root.tables("robots"):
        _read_robot(table, fleet, arms, obstacles)
    for table in root.tables("desks"):
        fleet.add(table, KindCode.DESK, _NOWHERE)
    for name, words in (("robots", "robot"), ("desks", "goal manager")):
        if not root.values.get(name):
            root.bad(name, None, f"no {words}", f"add at least one [[{name}]] table")
    goals = tuple(goal for table in root.tables("goals") if (goal := _goal_demand(table, arms, obstacles)) is not None)
    timing_table = root.table("timing")
    timing_table.values.setdefault("call_window_ms", CALL_WINDOW_MS)
    timing = read_timing(timing_table, max(1, len(arms)), len(fleet.by_node), common.bitrate)
    percent = root.table("negotiation").integer("sub_call_percent", 20, 80, SUB_CALL_PERCENT)
    return Cell(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        machines=dict(sorted(fleet.by_node.items())),
        timing=replace(timing, sub_call_percent=percent),
        arms=arms,
        obstacles=obstacles,
        goals=goals,
    )


def _read_robot(table: TomlTable, fleet: FleetReader, arms: dict[int, Arm], obstacles: Sequence[Area]) -> None:
    area, home = _area(table, "area_mm"), _point(table, "home_mm")
    unit_cost = table.number("unit_cost", 0.001, 1_000, 1.0)
    speed_mm_s = table.integer("speed_mm_s", 10, 10_000, 1_000)
    if area is not None and home is not None:
        if not area.contains(home):
            table.bad("home_mm", list(home), "outside area_mm", "let the robot stand in its own area")
        elif any(one.hides(home) for one in obstacles):
            table.bad("home_mm", list(home), "inside an obstacle", "move it, or the obstacle")
    before = len(fleet.by_node)
    fleet.add(table, KindCode.ARM, _NOWHERE)
    if len(fleet.by_node) > before and area is not None and home is not None:
        node = table.values["node"]
        arms[node] = Arm(node, table.values["name"], area, home, unit_cost, speed_mm_s)


def _goal_demand(table: TomlTable, arms: dict[int, Arm], obstacles: Sequence[Area]) -> GoalDemand | None:
    start, end = _point(table, "from_mm"), _point(table, "to_mm")
    at_ms, within_s = table.integer("at_s", 0, 86_400, 0) * 1000, table.integer("within_s", 0, 2_550, 0)
    if within_s % 10:
        table.bad("within_s", within_s, "not in steps of 10 s", "round it to 10 s")
    if start is None or end is None:
        return None
    if start == end:
        table.bad("to_mm", list(end), "where the part lies already", "write another place")
    for name, place in (("from_mm", start), ("to_mm", end)):
        if any(one.hides(place) for one in obstacles):
            table.bad(name, list(place), "inside an obstacle", "write a place that a robot can reach")
        elif not any(arm.area.contains(place) for arm in arms.values()):
            table.bad(name, list(place), "in no robot's area", "write a place that a robot can reach")
    return GoalDemand(at_ms, start, end, within_s * 1000)


def _point(table: TomlTable, name: str) -> Point | None:
    numbers = _numbers(table, name, 2, "[x, y]")
    return Point(*numbers) if numbers is not None else None


def _area(table: TomlTable, name: str) -> Area | None:
    numbers = _numbers(table, name, 4, "[x0, y0, x1, y1]")
    if numbers is None:
        return None
    area = Area(*numbers)
    if area.x0_mm >= area.x1_mm or area.y0_mm >= area.y1_mm:
        table.bad(name, numbers, "not a rectangle", "write [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
        return None
    return area


def _numbers(table: TomlTable, name: str, count: int, form: str) -> list[int] | None:
    """``count`` whole numbers of mm, each within the largest coordinate; None where there is a mistake."""
    values = table.items(name, form)
    words = f"write {form}, {count} whole numbers of mm from {-MAX_COORDINATE_MM} to {MAX_COORDINATE_MM}"
    if values is None:
        if name not in table.wrong:
            table.bad(name, None, "missing", words)
        return None
    good = len(values) == count and all(type(one) is int and abs(one) <= MAX_COORDINATE_MM for one in values)
    if not good:
        table.bad(name, values, "not a place" if count == 2 else "not a rectangle", words)
        return None
    return values
