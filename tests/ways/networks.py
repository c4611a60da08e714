"""Sites of every form, made of plain values: corners, branches, rings, stubs, lifts in line, one-way alleys."""

from dataclasses import replace

from onboard.contract.codes import KindCode, Side
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.site import CarPark
from onboard.ways.site import Axis, Track, TrackKind, charted
from tests.ways.lines import line_site

PITCH_MM = 2_400
AXIS = Axis(1_500, 500)


def alley(number: int, length: int, low: Segment | None = None, high: Segment | None = None, **more: object) -> Track:
    """An alley of so many segments, linked at its ends or not."""
    track = Track(number, TrackKind.ALLEY, length, PITCH_MM, () if low is None else (low,), high)
    return replace(track, **more)  # type: ignore[arg-type]  # names and types are those of Track


def spur(number: int, length: int, mouth: Segment, side: Side = Side.FAR) -> Track:
    """A spur of so many segments off a mouth."""
    return Track(number, TrackKind.SPUR, length, PITCH_MM, (mouth,), side=side)


def lift(number: int, *sills: Segment, heights_mm: tuple[int, ...] = ()) -> Track:
    """A lift with these doors."""
    return Track(number, TrackKind.LIFT, len(sills), 2_500, sills, heights_mm=heights_mm)


def network(*tracks: Track, bays: tuple[Station, ...] = (), robots: int = 2) -> CarPark:
    """A site of these tracks with a place at both sides of each alley segment, but where a bay, link or lift is."""
    site = line_site(12, PITCH_MM, AXIS, 2_300, 50)
    machines = {n: Machine(n, f"IOC{n}", KindCode.COMPARTMENT, bay.segment, bay) for n, bay in enumerate(bays, start=1)}
    machines |= {20 + n: Machine(20 + n, f"MR{n}", KindCode.ROBOT, Segment(1, 1)) for n in range(robots)}
    made = charted({track.number: track for track in tracks})
    shape = replace(site, tracks=made, machines=machines, places=(), lift=AXIS, carrier_turn_us=3_000_000)
    taken = {*bays, *_beside_mouths(shape)}
    places = tuple(
        station
        for track in made.values()
        if track.kind is TrackKind.ALLEY
        for side in Side
        for index in range(1, track.length + 1)
        if (station := Station(track.number, index, side)) not in taken
    )
    return replace(shape, places=places)


def _beside_mouths(site: CarPark) -> list[Station]:
    return [Station(*mouth, site.tracks[end.track].side) for mouth, ends in site.links.items() for end in ends]


def at(track: int, index: int) -> Segment:
    """A segment."""
    return Segment(track, index)


def ring(one_way: int = 0) -> CarPark:
    """Four alleys round a block, each going off from the last segment of the one before; the last ends in the first."""
    return network(
        alley(1, 8, one_way=one_way),
        alley(2, 4, at(1, 8), one_way=one_way),
        alley(3, 7, at(2, 4), one_way=one_way),
        alley(4, 3, at(3, 7), at(1, 1), one_way=one_way),
        spur(192, 2, at(2, 2), Side.NEAR),
        bays=(Station(1, 3, Side.NEAR),),
    )


def in_line() -> CarPark:
    """Two alleys with a lift between them that has a door to each, and one floor that it skips."""
    return network(
        alley(1, 5, level=1),
        alley(2, 6, level=1),
        alley(3, 12, level=3),
        lift(128, at(1, 5), at(2, 1), at(3, 12), heights_mm=(0, 0, 5_000)),
        bays=(Station(1, 2, Side.NEAR),),
    )


def branched() -> CarPark:
    """An alley with a cross alley in the middle, a stub with a lift at its end, and alleys on the floor above."""
    return network(
        alley(1, 9),
        alley(2, 5, at(1, 4)),
        alley(3, 3, at(1, 4), side=Side.NEAR, level=1),
        alley(4, 6, level=2),
        spur(192, 1, at(1, 7)),
        lift(128, at(192, 1), at(4, 6)),
        bays=(Station(1, 2, Side.NEAR),),
    )
