"""When a lift's platform can be at which floor, around the uses that others plan.

Read from the robots' firm itineraries alone: whoever leaves the platform at floor p sets it free to go for whoever
boards next at floor q. In that gap it is at floor k from ``gap.from + ride(p, k)`` to ``gap.to - ride(k, q)``, where a
ride is a rest-to-rest run of the site's lift (row P41: times of arrival come from the machines' own limits). The first
gap begins where the lift stands.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from onboard.ways.kinematics import run_duration_us
from onboard.ways.reservations import FOREVER, Interval, Use
from onboard.ways.site import WaySite

#: The gate's token goes to the lift before it moves and back to the robot behind: four frames and four journal writes,
#: counted as part of a ride.
GATE_US = 400_000
#: Where a lift stands of which nothing is known: its home.
HOME_INDEX = 1


class Gap(NamedTuple):
    """Nobody plans to be on the platform during ``[from_us, to_us)``.

    It is set free at floor ``from_index`` and wanted at ``to_index``, None where nobody comes any more.
    """

    from_us: int
    to_us: int
    from_index: int
    to_index: int | None


def run_up_us(site: WaySite, lift_track: int, from_index: int, to_index: int) -> int:
    """Duration of the platform's run between two stops, in whole milliseconds; 0 between doors of one."""
    track = site.tracks[lift_track]
    if track.heights_mm:
        away_mm = track.heights_mm[to_index - 1] - track.heights_mm[from_index - 1]
        return run_duration_us(abs(away_mm), site.lift)
    return run_duration_us(abs(to_index - from_index) * track.pitch_mm, site.lift)


def ride_us(site: WaySite, lift_track: int, from_index: int, to_index: int) -> int:
    """Duration of a RIDE leg between two floors: the platform's run, and the gate's tokens."""
    return run_up_us(site, lift_track, from_index, to_index) + GATE_US


def lift_gaps(uses: Iterable[Use], start_us: int, standing_index: int) -> list[Gap]:
    """The gaps from ``start_us`` on between ``uses`` of one lift, sorted by their begin; they may overlap.

    ``standing_index`` is where the platform stands at ``start_us``, unless a use is then under way.
    """
    gaps: list[Gap] = []
    free_us, at_index = start_us, standing_index
    for use in uses:
        if use.to_us <= free_us:
            continue
        if use.from_us > free_us:
            gaps.append(Gap(free_us, use.from_us, at_index, use.board_index))
        free_us, at_index = use.to_us, use.leave_index
    if free_us < FOREVER:
        gaps.append(Gap(free_us, FOREVER, at_index, None))
    return gaps


def floor_intervals(site: WaySite, lift_track: int, gaps: Iterable[Gap], lift_index: int) -> list[Interval]:
    """When somebody may board, stand on the platform and leave it at one floor; at most one interval for each gap."""
    found = []
    for gap in gaps:
        from_us = gap.from_us + run_up_us(site, lift_track, gap.from_index, lift_index)
        to_us = gap.to_us
        if gap.to_index is not None:
            to_us -= run_up_us(site, lift_track, lift_index, gap.to_index)
        if from_us < to_us:
            found.append(Interval(from_us, to_us))
    return found


def are_compatible(site: WaySite, one: Use, other: Use) -> bool:
    """Whether two uses of one lift leave it the time to go from the floor of the first to that of the second."""
    if one.lift_track != other.lift_track:
        return True
    first, second = sorted((one, other), key=lambda use: (use.from_us, use.to_us, use.owner))
    empty_us = run_up_us(site, one.lift_track, first.leave_index, second.board_index)
    return first.to_us + empty_us <= second.from_us


def standing_after(uses: Iterable[Use], standing: Mapping[int, int], now_us: int, at_us: int) -> dict[int, int]:
    """Where each lift stands at ``at_us``, from where it stands at ``now_us`` and the uses of anybody in between.

    Lift track to lift index, for ``plan_route``; give it the uses of one's own plan too, where a new one begins behind.
    """
    found = dict(standing)
    for use in sorted(uses, key=lambda use: use.to_us):
        if now_us < use.to_us <= at_us:
            found[use.lift_track] = use.leave_index
    return found
