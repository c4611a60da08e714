"""What the oracle judges at the mouths of spurs: whole motions again, as in ``shaft_rules``.

A carrier in a spur, or turned towards it, moves on the spur's own axis: the spur at 0 mm, the mouth one pitch before.
As long as any of its body is over the border between the two it closes the mouth to those on the alley; while it turns
nobody else may be in the spur.
"""

from collections.abc import Iterator
from itertools import pairwise

from bus_sim.systems.car_park.plant.motion import Motion
from bus_sim.systems.car_park.plant.rules import OVERLAP_TOLERANCE_MM, MotionSpan, PlantRule, PlantViolation
from bus_sim.systems.car_park.plant.world import MARK_TOLERANCE_MM
from onboard.core.site import Segment
from onboard.ways.site import TrackKind, WaySite


class SpurRules:
    """Judges carriers pair by pair by the spans of their motions, which the oracle keeps."""

    def __init__(self, site: WaySite) -> None:
        self._site = site

    def judge_pair(
        self, nodes: tuple[int, int], one: MotionSpan, two: MotionSpan, now_us: int
    ) -> Iterator[PlantViolation]:
        """What two carriers broke from when both did what they do until now."""
        from_us = max(one.from_us, two.from_us)
        for (node, here), (other, there) in (((nodes[0], one), (nodes[1], two)), ((nodes[1], two), (nodes[0], one))):
            spur = self._spur_of(here)
            if spur is None:
                continue
            text = f"robots {node} and {other} at spur {spur}"
            if here.turning_to is not None and there.track == spur:
                yield PlantViolation(from_us, PlantRule.BODIES_APART, text)
            elif here.track == spur and there.track == self._mouth(spur).track:
                time_us = self._meeting_us(here.motion, there.motion, spur, from_us, now_us)
                if time_us is not None:
                    yield PlantViolation(time_us, PlantRule.BODIES_APART, text)

    def judge_turn(self, node_id: int, span: MotionSpan) -> Iterator[PlantViolation]:
        """A carrier turns only where it stands in the mouth of a spur, into it or out of it."""
        if span.turning_to is None:
            return
        spur = self._spur_of(span)
        position_mm, speed_mm_s = span.motion.at(span.from_us)
        if spur is not None and {span.track, span.turning_to} == {spur, self._mouth(spur).track}:
            here = Segment(spur, 0) if span.track == spur else self._mouth(spur)
            if not speed_mm_s and abs(position_mm - self._site.position_mm(here)) <= MARK_TOLERANCE_MM:
                return
        yield PlantViolation(
            span.from_us, PlantRule.TURN_IN_MOUTH, f"robot {node_id} at {position_mm:.0f} mm of {span.track}"
        )

    def _spur_of(self, span: MotionSpan) -> int | None:
        """The spur on whose axis a carrier moves, or towards which it turns."""
        for track in (span.track, span.turning_to):
            if track is not None and self._site.tracks[track].kind is TrackKind.SPUR:
                return track
        return None

    def _mouth(self, spur: int) -> Segment:
        return self._site.tracks[spur].joins[0]

    def _meeting_us(self, inside: Motion, beside: Motion, spur: int, from_us: int, to_us: int) -> int | None:
        """When one is over the mouth, at least in part, while another on the alley is in it."""
        half_mm, pitch_mm = self._site.carrier_length_mm / 2, self._site.tracks[spur].pitch_mm
        edge_mm = half_mm - pitch_mm / 2 - OVERLAP_TOLERANCE_MM
        mouth_mm = self._site.position_mm(self._mouth(spur))
        for begin_us, end_us in pairwise(_passages(inside, edge_mm, from_us, max(from_us, to_us))):
            if inside.at((begin_us + end_us) // 2)[0] >= edge_mm:
                continue
            low_mm, high_mm = beside.extremes_mm(begin_us, end_us)
            if low_mm - mouth_mm < self._reach_mm and mouth_mm - high_mm < self._reach_mm:
                return begin_us
        return None

    @property
    def _reach_mm(self) -> float:
        """Two bodies' centres nearer than this along the alley touch; across they are as wide as they are long."""
        return self._site.carrier_length_mm - OVERLAP_TOLERANCE_MM


def _passages(motion: Motion, edge_mm: float, from_us: int, to_us: int) -> list[int]:
    """A span of time cut where the motion passes an edge; one moment is a span of its own."""
    times = [from_us]
    time_us = motion.next_reach_us(edge_mm, from_us)
    while time_us is not None and time_us < to_us:
        times.append(time_us)
        time_us = motion.next_reach_us(edge_mm, time_us)
    return [*times, to_us]
