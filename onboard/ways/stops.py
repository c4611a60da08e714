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
from onboard.ways.roads import Roads


def paying_until_us(departures: Departures, track: int) -> list[tuple[int, int]]:
    """The indices of a track at which stopping may pay, in order, each with until when: FOREVER at junctions.

    For a goal it always pays, which is for the caller to add.
    """
    roads = departures.roads
    found: dict[int, int] = {}
    far = settling_segments(roads, track)
    for middle in roads.positions(track):
        held_us = departures.held_until_us(middle)
        for index in range(middle.index - far, middle.index + far + 1) if held_us else ():
            if found.get(index, 0) < held_us:
                found[index] = held_us
    found.update((one.index, FOREVER) for one in roads.junctions(track))
    return sorted((index, until_us) for index, until_us in found.items() if roads.knows(Segment(track, index)))


def settling_segments(roads: Roads, track: int) -> int:
    """Segments between a stop and a border from which on runs of different lengths cross it alike.

    Half a segment and half the body to the border's crossing, then the way to top speed and back (v*v/a, twice what
    braking takes), so that a run over as many segments reaches top speed too.
    """
    site = roads.site
    pitch_mm, axis = site.tracks[track].pitch_mm, site.carrier
    settled_mm2 = (pitch_mm + body_mm(site)) * axis.acceleration_mm_s2 + 2 * axis.speed_mm_s * axis.speed_mm_s
    return -(-settled_mm2 // (2 * pitch_mm * axis.acceleration_mm_s2))
