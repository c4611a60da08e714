"""How the custody of a car is passed on: its token, and the word where it stands, together or not at all.

Whoever has put a car down says where (CarAt) and gives its token away. A frame can be missed, and a token without the
place would leave the new custodian saying what it last heard, under the newest version, so that all others believe it.
So the giver journals the place first and says it again with each repeated grant, and the keeper of a station takes a
car's token only when it has heard from the giver that the car stands there; its own journal knows the place before it
knows the token.
"""

from collections.abc import Container, Iterable

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Reference, TokenGrant
from onboard.core.authority import TokenKey
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment, Station
from onboard.core.token_keys import station_token
from onboard.systems.car_park.bay_memory import car_record
from onboard.ways.mirror import WayFleet, WayMirror
from onboard.ways.site import WaySite
from onboard.ways.tokens import car_token


def keeper(site: WaySite, station: Station) -> int:
    """Node that keeps a station's token and its car: the compartment itself, else the track's steward."""
    for node_id, bay in site.compartments.items():
        if bay == station:
            return node_id
    return site.stewards[station.track]


def keeps(fleet: WayFleet, number: int) -> bool:
    """Whether what stands in a station (number, as heard) is this machine's to keep."""
    station = Station.from_number(number)
    return station.track in fleet.site.stewards and keeper(fleet.site, station) == fleet.node_id


def car_of(grant: TokenGrant) -> Reference:
    """The car that a grant of a car's token is about."""
    return Reference(grant.token >> 16, grant.token & 0xFFFF)


def state(fleet: WayFleet, car: Reference, station: int, wheelbase_mm: int) -> list[Effect]:
    """Journal and say where a car in my custody is; what somebody else holds is its custodian's to say: nothing.

    Nothing either of a car of whose right no version is known: after a lost journal its bay has it by name alone.
    """
    key = car_token(*car)
    if not fleet.tokens.holds(key) or key not in fleet.tokens.seen:
        return []
    statement = CarAt(fleet.node_id, car, station, fleet.tokens.seen[key], wheelbase_mm)
    fleet.mirror.on_car(statement)
    return [car_record(statement), Send(statement)]


def place_of(fleet: WayFleet, car: Reference) -> Station | None:
    """The place that a car stands in; None while it is in a bay or aboard: its entry is still under way."""
    station = fleet.mirror.car_station(car)
    return station if station not in fleet.site.compartments.values() else None


def others_in(mirror: WayMirror, station: Station, car: Reference | None = None) -> list[Reference]:
    """Cars that stand in a station by their custodians' word, other than ``car``."""
    return [one for one in mirror.cars_in(station) if one != car]


def replay(fleet: WayFleet, statements: Iterable[CarAt]) -> None:
    """Take up what the journal tells of cars in my custody, and of those whose new custodian was not heard yet.

    What was said under an older version is no knowledge of the place: the car has been elsewhere since. From now on
    what others remember of a car that comes with rights made anew is journalled as well.
    """
    tokens, fleet.mirror.note = fleet.tokens, car_record
    fleet.mirror.disown()
    for one in statements:
        key = car_token(*one.car)
        leaving = tokens.leaving.get(key)
        given = leaving is not None and leaving.version == one.version + 1
        if given or tokens.held.get(key) == one.version:
            fleet.mirror.on_car(one)
        elif one.version > tokens.seen.get(key, 0):
            fleet.mirror.remembers(one)


def statements(fleet: WayFleet) -> list[Effect]:
    """Where each car in my custody is that has not left.

    Whoever has a car's token and has not moved it yet says where it stands: its giver may have lost that since.
    """
    mine: list[Effect] = [
        Send(CarAt(fleet.node_id, car, record.station, record.version, record.wheelbase_mm))
        for car, record in fleet.mirror.cars.items()
        if record.custodian == fleet.node_id and record.station != OUTSIDE
    ]
    for key in [key for key in fleet.tokens.mine() if key.kind is TokenKind.CAR]:
        car = Reference(key.number >> 16, key.number & 0xFFFF)
        record = fleet.mirror.cars.get(car)
        if record is not None and record.custodian != fleet.node_id and fleet.mirror.car_station(car) is not None:
            mine += state(fleet, car, record.station, record.wheelbase_mm)
    return mine


def before_grant(fleet: WayFleet, grant: TokenGrant) -> list[Effect]:
    """Where the car stood when I gave its token away, as long as nobody has said anything newer."""
    record = fleet.mirror.cars.get(car_of(grant)) if grant.token_kind is TokenKind.CAR else None
    if record is None or record.custodian != fleet.node_id or record.version + 1 != grant.version:
        return []
    return [Send(CarAt(fleet.node_id, car_of(grant), record.station, record.version, record.wheelbase_mm))]


def before_taking(fleet: WayFleet, grant: TokenGrant) -> list[Effect] | None:
    """What a keeper of stations journals before it becomes a car's custodian; None while its place is not known."""
    if grant.token_kind is not TokenKind.CAR:
        return []
    record = fleet.mirror.cars.get(car_of(grant))
    if (
        record is None
        or record.station in (ANY_STATION, OUTSIDE)
        or not keeps(fleet, record.station)
        or record.custodian != grant.sender
        or record.version + 1 != grant.version
    ):
        fleet.drops[Reason.MIRROR_BEHIND] += 1
        return None
    statement = CarAt(fleet.node_id, car_of(grant), record.station, grant.version, record.wheelbase_mm)
    fleet.mirror.on_car(statement)
    return [car_record(statement)]


def put_down(fleet: WayFleet, car: Reference, station: Station, now_us: int) -> list[Effect]:
    """A car of mine stands in a station whose right is mine: say so, and pass both on to who keeps the station."""
    record = fleet.mirror.cars[car]
    effects = state(fleet, car, station.number, record.wheelbase_mm)
    for key in (car_token(*car), station_token(station)):
        effects += fleet.tokens.give(key, keeper(fleet.site, station), now_us)
    return effects


def give_back(fleet: WayFleet, needed: Container[TokenKey], now_us: int) -> list[Effect]:
    """Return rights to stations and cars that no work of mine needs: their grants came after the work was dropped.

    A car goes with the word where it stands; one that is aboard, or that nobody has told of, is kept.
    """
    effects: list[Effect] = []
    for key in [key for key in fleet.tokens.mine() if key.kind is not TokenKind.SEGMENT and key not in needed]:
        if key.kind is TokenKind.STATION:
            effects += fleet.tokens.give(key, keeper(fleet.site, Station.from_number(key.number)), now_us)
            continue
        car = Reference(key.number >> 16, key.number & 0xFFFF)
        station, record = fleet.mirror.car_station(car), fleet.mirror.cars.get(car)
        if station is not None and record is not None:
            effects += state(fleet, car, station.number, record.wheelbase_mm)
            effects += fleet.tokens.give(key, keeper(fleet.site, station), now_us)
    return effects


def take_over(fleet: WayFleet) -> list[Effect]:
    """Cars that came to a robot as its rights were made anew: where they were by the last that anybody heard.

    Journalled and said under the version of now, so that another life knows of them as well.
    """
    taken, effects = fleet.mirror.taken_over, list[Effect]()
    for car in [car for car in taken if fleet.tokens.holds(car_token(*car))]:
        word = taken.pop(car)
        effects += state(fleet, car, word.station, word.wheelbase_mm)
    return effects


def said_aboard(fleet: WayFleet) -> list[Reference]:
    """Cars that this machine has said to be aboard it, and that are in its custody."""
    mine = (car for car, record in fleet.mirror.cars.items() if record.station == ANY_STATION)
    return [car for car in mine if is_mine(fleet, car)]


def held_beside(fleet: WayFleet, at: Segment) -> list[Station]:
    """Stations beside a slot whose right is mine."""
    held = (Station.from_number(key.number) for key in fleet.tokens.mine() if key.kind is TokenKind.STATION)
    return [station for station in held if station.segment == at]


def may_stand_in(fleet: WayFleet, at: Segment) -> list[Station]:
    """Stations beside a slot where a car may be that is said to be aboard and is not: those whose right is mine."""
    return [station for station in held_beside(fleet, at) if not others_in(fleet.mirror, station)]


def is_mine(fleet: WayFleet, car: Reference) -> bool:
    """Whether a car is in my custody: by the mirror, and by its token."""
    record = fleet.mirror.cars.get(car)
    is_custodian = record is not None and record.custodian == fleet.node_id
    return is_custodian and fleet.tokens.holds(car_token(*car))
