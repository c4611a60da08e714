"""Where it can pay to stop: what a search may leave out without missing a better plan.

A stop in the middle of a stretch that nobody else touches any more can always be replaced. Let j be farther than the
settling distance from all that another machine holds after the departure for j, and no goal, no platform and no mouth
of a spur. Who comes to j from within the stretch could as well wait where it was; who comes from outside could as well
stop nearer to where it goes next, at the settling distance from what is held there: beyond that distance from its ends
every run goes the same way, so it passes what is held at the same times. (Up to the rounding of each run to whole
milliseconds.)
"""

from onboard.core.site import Segment
from onboard.ways.departures import Departures
from onboard.ways.occupancy import body_mm
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import Move, Roads


class Stops:
    """Moves that a search has to try, for one set of ``goals``: positions at which a visit or the route can end."""

    def __init__(self, roads: Roads, departures: Departures, goals: frozenset[Segment]) -> None:
        self._roads = roads
        self._departures = departures
        self._goals = goals
        self._until_us: dict[int, dict[Segment, int]] = {}
        self._moves: dict[Segment, list[tuple[Move, int]]] = {}

    def moves(self, here: Segment, from_us: int) -> list[Move]:
        """Those of the roads' moves from a position that may pay with a departure from ``from_us`` on, in order."""
        found = self._moves.get(here)
        if found is None:
            until = self._until(here.track)
            moves = self._roads.moves(here)
            # Who changes the track comes to a junction, where stopping always may pay.
            found = [(move, until.get(move.destination, FOREVER)) for move in moves]
            found = self._moves[here] = [(move, until_us) for move, until_us in found if until_us]
        return [move for move, until_us in found if until_us > from_us]

    def _until(self, track: int) -> dict[Segment, int]:
        """Until when stopping at each position of a track may pay; 0 for never."""
        found = self._until_us.get(track)
        if found is None:
            positions = list(self._roads.positions(track))
            far = settling_segments(self._roads, track)
            found = dict.fromkeys(positions, 0)
            for middle in positions:
                held_us = self._departures.held_until_us(middle)
                for one in positions if held_us else ():
                    if abs(one.index - middle.index) <= far:
                        found[one] = max(found[one], held_us)
            for always in (*self._roads.junctions(track), *self._goals):
                if always in found:
                    found[always] = FOREVER
            self._until_us[track] = found
        return found


def settling_segments(roads: Roads, track: int) -> int:
    """Segments between a stop and a border from which on runs of different lengths cross it alike.

    Half a segment and half the body to the border's crossing, then the way to top speed and back (v*v/a, twice what
    braking takes), so that a run over as many segments reaches top speed too.
    """
    site = roads.site
    pitch_mm, axis = site.tracks[track].pitch_mm, site.carrier
    settled_mm2 = (pitch_mm + body_mm(site)) * axis.acceleration_mm_s2 + 2 * axis.speed_mm_s * axis.speed_mm_s
    return -(-settled_mm2 // (2 * pitch_mm * axis.acceleration_mm_s2))
