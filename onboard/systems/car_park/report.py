"""What a car park is, in lines for a person: size, machines, refuges, and what the loss of a lift strands."""

from collections import Counter

from onboard.config.site_report import counted, machines_line
from onboard.contract.codes import KindCode
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.room import (
    MORE,
    ranges_text,
    refuge_tracks,
    robots_text,
    room_text,
    tracks_text,
)
from onboard.systems.car_park.site import CarPark
from onboard.ways.reach import hidden_by, reached, stranded_by
from onboard.ways.room import reachable
from onboard.ways.site import BayUse, Track, TrackKind

_KINDS = {KindCode.COMPARTMENT: "compartment", KindCode.LIFT: "lift", KindCode.ROBOT: "robot"}


def lines(site: CarPark) -> list[str]:
    """What was proved: floors, places by class, what is reached, machines, refuges; what each lift's loss cuts off."""
    lifts = [machine for machine in site.machines.values() if machine.kind is KindCode.LIFT]
    return [
        *_floors_lines(site),
        _places_line(site),
        _reached_line(site),
        machines_line(site, _KINDS),
        f"{_room_words(site)}, {robots_text(len(site.robots))}",
        *_battery_lines(site),
        *(_loss_line(site, lift) for lift in lifts),
        *_one_way_lines(site),
    ]


def _battery_lines(site: CarPark) -> list[str]:
    battery = site.battery
    if battery is None:
        return []
    driving_h = battery.capacity_wh / (battery.rest_w + battery.drive_w)
    rest = f"{battery.capacity_wh / battery.rest_w:.1f} h at rest, " if battery.rest_w else ""
    chargers = ", ".join(map(str, battery.chargers))
    return [f"batteries: {battery.capacity_wh} Wh, {rest}{driving_h:.1f} h of driving; chargers: {chargers}"]


def _room_words(site: CarPark) -> str:
    """How many robots can rest together; a lone one in more places, where nobody else has to pass."""
    if len(site.robots) > 1 or not site.is_charted:
        return room_text(site, len(site.robots))
    lone = tracks_text(site, refuge_tracks(site, 1))
    return f"{room_text(site, MORE)}; a lone one may rest on {lone}"


def _floors_lines(site: CarPark) -> list[str]:
    """Floors and lengths of alleys; where a floor has several alleys, which they are and what the file calls them."""
    by_level: dict[int, list[Track]] = {}
    for track in site.tracks.values():
        # A lobby before a lift is no alley that anybody named.
        if track.kind is TrackKind.ALLEY and (not track.ends or track.number in site.alley_names):
            by_level.setdefault(site.level(track.number), []).append(track)
    lengths = {track.length for tracks in by_level.values() for track in tracks}
    spurs = sum(1 for track in site.tracks.values() if track.kind is TrackKind.SPUR)
    span = f"{min(lengths)} to {max(lengths)}" if len(lengths) > 1 else f"{max(lengths)}"
    beside = f", {counted(spurs, 'spur')}" if spurs else ""
    if all(len(tracks) == 1 for tracks in by_level.values()):
        return [f"floors: {len(by_level)} of {span} positions{beside}"]
    count = sum(map(len, by_level.values()))
    return [
        f"floors: {len(by_level)}, with {count} alleys of {span} positions{beside}",
        *(
            f"floor {level}: {', '.join(_alley_words(site, one) for one in by_level[level])}"
            for level in sorted(by_level)
        ),
    ]


def _alley_words(site: CarPark, track: Track) -> str:
    name = site.alley_names.get(track.number)
    return f"p({track.number},1) to p({track.number},{track.length}){f' is {name}' if name else ''}"


def _places_line(site: CarPark) -> str:
    unused = len(site.places) - len(to_fetch_from(site, site.places))
    but = (
        f"; {unused} of them are not used, as no itinerary can tell the way to fetch a car from there" if unused else ""
    )
    return f"{_places_words(site)}{but}"


def _places_words(site: CarPark) -> str:
    if not site.classes:
        return f"places: {len(site.places)}"
    numbers = Counter(site.place_class.get(place.number, 0) for place in site.places)
    parts = [
        f"{numbers[number]} {one.name}{' (to charge)' if one.charging else ''}"
        for number, one in enumerate(site.classes, start=1)
    ]
    return f"places: {len(site.places)}: {', '.join([*parts, f'{numbers[0]} for any car'])}"


def _reached_line(site: CarPark) -> str:
    """The loader refuses a site of which this is not true (``reader/built.py``)."""
    bays = Counter(site.bay_uses.get(node, BayUse.BOTH) for node in site.compartments)
    words = {BayUse.BOTH: "in and out", BayUse.ENTRY: "in only", BayUse.EXIT: "out only"}
    parts = [f"{bays[use]} {words[use]}" for use in (BayUse.BOTH, BayUse.ENTRY, BayUse.EXIT) if bays[use]]
    lost = len(reachable(site).lost_places) + len(reachable(site).no_way_out)
    what = "every place from an entry, and from every place an exit" if not lost else f"all but {lost} places"
    return f"reached: {what} (compartments: {', '.join(parts)})"


def _one_way_lines(site: CarPark) -> list[str]:
    """One-way alleys, ring by ring: each goes on into the next; the others by themselves."""
    after = {one.number: _next_one_way(site, one) for one in site.tracks.values() if one.one_way}
    lines, seen = [], set[int]()
    for first, second in after.items():
        ring, here = [first], second
        while here is not None and here not in ring and here in after:
            ring.append(here)
            here = after[here]
        if here == first and first not in seen:
            seen |= set(ring)
            lines.append(f"one way round on floor {site.level(first)}: alleys {', '.join(map(str, ring))}")
    alone = [number for number in after if number not in seen]
    return lines + ([f"one way: alley{'s' if len(alone) > 1 else ''} {ranges_text(alone)}"] if alone else [])


def _next_one_way(site: CarPark, track: Track) -> int | None:
    """The one-way alley at the end to which a one-way alley goes, or that goes off from its last slots."""
    last = track.length if track.one_way > 0 else 1
    mouth = track.high if track.one_way > 0 else track.low
    if mouth is not None:
        return mouth.track
    off = [end.track for end in site.links.get(Segment(track.number, last), ())]
    return next((number for number in off if site.tracks[number].one_way), None)


def _loss_line(site: CarPark, lift: Machine) -> str:
    """What stays possible when a lift is lost while every robot stands at its home."""
    track = lift.home.track
    stranded = stranded_by(site, track)
    served = ranges_text(sorted({site.level(sill.track) for sill in site.tracks[track].joins}))
    parts = [_stranded_words(site, track, stranded) if stranded else "all places can be reached"]
    homes = [one.home for one in site.machines.values() if one.kind is KindCode.ROBOT]
    hidden = hidden_by(site, homes, lost=(track,)) if len(homes) > 1 else ()
    if hidden:
        others = " others" if stranded else ""
        parts.append(f"{len(hidden)}{others} lie before or behind robots at home, which serve them or give way")
    return f"without {lift.name} (floors {served}): {'; '.join(parts)}"


def _stranded_words(site: CarPark, lost: int, stranded: tuple[Station, ...]) -> str:
    floors = sorted({site.level(place.track) for place in stranded})
    found = {segment.track for segment in reached(site, lost=(lost,))}
    robots = [one for one in site.machines.values() if one.kind is KindCode.ROBOT]
    there = [one.name for one in robots if _alley(site, one.home) not in found]
    words = f"{counted(len(stranded), 'place')} on floor{'s' if len(floors) > 1 else ''} "
    words += f"{ranges_text(floors)} cannot be reached"
    if there:
        words += f", and {', '.join(there)} cannot leave"
        words += ": no robot is left for the others" if len(there) == len(robots) else ""
    return words


def _alley(site: CarPark, home: Segment) -> int:
    """The alley at which a home is, a spur's by its mouth."""
    track = site.tracks[home.track]
    return track.joins[0].track if track.kind is TrackKind.SPUR else track.number
