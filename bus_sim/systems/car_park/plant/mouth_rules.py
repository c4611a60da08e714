"""What the oracle judges at the mouths of linked tracks, spurs among them: whole motions, as in ``shaft_rules``.

A carrier in such a track, or turned towards it, moves on that track's axis, the mouth one pitch beyond its end. As long
as any of its body is over the border between the two it closes the mouth to all others; while it turns nobody else may
be in the segment inside.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from bus_sim.systems.car_park.plant.motion import Motion
from bus_sim.systems.car_park.plant.rules import OVERLAP_TOLERANCE_MM, MotionSpan, PlantRule, PlantViolation
from bus_sim.systems.car_park.plant.world import MARK_TOLERANCE_MM
from onboard.core.site import Segment
from onboard.ways.site import TrackKind, WaySite


class _End(NamedTuple):
    """A linked end: its position, and the mouth that it is."""

    position: Segment
    mouth: Segment


class MouthRules:
    """Judges carriers pair by pair by the spans of their motions, which the oracle keeps."""

    def __init__(self, site: WaySite) -> None:
        self._site = site

    def judge_pair(
        self, nodes: tuple[int, int], one: MotionSpan, two: MotionSpan, now_us: int
    ) -> Iterator[PlantViolation]:
        """What two carriers broke from when both did what they do until now."""
        from_us = max(one.from_us, two.from_us)
        for (node, here), (other, there) in (((nodes[0], one), (nodes[1], two)), ((nodes[1], two), (nodes[0], one))):
            for end in self._ends_of(here):
                text = f"robots {node} and {other} at {self._name(end)}"
                if here.turning_to is not None and self._is_inside(there, end, from_us):
                    yield PlantViolation(from_us, PlantRule.BODIES_APART, text)
                elif here.track == end.position.track:
                    time_us = self._meeting_us(here.motion, there, end, from_us, now_us)
                    if time_us is not None:
                        yield PlantViolation(time_us, PlantRule.BODIES_APART, text)

    def judge_turn(self, node_id: int, span: MotionSpan) -> Iterator[PlantViolation]:
        """A carrier turns only where it stands in a mouth, into the track inside or out of it."""
        if span.turning_to is None:
            return
        position_mm, speed_mm_s = span.motion.at(span.from_us)
        for end in self._ends_of(span):
            here = end.position if span.track == end.position.track else end.mouth
            if {span.track, span.turning_to} != {end.position.track, end.mouth.track}:
                continue
            if not speed_mm_s and abs(position_mm - self._site.position_mm(here)) <= MARK_TOLERANCE_MM:
                return
        yield PlantViolation(
            span.from_us, PlantRule.TURN_IN_MOUTH, f"robot {node_id} at {position_mm:.0f} mm of {span.track}"
        )

    def _ends_of(self, span: MotionSpan) -> Iterator[_End]:
        """Linked ends of the track on whose axis a carrier moves, and of the one towards which it turns."""
        for number in (span.track, span.turning_to):
            if number is not None:
                for index, mouth in self._site.tracks[number].ends:
                    # Who turns does so in one mouth: between these two tracks.
                    if span.turning_to is None or {number, mouth.track} == {span.track, span.turning_to}:
                        yield _End(Segment(number, index), mouth)

    def _name(self, end: _End) -> str:
        track = self._site.tracks[end.position.track]
        return f"spur {track.number}" if track.kind is TrackKind.SPUR else f"the mouth {end.mouth} of {track.number}"

    def _is_inside(self, other: MotionSpan, end: _End, time_us: int) -> bool:
        """Whether another is in the segment inside of a mouth, at least in part."""
        track = self._site.tracks[end.position.track]
        if other.track != track.number:
            return False
        off_mm = other.motion.at(time_us)[0] - self._site.position_mm(track.inside(end.position.index))
        if track.length > 1:
            return abs(off_mm) < self._reach_mm
        # Nearer to the mouth is inside too; farther from it is aboard of a lift at the other end.
        return off_mm * (-1 if end.position.index == 0 else 1) > -self._reach_mm

    def _meeting_us(self, inside: Motion, other: MotionSpan, end: _End, from_us: int, to_us: int) -> int | None:
        """When one is over its mouth, at least in part, while another is in it, by its own track or a third."""
        if other.track == end.mouth.track:
            mouth_mm = self._site.position_mm(end.mouth)
            for begin_us, end_us in self._times_over(inside, end.position, from_us, to_us):
                low_mm, high_mm = other.motion.extremes_mm(begin_us, end_us)
                if low_mm - mouth_mm < self._reach_mm and mouth_mm - high_mm < self._reach_mm:
                    return begin_us
            return None
        for third in self._site.links[end.mouth]:
            if third.track == other.track and third != end.position:
                for begin_us, end_us in self._times_over(inside, end.position, from_us, to_us):
                    for also_us, until_us in self._times_over(other.motion, third, from_us, to_us):
                        if max(begin_us, also_us) <= min(end_us, until_us):
                            return max(begin_us, also_us)
        return None

    def _times_over(self, motion: Motion, position: Segment, from_us: int, to_us: int) -> Iterator[tuple[int, int]]:
        """Spans of time in which a body on a track is over the border to the mouth beyond one of its ends."""
        track = self._site.tracks[position.track]
        half_mm = self._site.carrier_length_mm / 2 - OVERLAP_TOLERANCE_MM
        towards = -1 if position.index == 0 else 1
        border_mm = self._site.position_mm(track.inside(position.index)) + towards * track.pitch_mm / 2
        edge_mm = border_mm - towards * half_mm
        for begin_us, end_us in pairwise(_passages(motion, edge_mm, from_us, max(from_us, to_us))):
            if (motion.at((begin_us + end_us) // 2)[0] - edge_mm) * towards > 0:
                yield begin_us, end_us

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
