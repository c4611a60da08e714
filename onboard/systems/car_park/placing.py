"""On which track's axis a carrier's drive speaks, and where its word is on the axis in hand.

From the beginning of a leg through a mouth into a track until the carrier is turned out of it the axis in hand is that
track's, with the mouth at the index beyond its end. On a straight site a drive tells only whether it is turned; where
alleys turn or meet each track has its own stretch of the tape that the drive reads, and its position tells the track.
"""

from dataclasses import dataclass, field, replace

from onboard.contract.codes import DriveMode
from onboard.contract.messages import DriveState
from onboard.core.site import Segment
from onboard.systems.car_park.axis import TrackAxis
from onboard.ways.lifts import MARK_TOLERANCE_MM, is_same_stop, lift_at, lift_index_of, platform_on
from onboard.ways.site import WaySite

#: A drive that says to be farther from the nearest mark than this is not believed, mm: no track has such gaps.
OFF_LIMIT_MM = 20_000


@dataclass
class Placing:
    """The axes of one site as a carrier needs them. ``track`` is always that of the axis in hand."""

    site: WaySite
    _axes: dict[int, TrackAxis] = field(default_factory=dict)

    def axis(self, track: int) -> TrackAxis:
        """The axis of an alley or spur, built at the first call."""
        axis = self._axes.get(track)
        if axis is None:
            axis = self._axes[track] = TrackAxis(self.site, track)
        return axis

    def is_far_off(self, state: DriveState, track: int) -> bool:
        """Whether a drive says to be where no track is."""
        told = self.site.on_tape(state.position_mm) if self.site.is_charted else None
        if told is not None:
            axis, position_mm = self.axis(told.track), told.position_mm
        elif self.site.is_charted:
            return True
        else:
            mouth = next(iter(self.axis(track).mouths.values()), None)
            # One that has turned back out of a spur speaks of the alley's marks already.
            axis, position_mm = self.axis(track if mouth is None or state.across else mouth.track), state.position_mm
        return abs(position_mm - axis.position_mm(axis.index_at(position_mm))) > OFF_LIMIT_MM

    def placed(self, state: DriveState, track: int, goal: Segment | None) -> tuple[int, DriveState | None]:
        """The track in hand by a drive's word, and the word on its axis; None where it fits none."""
        if self.site.is_charted:
            return self._on_tape(state, track, goal)
        mouths = self.axis(track).mouths
        if not mouths:
            return track, None if state.across else state
        if state.across:
            return track, state
        is_there = self._mouth_near(state, mouths[0].track, track) is not None
        if state.mode is DriveMode.TURNING or (is_there and goal is not None and goal.track == track):
            return track, self.moved(state, mouths[0], Segment(track, 0))
        return mouths[0].track, state

    def _on_tape(self, state: DriveState, track: int, goal: Segment | None) -> tuple[int, DriveState | None]:
        told = self.site.on_tape(state.position_mm)
        if told is None:
            return track, None
        here = replace(state, position_mm=told.position_mm)
        if told.track == track:
            return track, here
        mouth = self._mouth_near(here, told.track, track)
        if mouth is not None and (state.mode is DriveMode.TURNING or (goal is not None and goal.track == track)):
            return track, self.moved(here, mouth, self._end(track, mouth))
        other_door = self.other_door(self._position(here, told.track), track)
        if other_door is not None:
            return track, self.moved(here, self._position(here, told.track), other_door)
        return told.track, here

    def unturned(self, state: DriveState | None, track: int) -> Segment | None:
        """The mouth where a carrier stands before it turns, the axis of the track inside already in hand; else None."""
        axis = self.axis(track)
        if state is None or not axis.mouths or state.mode is DriveMode.TURNING:
            return None
        if state.across is self.site.across(track):
            return None
        nearest = min(axis.mouths, key=lambda index: abs(state.position_mm - axis.position_mm(index)))
        return axis.mouths[nearest]

    def aside(self, state: DriveState | None, track: int) -> Segment | None:
        """The mouth of which a carrier that has to turn in it is not at the mark, as it was pushed; else None."""
        mouth = self.unturned(state, track)
        if state is None or mouth is None:
            return None
        is_at_mark = state.mode is DriveMode.STANDING and abs(self.told(state, track)[1]) <= MARK_TOLERANCE_MM
        return None if is_at_mark else mouth

    def told(self, state: DriveState, track: int) -> tuple[Segment, int]:
        """Position and offset in mm as the fleet is told; beyond a linked end is turned, or turning, in the mouth."""
        index = self.axis(track).index_at(state.position_mm)
        offset_mm = state.position_mm - self.axis(track).position_mm(index)
        return self.unturned(state, track) or Segment(track, index), offset_mm

    def slots(self, state: DriveState, track: int) -> list[Segment]:
        """Slots that the body is in, with the gate where it is across a sill; not turned yet, those of the alley."""
        mouth, half_mm, centre_mm = self.unturned(state, track), self._half_mm(track), state.position_mm
        if mouth is None:
            return self.axis(track).overlapped(centre_mm - half_mm, centre_mm + half_mm)
        if self.aside(state, track) is None:
            return [mouth]
        axis = self.axis(mouth.track)
        centre_mm = axis.position_mm(mouth.index) + self.told(state, track)[1]
        return axis.overlapped(centre_mm - half_mm, centre_mm + half_mm)

    def _half_mm(self, track: int) -> int:
        """Half a body: one as long as a slot that is at a mark, within its tolerance, is in that slot alone."""
        return min(self.site.carrier_length_mm // 2, self.axis(track).pitch_mm // 2 - MARK_TOLERANCE_MM - 1)

    def leaves(self, slot: Segment, state: DriveState | None, track: int, to_index: int) -> bool:
        """Whether a carrier goes out of a slot that it is in: to an index of its axis, or back into the mouth."""
        if state is None:
            return False
        mouth, off_mm = self.unturned(state, track), self.told(state, track)[1]
        if mouth is not None:
            return slot.track == mouth.track and (slot.index - mouth.index) * off_mm > 0
        axis = self.axis(track)
        slot_mm, to_mm = (axis.position_mm(index) - state.position_mm for index in (slot.index, to_index))
        return slot.track == track and slot_mm * to_mm < 0

    def faced(self, state: DriveState, track: int, goal: Segment) -> tuple[int, DriveState]:
        """The axis that a goal on another track needs in hand: its own in the mouth through which the way leads in.

        Whoever is turned away from the goal comes out first, on the axis that it is on.
        """
        mouth = self.unturned(state, track)
        if mouth is not None:
            state, track = self.moved(state, self._end(track, mouth), mouth), mouth.track
        inward = self.axis(goal.track)
        for index, at in inward.mouths.items():
            if at == self._position(state, track) and inward.track.inside(index) == goal:
                return goal.track, self.moved(state, at, Segment(goal.track, index))
        return track, state

    def way_out(self, track: int, goal: Segment) -> int:
        """The index by which one comes to a goal on another track: beyond an end of this one, or of a mouth on it."""
        found = self.axis(track).end_at(goal)
        if found is not None:
            return found
        ends = self.axis(goal.track).track
        mouths = (at.index for index, at in ends.ends if at.track == track and ends.inside(index) == goal)
        return next(mouths, next(iter(self.axis(track).mouths), 0))

    def moved(self, state: DriveState, here: Segment, there: Segment) -> DriveState:
        """The same place, which is ``here`` on one axis, as ``there`` on another."""
        by_mm = self.site.position_mm(there) - self.site.position_mm(here)
        return replace(state, position_mm=state.position_mm + by_mm)

    def ridden(self, state: DriveState | None, track: int, floor: int) -> DriveState | None:
        """A word of before the platform came to another floor, on the axis of that floor's track."""
        lift = None if state is None else lift_at(self.site, self._position(state, track))
        there = None if lift is None else platform_on(self.site, lift, floor)
        if state is None or there is None or not self.site.is_charted:
            return state
        return self.moved(state, self._position(state, track), there)

    def tape_mm(self, target: Segment) -> int:
        """Where a drive's tape has the centre of a segment."""
        return self.site.position_mm(target) + self.site.tracks[target.track].origin_mm

    def other_door(self, position: Segment, track: int) -> Segment | None:
        """The position on ``track`` that is the same platform at the same stop; None where there is none."""
        lift = lift_at(self.site, position)
        there = None if lift is None else platform_on(self.site, lift, track)
        if lift is None or there is None:
            return None
        doors = lift_index_of(self.site, lift, position.track), lift_index_of(self.site, lift, track)
        return there if is_same_stop(self.site, lift, *doors) else None

    def _position(self, state: DriveState, track: int) -> Segment:
        return Segment(track, self.axis(track).index_at(state.position_mm))

    def _mouth_near(self, state: DriveState, told: int, track: int) -> Segment | None:
        """The mouth of ``track`` that a carrier on its track ``told`` is in, by the nearest mark."""
        at = self._position(state, told)
        return at if at in self.axis(track).mouths.values() else None

    def _end(self, track: int, mouth: Segment) -> Segment:
        return Segment(track, self.way_out(track, mouth))
