"""Messages in the words of a site: machines by name, places and loads as its system calls them, units, value names.

Units are the DBC's own; what a number means is known by the signal's name, which is the same in every message. What a
system has words of its own for, ``onboard.systems.words`` tells.
"""

from collections.abc import Callable, Iterable
from dataclasses import fields
from enum import IntEnum
from functools import cache, lru_cache, partial
from operator import attrgetter
from typing import Any, NamedTuple

from onboard.contract.codes import CONTRACT_VERSION, Criterion, LegAction, Side, TokenKind
from onboard.contract.messages import Bid, CallForProposals, Leg, Message, Reference, Stamp
from onboard.core.site import Site
from onboard.systems.words import SiteWords, plain, words_of

_NODES = frozenset({"initiator", "winner", "holder", "predecessor", "requester", "blocker", "whom", "compartment"}) | {
    "machine",
    "cause",
    "stopper",
    "believed",
}
_STATIONS = frozenset({"station", "from_station", "to_station"})
#: Bus times, to be told apart from lengths of time.
_MOMENTS = frozenset({"deadline_ms", "end_ms", "award_ms"})
_UNITS = (
    *(("_mm_s", "mm/s"), ("_us", "us"), ("_ms", "ms"), ("_mm", "mm"), ("_kg", "kg")),
    *(("_ct", "ct"), ("_um", "um"), ("_s", "s")),
)
#: Calls whose criterion is remembered, so that a bid's cost has its unit.
_CALLS_KEPT = 4096
#: Words that are remembered, of each field: more than the slots of a large site.
_KEPT = 4096
#: What takes a value out of a message, and what says it.
_Phrase = tuple[Callable[[Message], Any], Callable[[Any], str]]


class _Kind(NamedTuple):
    """How messages of one class are said: what comes before the first phrase, all phrases, and what they depend on."""

    begins: str
    phrases: tuple[_Phrase, ...]
    is_heard: bool
    is_fixed: bool


class Words:
    """Puts messages into words. It remembers the criterion of each call that it saw. ``site`` None: numbers only."""

    def __init__(self, site: Site | None = None) -> None:
        self.site = site
        self.system = words_of(site)
        #: Names of 255 nodes at most, and of nobody.
        self.machine = cache(self.system.machine)
        self.cost = self.system.cost
        self.reference = self.system.reference
        self._kinds: dict[type[Message], _Kind] = {}
        self._criteria: dict[tuple[int, int], Criterion] = {}
        self._is_forgetful = type(self.system).hear is SiteWords.hear
        self._way = self._kept(self._way_of)

    def hear(self, message: Message) -> None:
        """Remember what later words need; ``message`` does so by itself."""
        self.system.hear(message)
        if isinstance(message, CallForProposals):
            self._criteria[message.sender, message.call] = message.criterion
            if len(self._criteria) > _CALLS_KEPT:
                del self._criteria[next(iter(self._criteria))]

    def message(self, message: Message) -> str:
        """``MR1 Bid: initiator IOC1, call 1, cost 43.210 s, itinerary version 2``."""
        return self.said(message)[0]

    def said(self, message: Message) -> tuple[str, bool]:
        """The same, and whether this message is always said in the same words, whatever was said before."""
        begins, phrases, is_heard, is_fixed = self._kinds.get(type(message)) or self._kind(message)
        if is_heard:
            self.hear(message)
        words = ", ".join([say(taken(message)) for taken, say in phrases])
        return self.machine(message.sender) + begins + words, is_fixed

    def _kind(self, message: Message) -> _Kind:
        phrases, is_call = tuple(self._phrases_of(message)), isinstance(message, CallForProposals)
        begins = f" {type(message).__name__}{': ' if phrases else ''}"
        is_fixed = self._is_forgetful and not is_call and not isinstance(message, Bid)
        kind = _Kind(begins, phrases, is_call or not self._is_forgetful, is_fixed)
        self._kinds[type(message)] = kind
        return kind

    def _phrases_of(self, message: Message) -> Iterable[_Phrase]:
        """What a message of this class says; the values of a field are of one kind in all of them."""
        silent = {"sender", *self.system.silent}
        names = [field.name for field in fields(message) if field.name not in silent]
        # A token and a place are each said by two fields, and before the others.
        for first, second, say in (("token_kind", "token", self._token), ("track", "index", self._slot)):
            if first in names and second in names:
                names = [name for name in names if name not in (first, second)]
                yield attrgetter(first, second), self._kept(say)
        for name in names:
            if name == "cost" and isinstance(message, Bid):
                yield attrgetter("cost", "initiator", "call"), self._cost
            else:
                yield attrgetter(name), self._phrase(name, getattr(message, name))

    def _phrase(self, name: str, value: object) -> Callable[[Any], str]:
        """How a field is said, by its name and the kind of its values."""
        said = name_in_words(name)
        match value:
            case tuple() if name == "legs":
                return self._legs
            case Reference() if name in ("car", self.system.noun):
                return lambda reference: f"{self.system.noun} {self.system.load(reference)}"
            case Reference():
                return lambda reference: f"{said} {self.reference(reference)}"
            case Stamp():
                return lambda stamp: f"{said} {self._stamp(stamp)}"
            case IntEnum():
                return {one: f"{said} {plain(one.name)}" for one in type(value)}.__getitem__
            case bool():
                return (f"{said} no", f"{said} yes").__getitem__
            case int():
                return self._kept(partial(self._number, name, said))
        return lambda one: f"{said} {one}"

    def _kept(self, say: Callable[[Any], str]) -> Callable[[Any], str]:
        """Remembers what was said of a value, where nothing that is heard changes it."""
        return lru_cache(_KEPT)(say) if self._is_forgetful else say

    def _token(self, token: tuple[TokenKind, int]) -> str:
        kind, number = token
        if kind is not TokenKind.RUN:
            return f"token {self.system.resource(kind, number)}"
        first, last = number >> 16 << 8 | number >> 8 & 0xFF, number >> 16 << 8 | number & 0xFF
        return f"tokens {' to '.join(self.system.resource(TokenKind.SEGMENT, one) for one in (first, last))}"

    def _slot(self, place: tuple[int, int]) -> str:
        return f"at {self.system.slot(*place)}"

    def _cost(self, bid: tuple[int, int, int]) -> str:
        cost, initiator, call = bid
        return f"cost {self.cost(cost, self._criteria.get((initiator, call)))}"

    def _stamp(self, stamp: Stamp) -> str:
        return f"{_seconds(stamp.award_ms)} by {self.machine(stamp.initiator)} call {stamp.call}"

    def _number(self, name: str, said: str, value: int) -> str:
        own = self.system.signals.get(name)
        if own is not None:
            return f"{said} {own(value)}"
        if name in _NODES:
            return f"{said} {self.machine(value)}"
        if name in _STATIONS:
            return f"{said} {self.system.place(value)}"
        if name in _MOMENTS:
            return f"{said} {_seconds(value)}"
        if name.endswith("digest"):
            return f"{said} {value:04X}"
        if name == "contract" and value != CONTRACT_VERSION:
            return f"{said} {value} (this program reads {CONTRACT_VERSION})"
        return f"{said} {value}{unit_of(name)}"

    def _legs(self, legs: tuple[Leg, ...]) -> str:
        return "legs " + ("; ".join(map(self._leg, legs)) or "none")

    def _leg(self, leg: Leg) -> str:
        action, track, first, last, side, end_ms = leg
        return f"{self._way((action, track, first, last, side))} until {_seconds(end_ms)}"

    def _way_of(self, way: tuple[LegAction, int, int, int, Side]) -> str:
        action, track, first, last, side = way
        start, end = self.system.slot(track, first), self.system.slot(track, last)
        told = start if start == end else f"{start}..{end}"
        return f"{action.name.lower()} {told}" + (f" {side.name.lower()}" if action is LegAction.WORK else "")


@cache
def unit_of(name: str) -> str:
    """A space and the unit that a signal's name ends in; empty where it has none."""
    return next((f" {unit}" for ending, unit in _UNITS if name.endswith(ending)), "")


@cache
def name_in_words(name: str) -> str:
    """A signal's name without its unit, in words."""
    for ending, _ in _UNITS:
        if name.endswith(ending):
            return name.removesuffix(ending).replace("_", " ")
    return name.replace("_", " ")


def _seconds(milliseconds: int) -> str:
    return f"{milliseconds / 1000:.3f} s"
