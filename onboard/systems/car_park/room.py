"""Whether all carriers of a site find a refuge: where each can stand for ever and the others still reach every place.

Without spurs, F floors take F - 1 carriers, and a lone carrier always finds room (design, section 5: beyond that,
layouts of a model got stuck in 30 of 30 runs). So the alleys before compartments stay free, and so does an alley that
is the only way to another; every other alley and every spur takes one carrier. Where alleys turn, branch or meet, the
proof is that of ``onboard.ways.room``.
"""

from itertools import groupby

from onboard.config.fleet import FleetReader
from onboard.config.reader import TomlTable
from onboard.config.toml_lines import path_text
from onboard.core.site import Segment
from onboard.ways.reach import passages
from onboard.ways.refuges import open_refuges
from onboard.ways.room import resting_room
from onboard.ways.site import TrackKind, WaySite

#: More robots than a lone one, which nobody has to pass.
MORE = 2


def refuge_tracks(site: WaySite, robots: int) -> list[int]:
    """Alleys and spurs, by track number, in each of which one of ``robots`` carriers may stand for ever."""
    if robots > 1 and site.is_charted:
        return sorted(resting_room(site).stretches)
    found = {segment.track for segment in open_refuges(site, ())}
    if robots > 1:
        alleys = {track.number for track in site.tracks.values() if track.kind is TrackKind.ALLEY}
        found -= passages(site) if len(alleys) > 1 else alleys
    return sorted(found)


def check_room(root: TomlTable, site: WaySite, fleet: FleetReader) -> None:
    """Note too few refuges as one problem, else each home where a robot may not stand for ever."""
    robots = len(site.robots)
    tracks = refuge_tracks(site, robots)
    if robots > len(tracks):
        remedy = "take robots away, or add floors or [[spurs]]: each takes one more"
        root.bad("robots", None, f"{robots_text(robots)}, but {room_text(site, robots)}", remedy)
        return
    taken: dict[int, str] = {}
    homes = [(table, home) for table, home in fleet.robots if "home" not in table.wrong]
    free = set(tracks) - {home.track for _, home in homes}
    for table, home in homes:
        why = _why_not(site, home, tracks, taken)
        if why:
            table.bad("home", table.values["home"], why, f"choose one of: {tracks_text(site, sorted(free))}")
        taken.setdefault(home.track, path_text(table.path) if "name" in table.wrong else table.values["name"])


def _why_not(site: WaySite, home: Segment, tracks: list[int], taken: dict[int, str]) -> str:
    """Why a robot may not stand at its home for ever; empty where it may."""
    if home.track in taken:
        return f"{taken[home.track]} stands there already, and one may stand where another must pass"
    if site.is_charted:
        return _why_cut_off(site, home)
    if home.track not in tracks:
        return f"the alley of floor {home.track} is needed by all, so nobody may stand there for ever"
    return ""


def _why_cut_off(site: WaySite, home: Segment) -> str:
    if home in open_refuges(site, ()):
        return ""
    free = [one.index for one in resting_room(site).stretches.get(home.track, ())]
    if free:
        return f"nobody may stand there for ever; on this track positions {ranges_text(sorted(free))} are free"
    refused = dict(resting_room(site).refused)
    return refused.get(home.track, "nobody may stand there for ever")


def robots_text(robots: int) -> str:
    """A number of robots in words."""
    return "1 robot" if robots == 1 else f"{robots} robots"


def room_text(site: WaySite, robots: int) -> str:
    """How many carriers can stand for ever, and where, on a site that has ``robots``."""
    tracks = refuge_tracks(site, robots)
    if tracks:
        return f"refuges for {len(tracks)} ({tracks_text(site, tracks)})"
    return "refuges for a lone one only" if robots > 1 and refuge_tracks(site, 1) else "no refuge"


def tracks_text(site: WaySite, tracks: list[int]) -> str:
    """Alleys and spurs in words, such as ``floors 2 to 5, spur 192``; ``tracks`` rise and are not empty."""
    parts = []
    for kind, word in ((TrackKind.ALLEY, "alley" if site.is_charted else "floor"), (TrackKind.SPUR, "spur")):
        numbers = [number for number in tracks if site.tracks[number].kind is kind]
        if numbers:
            parts.append(f"{word}{'s' if len(numbers) > 1 else ''} {ranges_text(numbers)}")
    return ", ".join(parts)


def ranges_text(numbers: list[int]) -> str:
    """Rising numbers, three or more in a row as ``2 to 5``."""
    parts: list[str] = []
    for _, row in groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0]):
        run = [number for _, number in row]
        parts += [f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(number) for number in run]
    return ", ".join(parts)
