"""The oracle: invariants judged on the ground truth alone, never on anybody's tables, messages or sensors.

It looks after every change of the world, and at whole motions afterwards, so that nothing between two events escapes.
An order that would tear a car counts where it is given, though the drive's interlock refuses it: a run that only an
interlock has saved is no good run. A run with any violation has failed.
"""

from collections.abc import Iterator
from itertools import pairwise

from bus_sim.systems.car_park.plant.bodies import Aboard, Location
from bus_sim.systems.car_park.plant.motion import Motion
from bus_sim.systems.car_park.plant.mouth_rules import MouthRules
from bus_sim.systems.car_park.plant.rules import OVERLAP_TOLERANCE_MM, MotionSpan, PlantRule, PlantViolation
from bus_sim.systems.car_park.plant.shaft_rules import ShaftRules
from bus_sim.systems.car_park.plant.world import BayBody, CarParkWorld, RobotBody, WorldChange
from onboard.contract.codes import DoorName, DoorPosition
from onboard.core.site import Station
from onboard.ways.site import TrackKind


class Oracle:
    """Watches one world; ``violations`` is what it found, each kind at each machine once until it ended."""

    def __init__(self, world: CarParkWorld) -> None:
        self.world = world
        self.violations: list[PlantViolation] = []
        self._spans: dict[int, MotionSpan] = {}
        self._persons: dict[int, int] = {node: bay.persons for node, bay in world.bays.items()}
        self._where: dict[str, Location] = {}
        self.take_stock()
        self._overlapping: set[tuple[int, int]] = set()
        self._present: set[tuple[PlantRule, str]] = set()
        now_us = world.timers.now_us()
        for node_id, robot in world.robots.items():
            self._spans[node_id] = MotionSpan(robot.track, robot.motion, now_us, robot.turning_to)
        self._shafts = ShaftRules(world, self._spans)
        self._mouths = MouthRules(world.site)
        self._has_mouths = bool(world.site.links)
        self._judge_pairs(now_us)
        world.watch(self._on_change)
        world.on_hazard.append(self._once)

    def take_stock(self) -> None:
        """Take the cars as they are now for the stock that the run began with."""
        self._where = dict(self.world.where)

    def report(self, rule: PlantRule, text: str) -> None:
        """Note a violation seen by someone else in the world (a customer before another's car)."""
        self.violations.append(PlantViolation(self.world.timers.now_us(), rule, text))

    def finish(self) -> list[PlantViolation]:
        """Judge the motions up to now and the stock of cars; answers all violations of the run, in order of time."""
        now_us = self.world.timers.now_us()
        self._judge_pairs(now_us)
        self.violations += self._shafts.judge(now_us)
        for node_id in self._spans:
            self._judge_track(node_id, now_us)
        self._judge_cars()
        self.violations.sort(key=lambda violation: violation.time_us)
        return self.violations

    # --- after every change ------------------------------------------------------------------------------------

    def _on_change(self, change: WorldChange, node_id: int, now_us: int) -> None:
        if change in (WorldChange.CARRIER, WorldChange.PLATFORM):
            self.violations += self._shafts.judge(now_us)
        if change is WorldChange.CARRIER:
            self._judge_track(node_id, now_us)
            self._judge_pairs(now_us, node_id)
            robot = self.world.robots[node_id]
            span = self._spans[node_id] = MotionSpan(robot.track, robot.motion, now_us, robot.turning_to)
            self.violations += self._mouths.judge_turn(node_id, span)
        if change is WorldChange.PERSON:
            self._judge_passage(node_id)
        if change is WorldChange.CAR:
            self._judge_cars()
        found = list(self._standing_violations(now_us))
        for rule, text in found:
            if (rule, text) not in self._present:
                self.violations.append(PlantViolation(now_us, rule, text))
        self._present = set(found)

    def _standing_violations(self, now_us: int) -> Iterator[tuple[PlantRule, str]]:
        for node_id, robot in self.world.robots.items():
            yield from self._judge_robot(node_id, robot, now_us)
        for node_id, bay in self.world.bays.items():
            yield from self._judge_bay(node_id, bay)

    def _judge_robot(self, node_id: int, robot: RobotBody, now_us: int) -> Iterator[tuple[PlantRule, str]]:
        if not robot.is_out(now_us):
            return
        if now_us < robot.motion.end_us or robot.turning_to is not None:
            yield PlantRule.SHUTTLE_HOME_TO_MOVE, f"robot {node_id}"
            return
        station = self.world.station_beside(node_id, robot.side)
        if station is None:
            position_mm = robot.motion.at(now_us)[0]
            yield PlantRule.NO_WALL, f"robot {node_id} at {position_mm:.0f} mm, side {robot.side.name}"
            return
        compartment = self.world.bay_at(station)
        if compartment is not None:
            output = self.world.bays[compartment].doors[DoorName.OUTPUT]
            if output is not DoorPosition.OPEN:
                yield PlantRule.BAY_BY_OPEN_DOOR, f"robot {node_id}, compartment {compartment}: {output.name}"
        if self.world.car_aboard(node_id) is not None and self.world.cars_at(station):
            yield PlantRule.ONE_CAR, f"robot {node_id} brings a car into {station}"

    def _judge_bay(self, node_id: int, bay: BayBody) -> Iterator[tuple[PlantRule, str]]:
        inner, outer = bay.doors[DoorName.OUTPUT], bay.doors[DoorName.INPUT]
        if inner is not DoorPosition.LOCKED and outer is not DoorPosition.LOCKED:
            yield PlantRule.ONE_DOOR, f"compartment {node_id}: input {outer.name}, output {inner.name}"
        if bay.persons and inner is not DoorPosition.LOCKED:
            yield PlantRule.NO_PERSON_TO_MACHINES, f"compartment {node_id}"

    def _judge_passage(self, node_id: int) -> None:
        bay = self.world.bays[node_id]
        if bay.doors[DoorName.INPUT] is not DoorPosition.OPEN:
            direction = "enters" if bay.persons > self._persons[node_id] else "leaves"
            position = bay.doors[DoorName.INPUT].name
            self.report(PlantRule.PERSON_BY_OPEN_DOOR, f"{direction} compartment {node_id}: input {position}")
        self._persons[node_id] = bay.persons

    def _judge_cars(self) -> None:
        """Cars move only by a step that exists, and no place, bay or shuttle has two."""
        holders: dict[Station | Aboard, str] = {}
        for name, where in self.world.where.items():
            before = self._where.get(name)
            if where != before and not self._is_a_step(before, where):
                self.report(PlantRule.CARS_CONSERVED, f"{name} from {before or 'outside'} to {where or 'outside'}")
            if where is None:
                continue
            if where in holders:
                self._once(PlantRule.ONE_CAR, f"{name} and {holders[where]} at {where}")
            holders[where] = name
        for name in self._where:
            if name not in self.world.where:
                self._once(PlantRule.CARS_CONSERVED, f"{name} is nowhere")
        self.take_stock()

    def _is_a_step(self, before: Location, after: Location) -> bool:
        """In from the street into a bay, out of a bay to the street, onto or off the shuttle that stands opposite."""
        if before is None or after is None:
            inside = after if before is None else before
            return isinstance(inside, Station) and self.world.bay_at(inside) is not None
        if isinstance(before, Station) and isinstance(after, Aboard):
            return self.world.shuttle_in(before) == after.node_id
        if isinstance(before, Aboard) and isinstance(after, Station):
            return self.world.shuttle_in(after) == before.node_id
        return False

    def _once(self, rule: PlantRule, text: str) -> None:
        self._note_once(PlantViolation(self.world.timers.now_us(), rule, text))

    def _note_once(self, violation: PlantViolation) -> None:
        if not any(v.rule is violation.rule and v.text == violation.text for v in self.violations):
            self.violations.append(violation)

    # --- whole motions, afterwards -----------------------------------------------------------------------------

    def _judge_track(self, node_id: int, now_us: int) -> None:
        """A carrier's centre stays on its segments, and beyond them only in a shaft, or in a mouth."""
        span = self._spans[node_id]
        track = self.world.site.tracks[span.track]
        if track.kind is TrackKind.LIFT:
            return
        low_mm, high_mm = -track.pitch_mm / 2, (track.length - 0.5) * track.pitch_mm
        low_mm -= track.pitch_mm * (track.low is not None)
        high_mm += track.pitch_mm * (track.high is not None)
        for sills in self.world.sills.values():
            if span.track in sills:
                far_mm = sills[span.track].centre_mm + sills[span.track].towards * track.pitch_mm / 2
                low_mm, high_mm = min(low_mm, far_mm), max(high_mm, far_mm)
        lowest_mm, highest_mm = span.motion.extremes_mm(span.from_us, now_us)
        if lowest_mm < low_mm or highest_mm > high_mm:
            self._once(PlantRule.ON_TRACK, f"robot {node_id} on track {span.track}")

    def _judge_pairs(self, now_us: int, node_id: int | None = None) -> None:
        """Least distance of every pair (with ``node_id``) since the last time one of them changed its motion."""
        nodes = sorted(self._spans)
        for first in nodes:
            for second in nodes:
                if first < second and node_id in (None, first, second):
                    self._judge_pair(first, second, now_us)

    def _judge_pair(self, first: int, second: int, now_us: int) -> None:
        one, two = self._spans[first], self._spans[second]
        for violation in self._mouths.judge_pair((first, second), one, two, now_us) if self._has_mouths else ():
            self._note_once(violation)
        if one.track != two.track:
            return
        from_us = max(one.from_us, two.from_us)
        limit_mm = self.world.site.carrier_length_mm - OVERLAP_TOLERANCE_MM
        gap_mm, at_us = least_distance(one.motion, two.motion, from_us, now_us)
        known = (first, second) in self._overlapping
        self._overlapping.discard((first, second))
        if abs(one.motion.at(now_us)[0] - two.motion.at(now_us)[0]) < limit_mm:
            self._overlapping.add((first, second))
        if gap_mm < limit_mm and not known:
            text = f"robots {first} and {second} on track {one.track}, centres {gap_mm:.1f} mm apart"
            self.violations.append(PlantViolation(at_us, PlantRule.BODIES_APART, text))


def least_distance(one: Motion, two: Motion, from_us: int, to_us: int) -> tuple[float, int]:
    """Least distance (mm) of two motions within a closed span of time, and when (us) it is reached.

    Exact: between the points at which either changes its acceleration the difference is a parabola.
    """
    lo, hi = from_us / 1e6, max(from_us, to_us) / 1e6
    times = {lo, hi}
    for motion in (one, two):
        times.update(t + motion.start_us / 1e6 for t in motion.turning_points())
    inside = sorted(t for t in times if lo <= t <= hi)
    candidates = list(inside)
    for begin, end in pairwise(inside):
        candidates.extend(_stationary_points(one, two, begin, end))
    best = min(candidates, key=lambda t: (abs(_difference(one, two, t)[0]), t))
    return abs(_difference(one, two, best)[0]), round(best * 1e6)


def _difference(one: Motion, two: Motion, t: float) -> tuple[float, float, float]:
    x1, v1, a1 = one.state(t - one.start_us / 1e6)
    x2, v2, a2 = two.state(t - two.start_us / 1e6)
    return x1 - x2, v1 - v2, a1 - a2


def _stationary_points(one: Motion, two: Motion, begin: float, end: float) -> Iterator[float]:
    """Times inside a smooth stretch at which the distance is least: relative standstill, or the centres meet."""
    # Taken just inside, where the accelerations are those of the stretch whatever the rounding of its ends.
    middle = (begin + end) / 2
    _, v, a = _difference(one, two, middle)
    points = [begin, end]
    if a and begin < middle - v / a < end:
        points.insert(1, middle - v / a)
        yield points[1]
    for low, high in pairwise(points):
        if _difference(one, two, low)[0] * _difference(one, two, high)[0] < 0:
            yield _meeting(one, two, low, high)


def _meeting(one: Motion, two: Motion, low: float, high: float) -> float:
    """When two centres pass each other, by bisection of a stretch in which they do it once."""
    sign = _difference(one, two, low)[0]
    for _ in range(60):
        middle = (low + high) / 2
        if _difference(one, two, middle)[0] * sign > 0:
            low = middle
        else:
            high = middle
    return low
