"""The options of a design: a site file with so many robots, lifts and compartments, made from another.

What the template has is kept as far as it goes. More compartments come into its compartments' alleys, where the gap is
widest; more lifts at free ends of the floors' own alleys, then behind lobbies beside them; more robots into refuges,
for which spurs are added where there are too few, those of the street first.
"""

import tomllib
from collections.abc import Iterable, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.design.toml_text import toml_text
from onboard.config.arguments import whole
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.contract.codes import KindCode, Side
from onboard.core.site import Segment
from onboard.systems.car_park.room import refuge_tracks
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.refuges import open_refuges
from onboard.ways.roads import roads_of
from onboard.ways.room import kept_free
from onboard.ways.site import TrackKind

_LETTERS = {Side.NEAR: "N", Side.FAR: "F"}
_SIDES = {Side.NEAR: "near", Side.FAR: "far"}


class Size(NamedTuple):
    """How many machines of each kind."""

    robots: int
    lifts: int
    compartments: int

    def __str__(self) -> str:
        words = zip(self, ("robot", "lift", "compartment"), strict=True)
        return ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in words)


class SizeError(ValueError):
    """A site of this size cannot be made of the template; one line says why."""


@dataclass(frozen=True)
class Option:
    """A site of one size: its file's text, and what that is."""

    size: Size
    text: str
    site: CarPark


def size_of(site: CarPark) -> Size:
    """The size of a site."""
    return Size(len(site.robots), len(site.lifts), len(site.compartments))


def option_of(template: str, name: str, size: Size) -> Option:
    """The site file of a size. Raises ``SizeError`` where the template has no room for it."""
    values = tomllib.loads(template)
    own = Size(*(len(values.get(kind, [])) for kind in ("robots", "lifts", "compartments")))
    if size == own:
        return Option(size, template, car_park(parse_site(template, name)))
    return _Maker(values, name, size).make()


class _Maker:
    """Adds and takes away, kind by kind; each step reads what the steps before came to."""

    def __init__(self, values: dict[str, Any], name: str, size: Size) -> None:
        self._values, self._name, self._size = deepcopy(values), name, size

    def make(self) -> Option:
        values, size = self._values, self._size
        robots = values.get("robots", [])
        homes = list(robots)
        # Where robots rest is known once all else stands; a lone one finds room on any site.
        values["robots"] = robots[:1]
        for kind, count in (("lifts", size.lifts), ("compartments", size.compartments)):
            values[kind] = values.get(kind, [])[:count]
            if not values[kind]:
                del values[kind]
        self._drop_stewards(robots)
        for _ in range(size.compartments - len(values.get("compartments", []))):
            self._add_compartment(self._site())
        for _ in range(size.lifts - len(values.get("lifts", []))):
            self._add_lift(self._site())
        self._make_room()
        self._add_robots(homes)
        values["site"]["name"] = f"{values['site'].get('name', 'site')}-{size.robots}-{size.lifts}-{size.compartments}"[
            :32
        ]
        text = toml_text(values)
        try:
            return Option(size, text, car_park(parse_site(text, self._name)))
        except ConfigError as error:
            raise SizeError(str(error).splitlines()[0]) from error

    def _site(self) -> CarPark:
        try:
            return car_park(parse_site(toml_text(self._values), self._name, crowded=True))
        except ConfigError as error:
            raise SizeError(str(error).splitlines()[0]) from error

    def _drop_stewards(self, robots: Sequence[dict[str, Any]]) -> None:
        names = {one.get("name") for kind in ("lifts", "compartments") for one in self._values.get(kind, [])}
        stewards = self._values.pop("stewards", {})
        kept = {track: name for track, name in stewards.items() if name in names}
        if kept:
            self._values["stewards"] = kept

    def _machine(self, kind: str, stem: str) -> dict[str, Any]:
        """A table with a name and a node-ID that are free; fixed machines have the low ones."""
        machines = [one for each in ("compartments", "lifts", "robots") for one in self._values.get(each, [])]
        names, nodes = {one["name"] for one in machines}, {one["node"] for one in machines}
        number = next(count for count in range(1, 252) if f"{stem}{count}" not in names)
        node = next((one for one in range(1 if kind != "robots" else 101, 251) if one not in nodes), None)
        if node is None:
            raise SizeError(f"{self._size}: no node-ID is left; a site has at most 250 machines")
        return {"name": f"{stem}{number}", "node": node}

    # --- compartments ------------------------------------------------------------------------------------------

    def _add_compartment(self, site: CarPark) -> None:
        known = self._values["compartments"]
        streets = {station.track: station.side for station in site.compartments.values()}
        free = [
            one for one in site.places if streets.get(one.track) is one.side and not site.place_class.get(one.number)
        ]
        at = _in_widest_gap([one.segment for one in free], _in_use(site))
        if at is None:
            raise SizeError(f"{self._size}: no room for a compartment beside {len(known)} others")
        table = self._machine("compartments", known[0]["name"].rstrip("0123456789"))
        table |= {"at": _words(site, at), "side": _SIDES[streets[at.track]]}
        like = known[(len(known)) % len({one.get("use", "both") for one in known})]
        known.append(table | ({"use": like["use"]} if "use" in like else {}))

    # --- lifts -------------------------------------------------------------------------------------------------

    def _add_lift(self, site: CarPark) -> None:
        known = self._values.setdefault("lifts", [])
        stem = known[0]["name"].rstrip("0123456789") if known else "L"
        table = self._machine("lifts", stem)
        ends = {one.get("end") for one in known}
        for end in ("left", "right"):
            if end not in ends and self._takes(known, table | {"end": end}):
                return
        floors = [
            one for one in site.tracks.values() if one.kind is TrackKind.ALLEY and one.number not in site.alley_names
        ]
        shared = range(1, min(one.length for one in floors if not one.ends) + 1)
        own = [one.number for one in floors if not one.ends]
        columns = [index for index in shared if self._is_free_on_all(site, own, index)]
        used = {segment.index for segment in _in_use(site) if segment.track in own}
        for side in ("F", "N"):
            ranked = sorted(columns, key=lambda index: (-min((abs(index - one) for one in used), default=99), index))
            if any(self._takes(known, table | {"doors": [f"p(*,{index}){side}"]}) for index in ranked[:4]):
                return
        raise SizeError(f"{self._size}: no room for a lift beside {len(known)} others")

    def _is_free_on_all(self, site: CarPark, tracks: Iterable[int], index: int) -> bool:
        return not {Segment(track, index) for track in tracks} & _in_use(site)

    def _takes(self, known: list[dict[str, Any]], table: dict[str, Any]) -> bool:
        known.append(table)
        try:
            self._site()
        except SizeError:
            known.pop()
            return False
        return True

    # --- robots ------------------------------------------------------------------------------------------------

    def _make_room(self) -> None:
        """Spurs until each robot finds a refuge."""
        count = self._size.robots
        tried: set[Segment] = set()
        while count > (room := len(refuge_tracks(site := self._site(), 2 if count > 1 else 1))):
            streets = {station.track for station in site.compartments.values()}
            tracks = [one for one in site.tracks.values() if one.kind is TrackKind.ALLEY and not one.ends]
            spurs = [track.low.track for track in site.tracks.values() if track.kind is TrackKind.SPUR and track.low]
            order = sorted(tracks, key=lambda one: (spurs.count(one.number), one.number not in streets, one.number))
            at = None
            for track in order:
                free = [one.segment for one in site.places if one.track == track.number and one.segment not in tried]
                at = _in_widest_gap(free, _in_use(site))
                if at is not None:
                    break
            if at is None:
                raise SizeError(f"{self._size}: refuges for {room} robots, and no room for another spur")
            tried.add(at)
            sides = [one.side for one in site.places if one.segment == at]
            side = Side.FAR if Side.FAR in sides else sides[0]
            spurs_now = self._values.setdefault("spurs", [])
            spurs_now.append({"at": _words(site, at), "side": _SIDES[side]})
            if not self._is_roomier(room):
                spurs_now.pop()

    def _is_roomier(self, room: int) -> bool:
        try:
            return len(refuge_tracks(self._site(), 2)) > room
        except SizeError:
            return False

    def _add_robots(self, templates: list[dict[str, Any]]) -> None:
        """Homes of the template where they are refuges still, then the free refuges nearest to the bays."""
        values, count = self._values, self._size.robots
        site = _with_robots(self._site(), count)
        fronts = frozenset(station.segment for station in site.compartments.values())
        roads = roads_of(site)
        taken: list[Segment] = []
        stem = templates[0]["name"].rstrip("0123456789") if templates else "MR"
        values["robots"] = []
        allowed = set(refuge_tracks(site, 2 if count > 1 else 1))
        for table in templates[:count]:
            home = self._home(table)
            if home in open_refuges(site, taken) and home.track in allowed:
                values["robots"].append(table)
                taken.append(home)
        while len(taken) < count:
            free = [one for one in open_refuges(site, taken) if one.track in allowed and one not in kept_free(site)]
            free = [one for one in free if one.track not in {home.track for home in taken}] or free
            if not free:
                raise SizeError(f"{self._size}: homes for {len(taken)} robots only")
            home = min(free, key=lambda one: (roads.nearest_us(one, fronts), one))
            values["robots"].append(self._machine("robots", stem) | {"home": _words(site, home)})
            taken.append(home)

    def _home(self, table: dict[str, Any]) -> Segment:
        """Where a robot of the template is at home, as the site stands now."""
        kept, self._values["robots"] = self._values["robots"], [table]
        try:
            return next(one.home for one in self._site().machines.values() if one.name == table["name"])
        except SizeError:
            return Segment(0, 0)
        finally:
            self._values["robots"] = kept


def _with_robots(site: CarPark, count: int) -> CarPark:
    """The same site with so many robots, wherever they are: where a robot may rest depends on whether it is alone."""
    like = next(one for one in site.machines.values() if one.kind is KindCode.ROBOT)
    more = {-number: replace(like, node_id=-number) for number in range(1, count)}
    return replace(site, machines={**site.machines, **more})


def _in_use(site: CarPark) -> set[Segment]:
    """Sills, mouths and fronts: what is put beside an alley keeps away from these."""
    return set(kept_free(site))


def _in_widest_gap(free: Iterable[Segment], used: Iterable[Segment]) -> Segment | None:
    """The free segment that is farthest from what is in use on its track; the lowest of several; not one in use."""
    used = set(used)

    def gap(one: Segment) -> int:
        return min((abs(one.index - other.index) for other in used if other.track == one.track), default=99)

    left = sorted({one for one in free if one not in used})
    return max(left, key=lambda one: (gap(one), -one.track, -one.index), default=None)


def _words(site: CarPark, at: Segment) -> str:
    """A position as a site file writes it."""
    name = site.alley_names.get(at.track)
    return f"p({site.level(at.track)},{name},{at.index})" if name else f"p({at.track},{at.index})"


def parse_range(option: str, text: str, least: int, most: int) -> range:
    """``A-B`` or one number. Raises ``DemandError``."""
    first, dash, last = text.partition("-")
    low, high = whole(first), whole(last if dash else first)
    if low is None or high is None or not least <= low <= high <= most:
        raise DemandError(f"{option} {text}: must be a number from {least} to {most}, or first and last such as 2-6")
    return range(low, high + 1)
