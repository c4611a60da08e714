"""Messages in the words of a site: machines by name, places and loads as its system calls them, units, value names.

Units are the DBC's own; what a number means is known by the signal's name, which is the same in every message. What a
system has words of its own for, ``onboard.systems.words`` tells.
"""

from collections.abc import Iterable
from dataclasses import fields
from enum import IntEnum
from functools import cache

from onboard.contract.codes import Criterion
from onboard.contract.messages import Bid, CallForProposals, Leg, Message, Reference, Stamp
from onboard.core.site import Site
from onboard.systems.words import plain, words_of

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


class Words:
    """Puts messages into words. It remembers the criterion of each call that it saw. ``site`` None: numbers only."""

    def __init__(self, site: Site | None = None) -> None:
        self.site = site
        self.system = words_of(site)
        self.machine = self.system.machine
        self.cost = self.system.cost
        self.reference = self.system.reference
        self._names: dict[type[Message], tuple[str, ...]] = {}
        self._criteria: dict[tuple[int, int], Criterion] = {}

    def hear(self, message: Message) -> None:
        """Remember what later words need; ``message`` does so by itself."""
        self.system.hear(message)
        if isinstance(message, CallForProposals):
            self._criteria[message.sender, message.call] = message.criterion
            if len(self._criteria) > _CALLS_KEPT:
                del self._criteria[next(iter(self._criteria))]

    def message(self, message: Message) -> str:
        """``MR1 Bid: initiator IOC1, call 1, cost 43.210 s, itinerary version 2``."""
        self.hear(message)
        said = ", ".join(self._fields(message))
        name = type(message).__name__
        return f"{self.machine(message.sender)} {name}" + (f": {said}" if said else "")

    def _fields(self, message: Message) -> Iterable[str]:
        names = self._names.get(type(message))
        if names is None:
            silent = {"sender", *self.system.silent}
            names = tuple(field.name for field in fields(message) if field.name not in silent)
            self._names[type(message)] = names
        values = {name: getattr(message, name) for name in names}
        if "token_kind" in values:
            yield f"token {self.system.resource(values.pop('token_kind'), values.pop('token'))}"
        if "track" in values and "index" in values:
            yield f"at {self.system.slot(values.pop('track'), values.pop('index'))}"
        for name, value in values.items():
            if name == "cost" and isinstance(message, Bid):
                yield f"cost {self.cost(value, self._criteria.get((message.initiator, message.call)))}"
            elif name == "legs":
                yield "legs " + ("; ".join(self._leg(leg) for leg in value) or "none")
            elif isinstance(value, Reference) and name in ("car", self.system.noun):
                yield f"{self.system.noun} {self.system.load(value)}"
            else:
                yield f"{name_in_words(name)} {self._value(name, value)}"

    def _value(self, name: str, value: object) -> str:
        if isinstance(value, Reference):
            return self.reference(value)
        if isinstance(value, Stamp):
            return f"{_seconds(value.award_ms)} by {self.machine(value.initiator)} call {value.call}"
        if isinstance(value, IntEnum):
            return plain(value.name)
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, int):
            return self._number(name, value)
        return str(value)

    def _number(self, name: str, value: int) -> str:
        own = self.system.signals.get(name)
        if own is not None:
            return own(value)
        if name in _NODES:
            return self.machine(value)
        if name in _STATIONS:
            return self.system.place(value)
        if name in _MOMENTS:
            return _seconds(value)
        if name.endswith("digest"):
            return f"{value:04X}"
        return f"{value}{unit_of(name)}"

    def _leg(self, leg: Leg) -> str:
        start, end = (self.system.slot(leg.track, index) for index in (leg.from_index, leg.to_index))
        way = start if start == end else f"{start}..{end}"
        side = f" {leg.side.name.lower()}" if leg.action.name == "WORK" else ""
        return f"{leg.action.name.lower()} {way}{side} until {_seconds(leg.end_ms)}"


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
