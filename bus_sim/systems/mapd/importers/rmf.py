"""An Open-RMF building (``.building.yaml`` of the traffic editor) as a network over all floors, its lifts included.

Vertices that lanes use become points, lanes lines. A lift's cabins on all floors are one zone with lines between
floors: one robot rides at a time. All navigation graphs are laid over one another, as the site has one kind of robot.
"""

from dataclasses import dataclass, field
from math import hypot
from pathlib import Path

from bus_sim.systems.mapd.importers.draft import Draft, Loss, draw_tasks, machine_name
from bus_sim.systems.mapd.importers.mapf import DrawnDemand
from bus_sim.systems.mapd.importers.yaml_tree import Value, parse_yaml
from onboard.config.problems import Problems
from onboard.systems.mapd.floor import NetworkLine, network_floor
from onboard.systems.mapd.reader import MAX_STEPS
from onboard.ways.rests import lasting_rests

#: A robot's step, mm, and how long it takes, ms: tinyRobot and deliveryRobot of the demos go at half a metre a second.
STEP_MM, STEP_MS = 1_000, 2_000
#: A lift of the demos rises at one metre a second.
LIFT_MM_S = 1_000
#: What a building holds beside levels and lifts, and why a site has none.
_UNUSED = {"crowd_sim": "people are not simulated", "graphs": "names of graphs; all lanes make one network"}
_UNUSED_ON_LEVEL = {
    "doors": "no door stands in a robot's way",
    "floors": "surfaces are not needed",
    "models": "furniture is not needed: robots keep to lanes",
    "walls": "robots keep to lanes",
    "drawing": "a picture",
}
_UNUSED_AT_VERTEX = {"is_charger": "robots do not run empty", "is_cleaning_zone": "a task is pick-up and delivery"}


@dataclass
class Level:
    """One floor: its vertices that lanes use, by number, as names of points; height and scale in mm."""

    name: str
    elevation_mm: float
    mm_a_pixel: float
    points: dict[int, str] = field(default_factory=dict)
    at_mm: dict[int, tuple[float, float]] = field(default_factory=dict)


def import_building(path: Path, text: str, wanted: DrawnDemand) -> Draft:
    """A site of a building. Raises ``ConfigError`` with every mistake."""
    problems = Problems(str(path))
    root = parse_yaml(text, problems)
    if not problems.found and not root.get("levels").items():
        problems.add(root.line, "levels", None, "no levels", "give a .building.yaml of the traffic editor")
    problems.raise_if_any()
    name = root.get("name").of
    draft = Draft(machine_name(str(name or path.stem), ()), [path.name], step_ms=STEP_MS)
    reader = _RmfReader(draft, problems)
    for level, value in root.get("levels").items():
        reader.read_level(level, value)
    for lift, value in root.get("lifts").items():
        reader.join_lift(lift, value)
    problems.raise_if_any()
    reader.choose(root, wanted)
    problems.raise_if_any()
    draft.tasks = draw_tasks(draft.endpoints, wanted.tasks, wanted.every, wanted.seed)
    draft.meanings.append(f"A building holds no tasks: drawn between its named places with seed {wanted.seed}.")
    draft.losses += [Loss(key, why) for key, why in _UNUSED.items() if root.get(key).of is not None]
    return draft


class _RmfReader:
    def __init__(self, draft: Draft, problems: Problems) -> None:
        self.draft, self.problems = draft, problems
        self.levels: dict[str, Level] = {}
        self.cabins: dict[str, list[tuple[Level, int]]] = {}
        self.robots: list[tuple[str, str]] = []
        self.parking: list[str] = []
        self.places: list[str] = []

    # --- one floor ---------------------------------------------------------------------------------------------

    def read_level(self, name: str, value: Value) -> None:
        vertices = [self._vertex(name, one) for one in value.get("vertices").values()]
        if not self.levels or not self.problems.found:
            level = Level(name, 1000 * (value.get("elevation").number() or 0.0), self._scale(name, value, vertices))
            self.levels[name] = level
            for lane in value.get("lanes").values():
                self._lane(level, lane, vertices)
        for key, why in _UNUSED_ON_LEVEL.items():
            if value.get(key).of:
                self.draft.losses.append(Loss(f"{key} of level {name}", why))

    def _vertex(self, level: str, value: Value) -> tuple[float, float, str, Value]:
        fields = value.values()
        numbers = [one.number() for one in fields[:2]]
        if len(fields) < 2 or numbers[0] is None or numbers[1] is None:
            self._bad(value, f"levels.{level}.vertices", "not a vertex", "write [x, y, z, name]")
            return 0.0, 0.0, "", value
        name = fields[3].of if len(fields) > 3 else ""
        return numbers[0], numbers[1], str(name or ""), fields[4] if len(fields) > 4 else Value({}, value.line)

    def _scale(self, name: str, value: Value, vertices: list[tuple[float, float, str, Value]]) -> float:
        """Millimetres a pixel, from the first measurement (traffic editor: two vertices, and the metres between)."""
        for one in value.get("measurements").values():
            ends = [self._number(end, len(vertices)) for end in one.values()[:2]]
            metres = one.values()[2].get("distance").values() if len(one.values()) > 2 else []
            length = metres[1].number() if len(metres) > 1 else None
            if None not in ends and len(ends) == 2 and length:
                first, second = (vertices[end] for end in ends if end is not None)
                pixels = hypot(first[0] - second[0], first[1] - second[1])
                if pixels > 0 and length > 0:
                    return 1000 * length / pixels
        self._bad(value, f"levels.{name}.measurements", "no usable measurement", "measure one length in the editor")
        return 1.0

    def _number(self, value: Value, count: int) -> int | None:
        number = value.of
        return number if type(number) is int and 0 <= number < count else None

    def _lane(self, level: Level, lane: Value, vertices: list[tuple[float, float, str, Value]]) -> None:
        ends = [self._number(one, len(vertices)) for one in lane.values()[:2]]
        if len(ends) != 2 or None in ends or ends[0] == ends[1]:
            words = f"write two different vertices from 0 to {len(vertices) - 1}"
            self._bad(lane, f"levels.{level.name}.lanes", "not a lane", words)
            return
        start, end = (self._point(level, one, vertices[one]) for one in ends if one is not None)
        both = lane.values()[2].get("bidirectional").values() if len(lane.values()) > 2 else []
        one_way = not (len(both) > 1 and both[1].of is True)
        (x, y), (x2, y2) = (level.at_mm[one] for one in ends if one is not None)
        self._add_line(lane, NetworkLine(start, end, max(1, round(hypot(x - x2, y - y2) / STEP_MM)), one_way))

    def _add_line(self, at: Value, line: NetworkLine) -> None:
        if line.steps > MAX_STEPS:
            self._bad(at, "lane", f"{line.steps} steps long", "cut it in two")
            return
        known = {(one.start, one.end): one for one in self.draft.lines}
        back = known.get((line.end, line.start))
        if (line.start, line.end) not in known and back is None:
            self.draft.lines.append(line)
        elif back is not None and back.one_way:
            # The other way of one that went one way only makes it go both ways.
            self.draft.lines[self.draft.lines.index(back)] = NetworkLine(back.start, back.end, back.steps)

    def _point(self, level: Level, number: int, vertex: tuple[float, float, str, Value]) -> str:
        if number in level.points:
            return level.points[number]
        x, y, name, about = vertex
        point = f"{level.name}/{name or number}".replace(">", "_")
        if point in self.draft.points:
            point = f"{point}_{number}"
        level.points[number] = point
        level.at_mm[number] = (x * level.mm_a_pixel, y * level.mm_a_pixel)
        self.draft.points.append(point)
        self._about(level, number, point, name, about)
        return point

    def _about(self, level: Level, number: int, point: str, name: str, about: Value) -> None:
        """What the vertex is for."""
        words = {key: value.values()[1].of for key, value in about.items() if len(value.values()) > 1}
        if lift := words.get("lift_cabin"):
            self.cabins.setdefault(str(lift), []).append((level, number))
        elif words.get("is_parking_spot") or words.get("is_charger"):
            self.parking.append(point)
        elif name:
            self.places.append(point)
        if robot := words.get("spawn_robot_name"):
            self.robots.append((str(robot), point))
            kind = words.get("spawn_robot_type", "no type")
            self.draft.losses.append(Loss(f"type {kind} of robot {robot}", "all robots of the site are alike"))
        for key, why in _UNUSED_AT_VERTEX.items():
            if words.get(key):
                self.draft.losses.append(Loss(f"{key} at {point}", why))

    # --- all floors --------------------------------------------------------------------------------------------

    def join_lift(self, lift: str, value: Value) -> None:
        """Lines between a lift's cabins, floor by floor; all of it is one zone."""
        cabins = sorted(self.cabins.get(lift, []), key=lambda one: one[0].elevation_mm)
        if len(cabins) < 2:
            self.draft.losses.append(Loss(f"lift {lift}", f"lanes lead into its cabin on {len(cabins)} levels"))
            return
        names = [level.points[number] for level, number in cabins]
        zone = list(names)
        for (low, _), (high, _), start, end in zip(cabins, cabins[1:], names, names[1:], strict=False):
            steps = max(1, round((high.elevation_mm - low.elevation_mm) / LIFT_MM_S * 1000 / STEP_MS))
            self._add_line(value, NetworkLine(start, end, steps))
            if steps > 1:
                zone.append(f"{start}>{end}")
        self.draft.zones.append(zone)
        self.draft.meanings.append(f"Lift {lift}: {', '.join(names)}; one robot at a time")
        self.draft.losses.append(Loss(f"empty travel and doors of lift {lift}", "the cabin is where one boards"))

    def choose(self, root: Value, wanted: DrawnDemand) -> None:
        """Robots where the building puts them, endpoints at named places; what cannot be reached is left out."""
        if len(self.robots[: wanted.robots]) == 0 or not self.draft.lines:
            self._bad(root, "levels", "no robot (spawn_robot_name) or no lane", "add a robot's charger and its lanes")
            return
        floor = network_floor(self.draft.points, self.draft.lines, self.draft.zones)
        number = {name: cell for cell, name in enumerate(floor.names)}
        robots = self.robots[: wanted.robots]
        reach = floor.steps_to(number[robots[0][1]])
        back = {name: floor.steps_to(number[name])[number[robots[0][1]]] for name in self.draft.points}
        linked = {name for name in self.draft.points if max(reach[number[name]], back[name]) < len(floor.names)}
        for name in [one for one in [*self.places, *self.parking] if one not in linked]:
            self.draft.losses.append(Loss(f"place {name}", "no lane or lift leads there"))
        self.draft.endpoints = [one for one in self.places if one in linked]
        if len(self.draft.endpoints) < 2:
            self._bad(root, "levels", "fewer than two named places on the lanes", "name the vertices where tasks begin")
            return
        ends = [number[one] for one in self.draft.endpoints]
        for robot, home in robots:
            at = [*(number[one] for _, one in self.draft.robots), number[home]]
            if home not in linked or len(lasting_rests(floor.network, at, ends)) < len(at):
                self.draft.losses.append(Loss(f"robot {robot} at {home}", "it would shut others in, or be shut in"))
                continue
            fit = machine_name(robot, [one for one, _ in self.draft.robots])
            self.draft.robots.append((fit, home))
        if not self.draft.robots:
            self._bad(root, "levels", "no robot with a home that shuts nobody in", "add chargers beside the ways")

    def _bad(self, value: Value, key: str, what: str, remedy: str) -> None:
        self.problems.add(value.line, key, None, what, remedy)
