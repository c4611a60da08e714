"""Where it can pay to stop: what a search may leave out without missing a better plan.

A stop in the middle of a stretch that nobody else touches any more can always be replaced. Let j be farther than the
settling distance from all that another machine holds after the departure for j, and no goal, no platform and no mouth
of a spur. Who comes to j from within the stretch could as well wait where it was; who comes from outside could as well
stop nearer to where it goes next, at the settling distance from what is held there: beyond that distance from its ends
every run goes the same way, so it passes what is held at the same times. (Up to the rounding of each run to whole
milliseconds.)
"""

from onboard.ways.departures import Departures
from onboard.ways.occupancy import body_mm
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import Roads


def paying_until_us(departures: Departures, track: int) -> list[tuple[int, int]]:
    """The indices of a track at which stopping may pay, in order, each with until when: FOREVER at junctions.

    For a goal it always pays, which is for the caller to add.
    """
    roads = departures.roads
    far = settling_segments(roads, track)
    held_us = {one.index: departures.held_until_us(one) for one in roads.positions(track)}
    first, last = min(held_us), max(held_us)
    # Beyond both ends of the track nobody holds anything.
    until_us = [held_us.get(index, 0) for index in range(first - far, last + far + 1)]
    found = {index: max(until_us[index - first : index - first + 2 * far + 1]) for index in sorted(held_us)}
    found.update((one.index, FOREVER) for one in roads.junctions(track) if one.index in held_us)
    return [(index, pays_us) for index, pays_us in found.items() if pays_us]


def settling_segments(roads: Roads, track: int) -> int:
    """Segments between a stop and a border from which on runs of different lengths cross it alike.

    Half a segment and half the body to the border's crossing, then the way to top speed and back (v*v/a, twice what
    braking takes), so that a run over as many segments reaches top speed too.
    """
    site = roads.site
    pitch_mm, axis = site.tracks[track].pitch_mm, site.carrier
    settled_mm2 = (pitch_mm + body_mm(site)) * axis.acceleration_mm_s2 + 2 * axis.speed_mm_s * axis.speed_mm_s
    return -(-settled_mm2 // (2 * pitch_mm * axis.acceleration_mm_s2))
