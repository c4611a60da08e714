"""Where everything of a building lies on its floor, in mm: slots, places, platforms. For proofs and for drawings.

A slot is as long as its track's pitch and as wide as the narrowest alley's; a place is a pitch wide and as deep as the
shuttle reaches, from the slot's edge outward. x grows with the index of a floor's own alley, y towards its far side.
"""

from typing import NamedTuple

from onboard.contract.codes import Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.site import CarPark
from onboard.ways.floor_plan import FloorPlan, at_mm, floor_plan
from onboard.ways.lifts import stop_mm
from onboard.ways.site import TrackKind


class Box(NamedTuple):
    """A rectangle along the axes, mm."""

    left: float
    low: float
    right: float
    high: float

    def overlaps(self, other: "Box") -> bool:
        """Whether both share more than an edge."""
        return self.left < other.right and other.left < self.right and self.low < other.high and other.low < self.high

    def around(self, other: "Box") -> "Box":
        """The smallest rectangle that holds both."""
        return Box(
            min(self.left, other.left),
            min(self.low, other.low),
            max(self.right, other.right),
            max(self.high, other.high),
        )


class Outlines:
    """The boxes of one site."""

    def __init__(self, site: CarPark) -> None:
        self.site = site
        self.plan: FloorPlan = floor_plan(site)
        #: Side of a usual slot: that of the narrowest alley.
        self.slot_mm = min(track.pitch_mm for track in site.tracks.values() if track.kind is TrackKind.ALLEY)

    @property
    def levels(self) -> list[int]:
        """The floors, the highest first."""
        return levels_of(self.site)[::-1]

    def slot(self, segment: Segment) -> Box:
        """What a segment takes, or the position beyond an end: its pitch along the track, a usual slot across."""
        (x, y), line = at_mm(self.plan, self.site, segment), self.plan.lines[segment.track]
        along, across = self.site.tracks[segment.track].pitch_mm / 2, self.slot_mm / 2
        wide, high = (along, across) if line.dx else (across, along)
        return Box(x - wide, y - high, x + wide, y + high)

    def track(self, number: int) -> Box:
        """All slots of an alley or a spur."""
        length = self.site.tracks[number].length
        return self.slot(Segment(number, 1)).around(self.slot(Segment(number, length)))

    def station(self, station: Station) -> Box:
        """A place, or a compartment."""
        line, reach_mm = self.plan.lines[station.track], self.site.shuttle_reach_mm
        slot = self.slot(station.segment)
        across = 1 if station.side is Side.FAR else -1
        dx, dy = -line.dy * across, line.dx * across
        if dx:
            return (
                Box(slot.right, slot.low, slot.right + reach_mm, slot.high)
                if dx > 0
                else Box(slot.left - reach_mm, slot.low, slot.left, slot.high)
            )
        return (
            Box(slot.left, slot.high, slot.right, slot.high + reach_mm)
            if dy > 0
            else Box(slot.left, slot.low - reach_mm, slot.right, slot.low)
        )

    def platform(self, lift: int) -> Box:
        """A lift's platform: a usual slot."""
        (x, y), half = self.plan.shafts[lift], self.slot_mm / 2
        return Box(x - half, y - half, x + half, y + half)

    def level(self, level: int) -> Box:
        """All that lies on a floor."""
        boxes = [self.track(number) for number in self.tracks_on(level)]
        stations = (*self.site.places, *self.site.compartments.values())
        boxes += [self.station(one) for one in stations if self.site.level(one.track) == level]
        boxes += [self.platform(lift) for lift in self.lifts_on(level)]
        whole = boxes[0]
        for box in boxes:
            whole = whole.around(box)
        return whole

    def tracks_on(self, level: int) -> list[int]:
        """Alleys, lobbies and spurs of a floor, in the site's order."""
        tracks = self.site.tracks.values()
        return [one.number for one in tracks if one.kind is not TrackKind.LIFT and self.site.level(one.number) == level]

    def lifts_on(self, level: int) -> list[int]:
        """The lifts that stop at a floor."""
        return [
            lift
            for lift in self.site.lifts
            if any(self.site.level(sill.track) == level for sill in self.site.tracks[lift].joins)
        ]


def is_elevation(site: CarPark) -> bool:
    """Whether all is seen from the side: each floor one alley, lifts at its ends, spurs of one segment."""
    alleys = [track for track in site.tracks.values() if track.kind is TrackKind.ALLEY]
    spurs = [track for track in site.tracks.values() if track.kind is TrackKind.SPUR]
    return (
        len({site.level(track.number) for track in alleys}) == len(alleys)
        and not any(track.ends for track in alleys)
        and all(track.length == 1 for track in spurs)
    )


def shifts(site: CarPark) -> dict[int, int]:
    """Where each alley of an elevation begins, in positions to the right of the leftmost: a shaft is vertical."""
    lines = floor_plan(site).lines
    alleys = [track for track in site.tracks.values() if track.kind is TrackKind.ALLEY]
    left_mm = min(lines[track.number].x_mm for track in alleys)
    return {track.number: round((lines[track.number].x_mm - left_mm) / track.pitch_mm) for track in alleys}


def levels_of(site: CarPark) -> list[int]:
    """The floors, the lowest first."""
    return sorted({site.level(track.number) for track in site.tracks.values() if track.kind is not TrackKind.LIFT})


def level_heights_mm(site: CarPark) -> dict[int, int]:
    """How high each floor lies above the lowest, as lifts' stops tell; floors that none joins are as high as usual."""
    known: dict[int, int] = {}
    for level in levels_of(site):
        if level not in known:
            known[level] = (level - 1) * site.floor_height_mm
            _tell_above(site, known)
    low = min(known.values())
    return {level: height_mm - low for level, height_mm in known.items()}


def _tell_above(site: CarPark, known: dict[int, int]) -> None:
    """Add the heights of all floors that are joined to known ones, if over several lifts."""
    shafts = [
        {site.level(sill.track): stop_mm(site, lift, at) for at, sill in enumerate(site.tracks[lift].joins, start=1)}
        for lift in site.lifts
    ]
    while shaft := next((one for one in shafts if known.keys() & one.keys() and one.keys() - known.keys()), None):
        first = min(known.keys() & shaft.keys())
        for level, height_mm in shaft.items():
            known.setdefault(level, known[first] + height_mm - shaft[first])
