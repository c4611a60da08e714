"""Compaction: which journal records still mean something, by a table of record types. Entries in, fewer entries out.

What is left is a part of what was there, in the same order, so whoever replays it comes to the same state (the tests
say so for every system). A type that no table knows is kept for good.
"""

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import NamedTuple

from onboard.core.codes import TokenKind
from onboard.core.serial import is_newer

Entry = Mapping[str, str | int]
#: A car whose token was confirmed away, and after which so many newer ones of its origin came, is forgotten even where
#: its leaving was never heard (a machine that was off). Ours: its number comes again after 65,535.
NUMBERS_KEPT = 1_024
#: Ended tasks of which a machine still knows that they are over: whoever asks again is told so. Ours.
MOST_OVER = 500
_NUMBER_BITS = 16


class Which(Enum):
    """Which records of one family and key are kept."""

    NEWEST = "the newest says all"
    FIRST_AND_NEWEST = "the newest says all, the first says since when"
    ALL = "each adds to those before"


class Keep(NamedTuple):
    """A record belongs to ``family``, under the values of its ``key`` fields."""

    family: str
    key: tuple[str, ...] = ()
    which: Which = Which.NEWEST


class End(NamedTuple):
    """A record ends all of ``families`` under its ``key``; where ``when`` is given, only with one of these values.

    The newest ``most`` that have ended are kept as they are.
    """

    families: tuple[str, ...]
    key: tuple[str, ...] = ()
    when: tuple[str, tuple[str | int, ...]] | None = None
    most: int = 0


Rules = Mapping[str, tuple[Keep | End, ...]]
_Group = tuple[str, tuple[str | int | None, ...]]

_TOKEN = ("kind", "number")
_SEGMENT = ("track", "index")
#: Records that the core writes. The last give of a token, and that it has come, are kept beside what came after:
#: "I gave it to X under v" outlives everything (docs/contract-2.md). ``blocked`` and ``clear`` are both told again.
CORE_RULES: Rules = {
    "boot": (Keep("boot"),),
    "token_held": (Keep("token", _TOKEN),),
    "token_given": (Keep("token", _TOKEN), Keep("given", _TOKEN)),
    "token_gone": (Keep("token", _TOKEN), Keep("gone", _TOKEN)),
    "retired": (End(("token", "given", "gone"), _TOKEN), End(("car_at", "winner", "ticket"), ("car_origin", "car"))),
    "blocked": (Keep("blocked", _SEGMENT),),
    "clear": (Keep("clear", _SEGMENT),),
    "manual": (Keep("manual"),),
    "assigned": (Keep("assigned", _TOKEN),),
    "read_back": (Keep("read_back"),),
    "epoch": (Keep("epoch"),),
    # The first hold for a person stands until it is released.
    "held": (Keep("held", which=Which.FIRST_AND_NEWEST),),
    "released": (End(("held",)),),
}


def compact(rules: Rules, entries: Iterable[Entry]) -> list[Entry]:
    """Those of ``entries`` (oldest first) that still mean something, in their order. ``rules``: beside the core's."""
    entries = list(entries)
    table = {**CORE_RULES, **rules}
    forgotten = _forgotten_cars(entries)
    alive: dict[_Group, list[int]] = {}
    over: dict[str, dict[_Group, None]] = {}
    for index, entry in enumerate(entries):
        if _car_of(entry) in forgotten:
            continue
        # A type of its own for each record that nobody knows: nothing supersedes it.
        for rule in table.get(str(entry.get("record")), (Keep("unknown", which=Which.ALL),)):
            key = tuple(entry.get(name) for name in rule.key)
            if isinstance(rule, Keep):
                _keep(alive.setdefault((rule.family, key), []), index, rule.which)
                over.get(rule.family, {}).pop((rule.family, key), None)
            elif rule.when is None or entry.get(rule.when[0]) in rule.when[1]:
                for family in rule.families:
                    _end(alive, over.setdefault(family, {}), (family, key), rule.most)
    kept = {index for group in alive.values() for index in group}
    return [entry for index, entry in enumerate(entries) if index in kept]


def _keep(group: list[int], index: int, which: Which) -> None:
    if which is Which.NEWEST:
        group.clear()
    elif which is Which.FIRST_AND_NEWEST:
        del group[1:]
    group.append(index)


def _end(alive: dict[_Group, list[int]], over: dict[_Group, None], group: _Group, most: int) -> None:
    over.pop(group, None)
    over[group] = None
    while len(over) > most:
        oldest = next(iter(over))
        del over[oldest]
        alive.pop(oldest, None)


def _car_of(entry: Entry) -> int | None:
    """The car's number in its token that a record of a token or place is about."""
    if entry.get("kind") == TokenKind.CAR and str(entry.get("record")).startswith("token_"):
        return int(entry["number"])
    if entry.get("record") in ("car_at", "winner"):
        return int(entry["car_origin"]) << _NUMBER_BITS | int(entry["car"])
    return None


def _forgotten_cars(entries: Iterable[Entry]) -> set[int | None]:
    """Cars that were confirmed away and are older than ``NUMBERS_KEPT`` others of their origin."""
    last: dict[int, str] = {}
    newest: dict[int, int] = {}
    for entry in entries:
        car = _car_of(entry)
        if car is None:
            continue
        origin, number = divmod(car, 1 << _NUMBER_BITS)
        if str(entry["record"]).startswith("token_"):
            last[car] = str(entry["record"])
        if origin not in newest or is_newer(number, newest[origin], _NUMBER_BITS):
            newest[origin] = number

    def is_old(car: int) -> bool:
        origin, number = divmod(car, 1 << _NUMBER_BITS)
        return is_newer((newest[origin] - NUMBERS_KEPT) % (1 << _NUMBER_BITS), number, _NUMBER_BITS)

    return {car for car, record in last.items() if record == "token_gone" and is_old(car)}
