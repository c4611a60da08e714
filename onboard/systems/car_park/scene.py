"""The car park's picture: tracks and places, cars, doors and bays, plans and segments held ahead of each robot.

Where each floor is one alley it is an elevation, which the page arranges by itself; any other building is drawn floor
by floor from above, to scale, as ``_building`` arranges it.
"""

from typing import Any

from onboard.contract.car_park_device import DeskPromise
from onboard.contract.codes import KindCode, LegAction, TokenKind
from onboard.contract.messages import BayState, DeskOrder, DoorState, Message, ShuttleState
from onboard.core.site import Segment
from onboard.history.history import Fact
from onboard.systems.car_park.history import car_park_history
from onboard.systems.car_park.outlines import Outlines, is_elevation, level_heights_mm, shifts
from onboard.systems.car_park.site import CarPark, car_park
from onboard.trace.scene.scene import Json
from onboard.trace.view import SiteView
from onboard.ways.lifts import lift_at
from onboard.ways.site import TrackKind, WaySite


class CarParkScene:
    """A view of the history of ``view``, and of the device buses that are heard."""

    def __init__(self, site: WaySite, view: SiteView) -> None:
        self.site = site
        self.view = view
        self.words = view.words
        self._history = view.history
        self._clock = view.history.clock
        self._doors: dict[int, dict[str, str]] = {}
        self._bays: dict[int, dict[str, Any]] = {}
        self._shuttles: dict[int, dict[str, Any]] = {}
        self._desks: dict[int, str] = {}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """The history tells all of it."""

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """Follow doors, desks and drives, where their buses are heard."""
        match message:
            case DoorState():
                self._doors[node] = {
                    "input": message.input_door.name.lower(),
                    "output": message.output_door.name.lower(),
                    "light": message.light.name.lower(),
                }
            case BayState():
                self._bays[node] = {"car": message.load_kg > 0, "person": message.person_inside}
            case ShuttleState():
                self._shuttles[node] = {"mm": message.extension_mm, "side": int(message.side)}
            case DeskOrder():
                self._desks[node] = message.text.name.lower().replace("_", " ")
            case DeskPromise():
                car, spread_s = self.words.load(message.car), message.spread_ms / 1_000
                self._desks[node] = f"car {car} in {message.in_ms / 1_000:.1f} s, give or take {spread_s:.1f} s"

    def layout(self) -> Json:
        """Tracks and places; ``blockable`` are the segments that a person may name, ``building`` lies in mm.

        ``classes`` are the names of classes by place, ``charging`` the places where one can charge. Of an elevation
        ``heights_mm`` are those of alleys above the lowest, and ``shifts`` their beginnings in positions.
        """
        site, park = self.site, car_park(self.site)
        of_place = {place: park.classes[number - 1] for place, number in park.place_class.items()}
        return {
            "carrier_mm": site.carrier_length_mm,
            "tracks": [
                {
                    "number": track.number,
                    "kind": track.kind.value,
                    "length": track.length,
                    "pitch_mm": track.pitch_mm,
                    "joins": [[join.track, join.index] for join in track.joins],
                    "one_way": track.one_way,
                }
                for track in site.tracks.values()
            ],
            "places": [place.number for place in site.places],
            "classes": {place: one.name for place, one in of_place.items()},
            "charging": [place for place, one in of_place.items() if one.charging],
            "bay_uses": {node: use.value for node, use in park.bay_uses.items()},
            **(_elevation(park) if is_elevation(park) else {"building": _building(park)}),
            "blockable": [
                str(Segment(track.number, index))
                for track in site.tracks.values()
                if track.kind is not TrackKind.LIFT
                for index in range(1, track.length + 1)
            ],
        }

    def marks(self, now_us: int) -> Json:
        """Cars by the station where they stand, and segments that somebody says nobody can pass."""
        return {
            "cars": {station: self.words.load(car) for station, car in self._history.loads.standing().items()},
            "blocked": [[*segment] for segment in sorted(self._history.orders.blocked)],
            **({"promises": self._promises(now_us)} if car_park(self.site).promises else {}),
        }

    def _promises(self, now_us: int) -> list[Json]:
        """When each car that is waited for will be there, as its customer was first told; times in us of the log."""
        words = car_park_history(self._history).open(self._history.loads.stations)
        return [
            {
                "car": self.words.load(word.car),
                "at": self.words.machine(word.sender),
                "ready_us": self._clock.log_us(word.ready_ms, now_us),
                "spread_us": word.spread_ms * 1_000,
            }
            for word in words
        ]

    def machine(self, node: int, now_us: int) -> Json:
        """Segment, offset in mm, speed and car of one machine at ``now_us``."""
        place = self._history.places.by_node[node]
        aboard = self._history.loads.aboard.get(node)
        told: Json = {
            "track": place.segment.track,
            "index": place.segment.index,
            "offset_mm": place.offset_mm,
            "speed_mm_s": place.speed_mm_s,
            "since_us": place.told_us or 0,
            "where": self._where(place.segment),
            "car": self.words.load(aboard) if aboard is not None else None,
            "plan": self._plan(node, now_us),
            "holds": self._held(node),
        }
        for name, known in (("doors", self._doors), ("bay", self._bays), ("shuttle", self._shuttles)):
            if node in known:
                told[name] = known[node]
        if node in self._desks:
            told["desk"] = self._desks[node]
        return told

    def _where(self, segment: Segment) -> str:
        lift = lift_at(self.site, segment)
        if lift is not None:
            return f"in {self.words.machine(self.site.stewards[lift])}"
        segment = self.site.mouths.get(segment, segment)
        track = self.site.tracks.get(segment.track)
        if track is None or track.kind is not TrackKind.LIFT:
            return str(segment)
        sill = track.joins[max(0, min(len(track.joins), segment.index) - 1)]
        return f"floor {self.site.level(sill.track)}"

    def _plan(self, node: int, now_us: int) -> list[list[int]]:
        """What is left of a firm itinerary: [track, from, to, begin us, end us, is a ride or work] a leg."""
        plan = self._history.plans.firm.get(node)
        if plan is None:
            return []
        legs, begin_us = [], self._clock.log_us(plan.stamp.award_ms, now_us)
        for leg in plan.legs:
            end_us = self._clock.log_us(leg.end_ms, now_us)
            if begin_us is None or end_us is None:
                return []
            if end_us > now_us and leg.action is not LegAction.STAND:
                legs.append([leg.track, leg.from_index, leg.to_index, begin_us, end_us, int(leg.action)])
            begin_us = end_us
        return legs

    def _held(self, node: int) -> list[list[int]]:
        if self.site.machines[node].kind is not KindCode.ROBOT:
            return []
        return [[number >> 8, number & 0xFF] for number in self._history.rights.held_by(node, TokenKind.SEGMENT)]


#: Room between two floors of the picture, mm, with a floor's name in it.
_GAP_MM = 3_000
#: Width of the page's picture by its height: floors are put beside each other where that makes them larger.
_ASPECT = 1.7


def _elevation(site: CarPark) -> Json:
    """Where the floors' alleys lie: heights by the lifts, and shifts where the shaft is at their right ends."""
    heights_mm = level_heights_mm(site)
    alleys = [track for track in site.tracks.values() if track.kind is TrackKind.ALLEY]
    return {
        "building": None,
        "heights_mm": {track.number: heights_mm[site.level(track.number)] for track in alleys},
        "shifts": shifts(site),
    }


def _building(site: CarPark) -> Json:
    """Where everything is drawn, mm, x to the right and y down: floors in rows, the highest first.

    A line is where a track's index 1 is, and which way its index grows; a platform has a place for each of its stops.
    """
    outlines = Outlines(site)
    levels = outlines.levels
    boxes = [outlines.level(level) for level in levels]
    left, low = min(box.left for box in boxes), min(box.low for box in boxes)
    wide = max(box.right for box in boxes) - left + _GAP_MM
    high = max(box.high for box in boxes) - low + _GAP_MM
    columns = max(
        range(1, len(levels) + 1), key=lambda many: min(_ASPECT / (many * wide), 1 / (_rows(levels, many) * high))
    )
    corner = {level: (at % columns * wide, at // columns * high + _GAP_MM) for at, level in enumerate(levels)}
    top = high - _GAP_MM

    def spot(level: int, x_mm: float, y_mm: float) -> list[float]:
        x, y = corner[level]
        return [x + x_mm - left, y + top - (y_mm - low)]

    lines = outlines.plan.lines
    return {
        "width": columns * wide,
        "height": _rows(levels, columns) * high + _GAP_MM,
        "reach_mm": site.shuttle_reach_mm,
        "links": [[track.number, index, *mouth] for track in site.tracks.values() for index, mouth in track.ends],
        "floors": [[level, corner[level][0], corner[level][1]] for level in levels],
        "lines": {
            number: [*spot(site.level(number), line.x_mm, line.y_mm), line.dx, -line.dy]
            for number, line in lines.items()
        },
        "platforms": {
            lift: [spot(site.level(sill.track), *outlines.plan.shafts[lift]) for sill in site.tracks[lift].joins]
            for lift in site.lifts
        },
    }


def _rows(levels: list[int], columns: int) -> int:
    return -(-len(levels) // columns)


SCENE = CarParkScene
