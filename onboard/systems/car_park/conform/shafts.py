"""Platforms, gates and stops by number, read anew from chapter 9 of docs/protocol.md and the site file."""

from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark


def platform(lift: int) -> Segment:
    """The platform's token on a lift's track: index 0."""
    return Segment(lift, 0)


def gate(lift: int) -> Segment:
    """The gate's token on a lift's track: index 255."""
    return Segment(lift, 255)


def under_gate(version: int) -> tuple[int, int]:
    """Bits 7 to 0 and 12 to 8 of a version of the gate (duty L1)."""
    return version & 0xFF, version >> 8 & 0x1F


def stop_mm(site: CarPark, lift: int, stop: int) -> int:
    """Height of a stop, from 1 on, above the first, mm."""
    track = site.tracks[lift]
    return track.heights_mm[stop - 1] if track.heights_mm else (stop - 1) * track.pitch_mm


def stop_at(site: CarPark, lift: int, alley: int) -> int | None:
    """The stop at which a lift's door leads to an alley, from 1 on; None where there is none."""
    sills = enumerate(site.tracks[lift].joins, start=1)
    return next((stop for stop, sill in sills if sill.track == alley), None)


def platform_at(site: CarPark, lift: int, alley: int) -> Segment | None:
    """The platform as a position of an alley: 0 or its length and one; None where no door leads there."""
    stop = stop_at(site, lift, alley)
    return None if stop is None else site.beyond(site.tracks[lift].joins[stop - 1])
