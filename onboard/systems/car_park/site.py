"""What a robotized car park has beyond any other site: cars, shuttles, and when lifts are asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar

from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals
from onboard.core.site import MotionNeeds, Site, Station
from onboard.systems.car_park.battery import Battery
from onboard.ways.site import Axis, WaySite
from onboard.work.timing import DeviceTiming


@dataclass(frozen=True, slots=True)
class CarLimits:
    """What cars the park takes (row P33); all in mm and kg. ``max_width_mm`` 0: the file limits none."""

    min_wheelbase_mm: int
    max_wheelbase_mm: int
    max_length_mm: int
    max_height_mm: int
    max_load_kg: int
    max_width_mm: int = 0


@dataclass(frozen=True, slots=True)
class SizeClass:
    """A class of places and of cars: what fits, in mm and kg, and whether it is charged there.

    ``max_width_mm`` 0: whatever the park takes.
    """

    name: str
    max_length_mm: int
    max_height_mm: int
    max_load_kg: int
    charging: bool = False
    max_width_mm: int = 0

    def covers(self, other: "SizeClass") -> bool:
        """Whether all that fits ``other`` fits here."""
        fits = self.max_length_mm >= other.max_length_mm and self.max_height_mm >= other.max_height_mm
        fits = fits and (not self.max_width_mm or 0 < other.max_width_mm <= self.max_width_mm)
        return fits and self.max_load_kg >= other.max_load_kg and (self.charging or not other.charging)


#: A car of no class: it goes only where every car of the site can go.
ANY_CLASS = 0
#: Most classes that a site may have: four bits.
MOST_CLASSES = 15
#: A car that asks for a place to charge and fits into no such class: no place takes it, and nobody calls for it.
NO_CLASS = MOST_CLASSES + 1


#: Numbers of no station: in a call for parking, wherever a car of class 1, 2 ... can stand, behind this.
_OPEN_END = 0xFF00


def open_end(car_class: int) -> int:
    """What a call names in the stead of a station where any will do that takes cars of a class."""
    return ANY_STATION if car_class == ANY_CLASS else _OPEN_END + car_class


def class_of_end(station: int) -> int | None:
    """The class of car for which an end of a call is open; None for a station's own number."""
    if station == ANY_STATION:
        return ANY_CLASS
    return station - _OPEN_END if _OPEN_END < station <= _OPEN_END + MOST_CLASSES else None


def open_class(call: CallForProposals) -> int | None:
    """The class of car for which a call leaves an end open, None where it names both."""
    found = [class_of_end(end) for end in (call.from_station, call.to_station)]
    return next((one for one in found if one is not None), None)


def end_at(end: int, place: Station) -> Station:
    """The station that an end of a call means: its own, or ``place`` where it is open."""
    return Station.from_number(end) if class_of_end(end) is None else place


def one_a_segment(places: list[Station]) -> list[Station]:
    """The first of each segment's places: both sides are reached and served alike."""
    return list({place.segment: place for place in reversed(places)}.values())


class RideCalls(Enum):
    """How a robot comes by the rides of a task (row P39).

    PLANNED around everybody's itineraries and told in its own; or asked of the lifts BEFORE its bid, by sub-calls as
    options. Nobody calls for a ride that a firm itinerary tells.
    """

    PLANNED = "planned"
    BEFORE = "before"


class CallAt(Enum):
    """When a compartment calls for a robot.

    With the KEY, and for a car to be fetched once the bay is locked for it: the order of the paper (row P50); or when
    somebody ARRIVES, at the bay or with a ticket, while the bay still works for whoever was before.
    """

    KEY = "key"
    ARRIVAL = "arrival"


class RestAt(Enum):
    """Where a robot with nothing to do stands.

    In the refuge that was NEAREST when its last work was done; or it goes on, after a rest, to the one from which by
    DEMAND heard on the bus the next call is likely to be met soonest.
    """

    NEAREST = "nearest"
    DEMAND = "demand"


class DeskPolicy(Enum):
    """To which compartment a car is fetched, whichever desk has read its ticket.

    ANY: to that desk's own. NEAREST: to the one that suits it, by its way there and by who waits there. OWN: to the one
    at which it came in; where that is off, or gives no cars out, to the one that suits it.
    """

    ANY = "any"
    NEAREST = "nearest"
    OWN = "own"


class PlacePolicy(Enum):
    """Which of the free places a car is parked in.

    NEAREST: where it stands soonest. COST: by that and by what its fetch will cost. STAY: near for short stays, far for
    long ones, by what was heard of stays. BALANCED: in the alley that is least full. RANDOM: in any, drawn by its name.
    """

    NEAREST = "nearest"
    COST = "cost"
    STAY = "stay"
    BALANCED = "balanced"
    RANDOM = "random"


@dataclass(frozen=True, kw_only=True)
class CarPark(WaySite):
    """A robotized car park (rows P30 to P33)."""

    system: ClassVar[str] = "car-park"
    called: ClassVar[str] = "car park"
    has_regeneration: ClassVar[bool] = True
    #: When a compartment calls is its own affair: nobody is a stranger to one that calls at another moment.
    demand: ClassVar[frozenset[str]] = frozenset({"call_at"})
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {
        "DriveOrder": MotionNeeds.RIGHT,
        "ShuttleOrder": MotionNeeds.RIGHT,
        "DoorOrder": MotionNeeds.PLACE,
    }

    timing: DeviceTiming
    shuttle: Axis
    shuttle_reach_mm: int
    cars: CarLimits
    rides: RideCalls = RideCalls.PLANNED
    call_at: CallAt = CallAt.ARRIVAL
    rest_at: RestAt = RestAt.NEAREST
    desk: DeskPolicy = DeskPolicy.ANY
    place: PlacePolicy = PlacePolicy.NEAREST
    #: Whether cars are brought nearer to where they are fetched while nobody waits.
    quiet_moves: bool = False
    #: Whether a bid brings its tentative itinerary: to be seen, as in the paper; nobody plans around it.
    tells_offers: bool = False
    #: Whether a compartment tells who asks for a car when it will be there.
    promises: bool = False
    #: In the order in which a car is tried against them; numbers are from 1.
    classes: tuple[SizeClass, ...] = ()
    #: What robots run on; None: on power that does not end.
    battery: Battery | None = None
    #: Number of a place's class by its station's number; who is not named takes every car of the site.
    place_class: dict[int, int] = field(default_factory=dict)
    #: What the file calls alleys beside the one that each floor has by itself, by track number.
    alley_names: dict[int, str] = field(default_factory=dict)

    @property
    def measures_width(self) -> bool:
        """Whether compartments measure how wide a car is: where the file limits it anywhere."""
        return self.cars.max_width_mm > 0 or any(one.max_width_mm for one in self.classes)

    def car_class(
        self, length_mm: int, height_mm: int, load_kg: int, width_mm: int = 0, *, charging: bool = False
    ) -> int:
        """The first class that a car fits; without one ``ANY_CLASS``, for who asks to charge ``NO_CLASS``."""
        for number, one in enumerate(self.classes, start=1):
            fits = length_mm <= one.max_length_mm and height_mm <= one.max_height_mm and load_kg <= one.max_load_kg
            if fits and one.charging is charging and (not one.max_width_mm or width_mm <= one.max_width_mm):
                return number
        return NO_CLASS if charging else ANY_CLASS

    def charges(self, car_class: int) -> bool:
        """Whether cars of a class ask for a place to charge."""
        return car_class == NO_CLASS or (0 < car_class <= len(self.classes) and self.classes[car_class - 1].charging)

    def takes(self, place: Station, car_class: int) -> bool:
        """Whether every car of a class can stand at a place."""
        number = self.place_class.get(place.number, ANY_CLASS)
        if number == ANY_CLASS:
            return not self.charges(car_class)
        return 0 < car_class <= len(self.classes) and self.classes[number - 1].covers(self.classes[car_class - 1])

    def best_for(self, car_class: int, places: list[Station]) -> list[Station]:
        """Of these those that take a class, in their order; who does not charge gets a place for it only at last."""
        taking = [place for place in places if self.takes(place, car_class)]
        plain = [place for place in taking if not self.charges(self.place_class.get(place.number, ANY_CLASS))]
        return taking if self.charges(car_class) else plain or taking


def car_park(site: Site) -> CarPark:
    """The same site, for those that only a car park has. A machine of another system never asks."""
    assert isinstance(site, CarPark), f"site {site.name} is no car park"
    return site
