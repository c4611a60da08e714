"""What a car park is, in lines for a person: size, machines, refuges, and what the loss of a lift strands."""

from onboard.contract.codes import KindCode
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.room import ranges_text, robots_of, robots_text, room_text
from onboard.ways.reach import hidden_by, reached, stranded_by
from onboard.ways.site import TrackKind, WaySite

_KINDS = (
    (KindCode.COMPARTMENT, "compartment"),
    (KindCode.LIFT, "lift"),
    (KindCode.ROBOT, "robot"),
)


def lines(site: WaySite) -> list[str]:
    """One line each on floors, places, machines and refuges, then one on each lift."""
    lifts = [machine for machine in site.machines.values() if machine.kind is KindCode.LIFT]
    return [
        _floors_line(site),
        f"places: {len(site.places)}",
        f"machines: {', '.join(_machine_words(site, kind, word) for kind, word in _KINDS if _named(site, kind))}",
        f"{room_text(site, robots_of(site))}, {robots_text(robots_of(site))}",
        *(_loss_line(site, lift) for lift in lifts),
    ]


def _floors_line(site: WaySite) -> str:
    lengths = {track.length for track in site.tracks.values() if track.kind is TrackKind.ALLEY}
    count = sum(1 for track in site.tracks.values() if track.kind is TrackKind.ALLEY)
    spurs = sum(1 for track in site.tracks.values() if track.kind is TrackKind.SPUR)
    span = f"{min(lengths)} to {max(lengths)}" if len(lengths) > 1 else f"{max(lengths)}"
    beside = f", {_counted(spurs, 'spur')}" if spurs else ""
    return f"floors: {count} of {span} positions{beside}"


def _machine_words(site: WaySite, kind: KindCode, word: str) -> str:
    names = _named(site, kind)
    return f"{_counted(len(names), word)} ({', '.join(names)})"


def _named(site: WaySite, kind: KindCode) -> list[str]:
    return [machine.name for machine in site.machines.values() if machine.kind is kind]


def _counted(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"


def _loss_line(site: WaySite, lift: Machine) -> str:
    """What stays possible when a lift is lost while every robot stands at its home."""
    track = lift.home.track
    stranded = stranded_by(site, track)
    served = ranges_text([sill.track for sill in site.tracks[track].joins])
    parts = [_stranded_words(site, track, stranded) if stranded else "all places can be reached"]
    homes = [one.home for one in site.machines.values() if one.kind is KindCode.ROBOT]
    hidden = hidden_by(site, homes, lost=(track,)) if len(homes) > 1 else ()
    if hidden:
        others = " others" if stranded else ""
        parts.append(f"{len(hidden)}{others} lie before or behind robots at home, which serve them or give way")
    return f"without {lift.name} (floors {served}): {'; '.join(parts)}"


def _stranded_words(site: WaySite, lost: int, stranded: tuple[Station, ...]) -> str:
    floors = sorted({place.track for place in stranded})
    found = {segment.track for segment in reached(site, lost=(lost,))}
    robots = [one for one in site.machines.values() if one.kind is KindCode.ROBOT]
    there = [one.name for one in robots if _alley(site, one.home) not in found]
    words = f"{_counted(len(stranded), 'place')} on floor{'s' if len(floors) > 1 else ''} "
    words += f"{ranges_text(floors)} cannot be reached"
    if there:
        words += f", and {', '.join(there)} cannot leave"
        words += ": no robot is left for the others" if len(there) == len(robots) else ""
    return words


def _alley(site: WaySite, home: Segment) -> int:
    """The alley at which a home is, a spur's by its mouth."""
    track = site.tracks[home.track]
    return track.joins[0].track if track.kind is TrackKind.SPUR else track.number
