"""What the oracle judges where alleys end at shafts: whole motions, so that nothing between two events escapes.

Between two looks every platform stood at one floor all the time, or at none, since each change of a platform is looked
at; carriers' motions are known in closed form. So each look judges the time since the last one exactly.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations

from bus_sim.systems.car_park.plant.motion import Motion
from bus_sim.systems.car_park.plant.rules import OVERLAP_TOLERANCE_MM, MotionSpan, PlantRule, PlantViolation
from bus_sim.systems.car_park.plant.shaft import Sill
from bus_sim.systems.car_park.plant.world import CarParkWorld


class ShaftRules:
    """Judges the shafts of one world by the motions of its carriers, ``spans``, which the oracle keeps.

    A violation that lasts is told once, and again when it comes back.
    """

    def __init__(self, world: CarParkWorld, spans: Mapping[int, MotionSpan]) -> None:
        self._world = world
        self._spans = spans
        self._length_mm = float(world.site.carrier_length_mm)
        self._since_us = dict.fromkeys(world.platforms, world.timers.now_us())
        self._floors = {lift: world.platform_floors(lift) for lift in world.platforms}
        self._present: dict[int, set[tuple[PlantRule, str]]] = {lift: set() for lift in world.platforms}

    def judge(self, now_us: int) -> list[PlantViolation]:
        """What was broken since the last look. To be called while ``spans`` are still as they were before a change."""
        found: list[PlantViolation] = []
        for lift, before in self._floors.items():
            floors = self._world.platform_floors(lift)
            # A platform that nobody told to have come to its floor has been there since the end of its motion.
            turned_us = now_us if not floors else min(now_us, self._world.platforms[lift].motion.end_us)
            until_us = max(self._since_us[lift], now_us if floors == before else turned_us)
            found += self._judge_time(lift, until_us)
            if floors != before:
                found += self._judge_departure(lift, until_us)
                self._floors[lift], self._since_us[lift] = floors, until_us
                found += self._judge_time(lift, now_us)
        return found

    def _judge_time(self, lift: int, until_us: int) -> list[PlantViolation]:
        """The time since this lift's last look, in which its platform was at the same floor or at none."""
        from_us = self._since_us[lift]
        if until_us <= from_us:
            return []
        self._since_us[lift] = until_us
        found = list(self._violations(lift, from_us, until_us))
        present, self._present[lift] = self._present[lift], {(v.rule, v.text) for v in found}
        return [violation for violation in found if (violation.rule, violation.text) not in present]

    def _violations(self, lift: int, from_us: int, until_us: int) -> Iterator[PlantViolation]:
        beyond: list[tuple[int, MotionSpan]] = []
        for node, span in self._spans.items():
            begin_us = max(from_us, span.from_us)
            if begin_us >= until_us:
                continue
            if span.track == self._world.platforms[lift].track and _has_moved(span.motion, begin_us, until_us):
                yield PlantViolation(begin_us, PlantRule.RIDE_AT_REST, f"robot {node}, lift {lift}")
            elif span.track in self._world.sills[lift]:
                time_us = self._first_beyond_us(lift, [span], begin_us, until_us)
                if time_us is None:
                    continue
                beyond.append((node, span))
                if span.track not in self._floors[lift]:
                    yield PlantViolation(time_us, PlantRule.FALL, f"robot {node} on track {span.track}, lift {lift}")
        for (one, first), (other, second) in combinations(beyond, 2):
            begin_us = max(from_us, first.from_us, second.from_us)
            if first.track == second.track or {first.track, second.track} <= set(self._floors[lift]):
                time_us = self._first_beyond_us(lift, [first, second], begin_us, until_us)
                if time_us is not None:
                    yield PlantViolation(time_us, PlantRule.ONE_ABOARD, f"robots {one} and {other}, lift {lift}")

    def _judge_departure(self, lift: int, now_us: int) -> Iterator[PlantViolation]:
        """A platform that leaves a floor must have nothing over its sill."""
        for node, span in self._spans.items():
            if span.track in self._floors[lift]:
                floor = span.track
                beyond_mm = self._world.sills[lift][floor].beyond_mm(span.motion.at(now_us)[0], self._length_mm)
                if OVERLAP_TOLERANCE_MM < beyond_mm < self._length_mm - OVERLAP_TOLERANCE_MM:
                    yield PlantViolation(now_us, PlantRule.LIFT_CRUSH, f"lift {lift} at floor {floor}, robot {node}")

    def _first_beyond_us(self, lift: int, spans: list[MotionSpan], begin_us: int, until_us: int) -> int | None:
        """When all these bodies are first in the shaft together: at the begin, or as one comes in."""
        sills, length_mm = self._world.sills[lift], self._length_mm
        times = {
            time for one in spans for time in _crossings(sills[one.track], one.motion, length_mm, begin_us, until_us)
        }
        return next(
            (time for time in sorted(times) if all(self._is_beyond(sills[one.track], one, time) for one in spans)), None
        )

    def _is_beyond(self, sill: Sill, span: MotionSpan, time_us: int) -> bool:
        return sill.beyond_mm(span.motion.at(time_us)[0], self._length_mm) > OVERLAP_TOLERANCE_MM


def _has_moved(motion: Motion, begin_us: int, until_us: int) -> bool:
    low_mm, high_mm = motion.extremes_mm(begin_us, until_us)
    return high_mm - low_mm > OVERLAP_TOLERANCE_MM


def _crossings(sill: Sill, motion: Motion, length_mm: float, begin_us: int, until_us: int) -> Iterator[int]:
    """The begin of a span of time, and when the body's end passes the sill, by a hair more than the tolerance."""
    yield begin_us
    edge_mm = sill.edge_mm + sill.towards * (2 * OVERLAP_TOLERANCE_MM - length_mm / 2)
    time_us = motion.next_reach_us(edge_mm, begin_us)
    while time_us is not None and time_us <= until_us:
        yield time_us
        time_us = motion.next_reach_us(edge_mm, time_us)
