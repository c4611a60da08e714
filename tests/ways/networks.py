"""Sites of every form, made of plain values: corners, branches, rings, stubs, lifts in line, one-way alleys."""

import random
from dataclasses import replace

from onboard.contract.codes import KindCode, Side
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.site import CarPark
from onboard.ways.room import resting_room
from onboard.ways.site import Axis, BayUse, Track, TrackKind, charted
from tests.sites import one_floor
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


def drawn(seed: int) -> CarPark:
    """A building by chance: floors with an alley each, branches off them, loops that go one way, spurs, and lifts.

    Two lifts reach all floors and some, at any heights; the first may have a second door to an alley in line.
    """
    chance = random.Random(seed)
    floors, length = chance.randint(1, 3), chance.randint(9, 12)
    tracks: list[Track] = []
    for level in range(1, floors + 1):
        tracks += _storey(chance, level, 10 * (level - 1) + 1, length)
    heights_mm = tuple(level * 2_500 + (level > 1) * chance.choice((0, 4_000)) for level in range(floors))
    roots = [track for track in tracks if track.kind is TrackKind.ALLEY and not track.ends]
    if floors > 1:
        behind = [alley(100, 3, level=1)] * chance.randint(0, 1)
        sills = [at(root.number, 1) for root in roots] + [at(100, 3) for _ in behind]
        tracks += [*behind, lift(128, *_by_height(sills, (*heights_mm, 0)), heights_mm=_sorted(heights_mm, behind))]
        second = sorted(chance.sample(range(floors), chance.randint(2, floors)))
        doors = [at(roots[floor].number, roots[floor].length) for floor in second]
        tracks.append(
            lift(129, *doors, heights_mm=tuple(heights_mm[floor] - heights_mm[second[0]] for floor in second))
        )
    return network(*tracks, bays=(Station(1, 2, Side.NEAR),), robots=chance.randint(2, 3))


def _by_height(sills: list[Segment], heights_mm: tuple[int, ...]) -> list[Segment]:
    return [sill for _, sill in sorted(zip(heights_mm, sills, strict=False), key=lambda pair: pair[0])]


def _sorted(heights_mm: tuple[int, ...], behind: list[Track]) -> tuple[int, ...]:
    return tuple(sorted((*heights_mm, *[0] * len(behind))))


def _storey(chance: random.Random, level: int, number: int, length: int) -> list[Track]:
    """An alley, a branch with a branch of its own, a spur, and a loop round which carriers go one way."""
    root = alley(number, length, level=level)
    tracks = [root, spur(192 + level, chance.randint(1, 3), at(number, 3), chance.choice(list(Side)))]
    if chance.random() < 0.7:
        tracks.append(alley(number + 1, chance.randint(2, 5), at(number, 4), side=Side.NEAR, level=level))
        if chance.random() < 0.5:
            tracks.append(alley(number + 2, chance.randint(1, 4), at(number + 1, 2), side=chance.choice(list(Side))))
    if chance.random() < 0.7:
        depth, way = chance.randint(1, 3), chance.choice((-1, 0, 1))
        tracks += [
            alley(number + 3, depth, at(number, 5), one_way=way),
            alley(number + 4, 2, at(number + 3, depth), at(number + 5, depth), side=Side.NEAR, one_way=way),
            alley(number + 5, depth, at(number, 8), one_way=-way),
        ]
    return tracks


def running(shape: CarPark, robots: int = 2, uses: dict[int, BayUse] | None = None) -> CarPark:
    """The same ways with machines and times to run: robots at home where machines rest, bay 1 steward of all alleys."""
    usual = one_floor()
    machines = {node: one for node, one in shape.machines.items() if one.kind is KindCode.COMPARTMENT}
    lifts = {track: 5 + number for number, track in enumerate(shape.lifts)}
    machines |= {node: Machine(node, f"ER{node}", KindCode.LIFT, at(track, 1)) for track, node in lifts.items()}
    homes = resting_room(shape).slots[:robots]
    machines |= {node: Machine(node, f"MR{node}", KindCode.ROBOT, home) for node, home in enumerate(homes, start=11)}
    stewards = {track: lifts.get(track, 1) for track in shape.tracks}
    return replace(
        usual,
        tracks=shape.tracks,
        places=shape.places,
        machines=machines,
        stewards=stewards,
        bay_uses=uses or {},
    )
