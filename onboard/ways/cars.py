"""What is known of the things that machines pass on (``CarAt`` on the wire): where each stands, in whose custody.

Whose word about one counts is told in ``onboard.ways.car_words``.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Message, Reference, TokenGrant, TokenHeld
from onboard.core.authority import TokenBook
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Record
from onboard.core.mirror import Mirror, digest_words
from onboard.core.records import RetiredRecord
from onboard.core.serial import is_newer
from onboard.core.site import Station
from onboard.core.token_keys import TokenKey
from onboard.ways.car_words import VERSION_BITS, CarWords, KnownCar
from onboard.ways.tokens import car_token

#: Cars that have left and are still remembered; bounds the memory of a machine that runs for years.
MAX_GONE_CARS = 64


@dataclass
class _StandingCars:
    """Cars that have not left, as the digest takes them: number and station, in the order of the numbers.

    With hundreds of cars each word about one would otherwise go through all of them, and each look at a place. So what
    one origin's cars come to is kept until one of them moves, and which stand in a station.
    """

    words: dict[int, dict[int, bytes]] = field(default_factory=dict)
    #: Cars by the station in which they stand, and the other way round.
    at: dict[int, set[Reference]] = field(default_factory=dict)
    _stations: dict[Reference, int] = field(default_factory=dict)
    _joined: dict[int, bytes] = field(default_factory=dict)

    def put(self, car: Reference, station: int) -> None:
        """A car stands there, or has left."""
        before = self._stations.pop(car, OUTSIDE)
        if before != OUTSIDE:
            self.at[before].discard(car)
        if station != OUTSIDE:
            self._stations[car] = station
            self.at.setdefault(station, set()).add(car)
        self._joined.pop(car.origin, None)
        numbers = self.words.setdefault(car.origin, {})
        if station == OUTSIDE:
            numbers.pop(car.number, None)
        else:
            numbers[car.number] = digest_words([car.origin << 16 | car.number, station])

    def joined(self) -> bytes:
        """Of all cars; nothing where there are none."""
        for origin in self.words.keys() - self._joined.keys():
            self._joined[origin] = b"".join(words for _, words in sorted(self.words[origin].items()))
        return b"".join(words for _, words in sorted(self._joined.items()))


@dataclass
class CarMirror(Mirror):
    """The mirror of a site where machines pass things on: these by custodian."""

    vouching: ClassVar[tuple[type[Message], ...]] = (CarAt,)
    digested: ClassVar[tuple[type[Message], ...]] = (*Mirror.digested, CarAt)

    cars: dict[Reference, KnownCar] = field(default_factory=dict)
    #: Where cars stand whose custody came to this machine as rights were made anew, by who remembers it.
    taken_over: dict[Reference, CarAt] = field(default_factory=dict)
    #: Who wants to know that a car which left long ago is remembered no longer.
    on_forgotten: list[Callable[[Reference], object]] = field(default_factory=list)
    #: The journal's line for where a car in my custody stands, where there is one.
    note: Callable[[CarAt], Effect] | None = None
    words: CarWords | None = None
    _recalled: dict[Reference, CarAt] = field(default_factory=dict)
    _left: list[Reference] = field(default_factory=list)
    _standing: _StandingCars = field(default_factory=_StandingCars)

    def joins(self, tokens: TokenBook, drops: Counter[Reason]) -> None:
        """From now on a word counts only from a custodian; cars that left long ago have no token any more."""
        super().joins(tokens, drops)
        self.words = CarWords(self.node_id, tokens, drops, self.cars, self.on_car)

        def retire(car: Reference) -> None:
            if tokens.retire(car_token(*car)):
                self._left.append(car)

        self.on_forgotten.append(retire)

    def handlers(self) -> dict[type[Message], Callable[[Any, int], list[Effect]]]:
        """Words about cars as well."""
        return {**super().handlers(), CarAt: self._hear_car}

    def _hear_car(self, statement: CarAt, now_us: int) -> list[Effect]:
        if self.is_frozen():
            known = self._recalled.get(statement.car)
            if known is None or statement.version > known.version:
                self._recalled[statement.car] = statement
        elif self.words is not None:
            self.words.hear(statement)
        return []

    def settle(self, word: TokenGrant | TokenHeld) -> Message | None:
        """A word about a car that what was just heard of its token has proven."""
        if self.words is None or word.token_kind is not TokenKind.CAR:
            return None
        return self.words.settle(TokenKey(word.token_kind, word.token))

    def on_car(self, statement: CarAt) -> bool:
        """Take up a custodian's statement; True where it changed anything."""
        known = self.cars.get(statement.car)
        record = KnownCar(statement.station, statement.sender, statement.version, statement.wheelbase_mm)
        if known == record:
            return False
        if known is not None and not is_newer(statement.version, known.version, VERSION_BITS):
            # One version of a car's token has one custodian: whoever else speaks under it is wrong.
            again = statement.version == known.version and statement.sender == known.custodian
            if not again:
                return False
        self.cars[statement.car] = record
        self._standing.put(statement.car, record.station)
        self._digest = None
        if record.station == OUTSIDE:
            self._prune_gone()
        return True

    def _prune_gone(self) -> None:
        """Keep the last cars that left, so that a late statement about them is still known to be old."""
        if len(self.cars) <= MAX_GONE_CARS:
            return
        gone = [car for car, record in self.cars.items() if record.station == OUTSIDE]
        for car in gone[: max(0, len(gone) - MAX_GONE_CARS)]:
            del self.cars[car]
            for listener in self.on_forgotten:
                listener(car)

    def drop_car(self, car: Reference) -> None:
        """What I believed of a car is wrong; whoever knows better says so."""
        del self.cars[car]
        self._standing.put(car, OUTSIDE)
        self._digest = None

    def car_station(self, car: Reference) -> Station | None:
        """Where a car stands, or None where it is unknown or aboard a machine."""
        record = self.cars.get(car)
        if record is None or record.station in (ANY_STATION, OUTSIDE):
            return None
        return Station.from_number(record.station)

    def cars_in(self, station: Station) -> list[Reference]:
        """Cars that stand in a station, in the order in which they were first heard of."""
        found = self._standing.at.get(station.number, set())
        return [car for car in self.cars if car in found] if len(found) > 1 else list(found)

    def _believed(self) -> bytes:
        """Cars (number, station) that have not left."""
        return super()._believed() + self._standing.joined()

    def forgotten(self) -> list[Effect]:
        """Cars that left long ago, for the journal: what it has of them may go."""
        left, self._left = self._left, []
        return [Record(RetiredRecord(TokenKind.CAR, car_token(*car).number, car)) for car in left]

    def is_laden(self, node: int) -> bool:
        """Whether a machine has a car aboard."""
        return any(record.custodian == node and record.station == ANY_STATION for record in self.cars.values())

    def is_false(self, message: Message) -> bool:
        """Whether a word under my number says of a car what I never said."""
        if not isinstance(message, CarAt):
            return super().is_false(message)
        known = self.cars.get(message.car)
        if known is None or is_newer(message.version, known.version, VERSION_BITS):
            return True
        said = (self.node_id, message.station)
        return message.version == known.version and (known.custodian, known.station) != said

    # --- rights that are made anew -----------------------------------------------------------------------------

    def recalls(self) -> None:
        """Who remembers where a car of the lost machine is says so from now on."""
        self._recalled.clear()

    def vouched(self, node: int) -> dict[TokenKey, tuple[int, Message]]:
        """Cars in the custody of ``node`` that have not left, as I remember them."""
        return {
            car_token(*car): (
                record.version,
                CarAt(self.node_id, car, record.station, record.version, record.wheelbase_mm),
            )
            for car, record in self.cars.items()
            if record.custodian == node and record.station != OUTSIDE
        }

    def takes_over(self, versions: Mapping[TokenKey, int], *, counts: bool) -> list[Effect]:
        """These cars are in my custody: where they stand by who remembers it, for my behaviour to take up."""
        taken = {car: one for car, one in self._recalled.items() if car_token(*car) in versions}
        self.taken_over.update(taken if counts else {})
        words = [replace(one, sender=self.node_id, version=versions[car_token(*car)]) for car, one in taken.items()]
        return [self.note(word) for word in words] if self.note else []

    def disown(self) -> None:
        """What I have said of cars came from a journal that is old: whoever knows better says so, or nobody does."""
        for car in [car for car, record in self.cars.items() if record.custodian == self.node_id]:
            self.drop_car(car)

    def remembers(self, word: CarAt) -> None:
        """My journal knew where a car stands that is mine once the list counts which I have read back."""
        self._recalled[word.car] = word


@dataclass
class CarFleet(Fleet):
    """What a machine works with that passes things on."""

    mirror_type: ClassVar[type[Mirror]] = CarMirror

    mirror: CarMirror


def car_mirror(mirror: Mirror) -> CarMirror:
    """The same mirror, for machines that pass things on. Raises ``TypeError`` for any other."""
    if not isinstance(mirror, CarMirror):
        raise TypeError(f"node {mirror.node_id}: its mirror knows nothing that is passed on")
    return mirror


def car_fleet(fleet: Fleet) -> CarFleet:
    """The same fleet, for machines that pass things on. Raises ``TypeError`` for any other."""
    if not isinstance(fleet, CarFleet):
        raise TypeError(f"node {fleet.node_id}: its mirror knows nothing that is passed on")
    return fleet
