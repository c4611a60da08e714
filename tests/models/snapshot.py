"""Shipped machines as values: an exploration copies one before each event, lets it grow older, and compares it.

Bus time stands still while machines are explored: where time passes, all times that a machine keeps become older
instead, so that a machine which has waited twice is the same as one that has waited once. A time is told from other
numbers by its size, as explored machines live in a time of their own (``NOW_US``) in which no other number falls.
"""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from types import CellType, FunctionType, MethodType
from typing import Any

from onboard.contract.base import Message
from onboard.core.site import Machine, Site, Timing

#: Bus time of all that is explored, us: no number of another kind is within a half of it.
NOW_US = 1 << 40
#: While this passes everything that waits falls due, us: no machine repeats itself more slowly.
WHILE_US = 10_000_000
_WHILES = "whiles from now"
_LEAST_US, _MOST_US = NOW_US // 2, 2 * NOW_US
#: Older than this nothing becomes, us: no machine here waits for longer since something happened (``LOST_AFTER_US``).
OLDEST_US = 20_000_000

#: The same for all copies: nobody changes them.
_SHARED = (Site, Machine, Timing, Message, Enum)


def _is_time(value: int) -> bool:
    return _LEAST_US < value < _MOST_US


def _is_shared(kind: type) -> bool:
    """Whether nobody changes things of a class, or it is no part of a machine: copies have them in common."""
    return issubclass(kind, _SHARED) or not (kind in _COPIES or kind.__module__.startswith(_COPIED))


@dataclass
class _Copier:
    """One copy of one machine, ``by_us`` older."""

    by_us: int
    known: dict[int, Any] = field(default_factory=dict)
    #: Classes whose things a copy has in common with the original.
    shared: set[type] = field(init=False)

    def __post_init__(self) -> None:
        self.shared = _SHARED_WHILE_TIME_PASSES if self.by_us else _SHARED_AT_ONE_TIME

    def copy(self, thing: Any) -> Any:
        kind = type(thing)
        if kind in self.shared:
            return thing
        if kind is int:
            return max(thing - self.by_us, NOW_US - OLDEST_US) if _LEAST_US < thing < _MOST_US else thing
        how = _HOW_COPIED.get(kind, _UNKNOWN)
        if how is _UNKNOWN:
            how = _HOW_COPIED[kind] = None if _is_shared(kind) else _COPIES.get(kind, _Copier._instance)
        if how is None:
            _SHARED_WHILE_TIME_PASSES.add(kind)
            _SHARED_AT_ONE_TIME.add(kind)
            return thing
        found = self.known.get(id(thing))
        if found is None:
            # The original is kept as long as its number stands for it.
            found = self.known[id(thing)] = how(self, thing)
        return found

    def _same(self, thing: Any) -> Any:
        return thing

    def _tuple(self, thing: Any) -> Any:
        copy, kind, shared = self.copy, type(thing), self.shared
        if shared.issuperset(map(type, thing)):
            return thing
        made = [one if type(one) in shared else copy(one) for one in thing]
        for one, other in zip(made, thing, strict=True):
            if one is not other:
                return tuple(made) if kind is tuple else tuple.__new__(kind, made)
        return thing

    def _list(self, thing: Any) -> Any:
        made: list[Any] = []
        self.known[id(thing)] = made
        copy, shared = self.copy, self.shared
        made.extend([one if type(one) in shared else copy(one) for one in thing])
        return made

    def _dict(self, thing: Any) -> Any:
        made = type(thing)()
        self.known[id(thing)] = made
        copy, shared = self.copy, self.shared
        for key, value in thing.items():
            own = key if type(key) in shared else copy(key)
            made[own] = value if type(value) in shared else copy(value)
        return made

    def _set(self, thing: Any) -> Any:
        return {self.copy(one) for one in thing}

    def _deque(self, thing: Any) -> Any:
        return deque([self.copy(one) for one in thing], maxlen=thing.maxlen)

    def _method(self, thing: Any) -> Any:
        return MethodType(thing.__func__, self.copy(thing.__self__))

    def _function(self, thing: Any) -> Any:
        if not thing.__closure__:
            return thing
        cells = tuple([CellType(self.copy(cell.cell_contents)) for cell in thing.__closure__])
        made = FunctionType(thing.__code__, thing.__globals__, thing.__name__, thing.__defaults__, cells)
        made.__kwdefaults__ = thing.__kwdefaults__
        return made

    def _partial(self, thing: Any) -> Any:
        keywords = {key: self.copy(value) for key, value in thing.keywords.items()}
        return partial(self.copy(thing.func), *[self.copy(one) for one in thing.args], **keywords)

    def _instance(self, thing: Any) -> Any:
        kind, copy, shared = type(thing), self.copy, self.shared
        if issubclass(kind, tuple):
            return self._tuple(thing)
        made = object.__new__(kind)
        self.known[id(thing)] = made
        for name in _slots(kind):
            value = getattr(thing, name, _ABSENT)
            if value is not _ABSENT:
                object.__setattr__(made, name, value if type(value) in shared else copy(value))
        if hasattr(thing, "__dict__"):
            new = made.__dict__
            for name, value in thing.__dict__.items():
                new[name] = value if type(value) in shared else copy(value)
        return made


_UNKNOWN = _Copier._same
_ABSENT = object()
#: Filled as classes are met. A number may be a time, which becomes older.
_SHARED_WHILE_TIME_PASSES: set[type] = set()
_SHARED_AT_ONE_TIME: set[type] = {int}
#: Classes of this project are copied; all else that is not below has no state of a machine.
_COPIED = ("onboard.", "tests.")
_COPIES: dict[type, Callable[[_Copier, Any], Any]] = {
    int: _Copier._same,
    tuple: _Copier._tuple,
    list: _Copier._list,
    dict: _Copier._dict,
    Counter: _Copier._dict,
    set: _Copier._set,
    deque: _Copier._deque,
    MethodType: _Copier._method,
    FunctionType: _Copier._function,
    partial: _Copier._partial,
}
_HOW_COPIED: dict[type, Callable[[_Copier, Any], Any] | None] = {}


_SLOTS: dict[type, tuple[str, ...]] = {}


def _slots(kind: type) -> tuple[str, ...]:
    found = _SLOTS.get(kind)
    if found is None:
        names = [name for one in kind.__mro__ for name in getattr(one, "__slots__", ())]
        found = _SLOTS[kind] = tuple(name for name in names if not name.startswith("__"))
    return found


def copied(machine: Any, by_us: int = 0) -> Any:
    """A machine of its own that has lived as the given one has, its times ``by_us`` older."""
    return _Copier(by_us).copy(machine)


def essence(thing: Any, left_out: frozenset[str]) -> Any:
    """What decides what a machine does, as one value to compare; attributes ``left_out`` decide nothing."""
    return _Essence(left_out).of(thing)


_VALUES = (Message, Enum, str, bytes, int, float, bool, type(None), frozenset)
_NOTHING = (Site, Machine, Timing, type)


def _how_compared(kind: type) -> str:
    if kind is int or issubclass(kind, tuple):
        return "int" if kind is int else "row"
    if issubclass(kind, _VALUES):
        return "value"
    if issubclass(kind, _NOTHING):
        return "nothing"
    names: dict[type, str] = {list: "list", deque: "list", dict: "dict", Counter: "dict", set: "set"}
    return names.get(kind, "instance" if kind.__module__.startswith(_COPIED) else "nothing")


_HOW_COMPARED: dict[type, str] = {}
#: Filled as classes are met.
_AS_THEY_ARE: set[type] = set()


@dataclass
class _Essence:
    left_out: frozenset[str]
    #: Things that were met: a second way to one of them tells nothing new.
    met: set[int] = field(default_factory=set)

    def of(self, thing: Any) -> Any:
        kind = type(thing)
        if kind in _AS_THEY_ARE:
            return thing
        how = _HOW_COMPARED.get(kind)
        if how is None:
            how = _HOW_COMPARED[kind] = _how_compared(kind)
        if how == "value":
            _AS_THEY_ARE.add(kind)
            return thing
        if how == "int":
            # All that is due within a while is due when it has passed.
            return (_WHILES, -(-(thing - NOW_US) // WHILE_US)) if _LEAST_US < thing < _MOST_US else thing
        of, plain = self.of, _AS_THEY_ARE
        if how == "row":
            return tuple([one if type(one) in plain else of(one) for one in thing])
        if how == "nothing" or id(thing) in self.met:
            return None
        self.met.add(id(thing))
        if how == "instance":
            return self._instance(thing)
        if how == "dict":
            return frozenset([(of(key), value if type(value) in plain else of(value)) for key, value in thing.items()])
        made = [one if type(one) in plain else of(one) for one in thing]
        return frozenset(made) if how == "set" else tuple(made)

    def _instance(self, thing: Any) -> Any:
        of, plain, left_out, slots = self.of, _AS_THEY_ARE, self.left_out, _slots(type(thing))
        values = [(name, of(getattr(thing, name))) for name in slots if name not in left_out] if slots else []
        if hasattr(thing, "__dict__"):
            values += [
                (name, value if type(value) in plain else of(value))
                for name, value in thing.__dict__.items()
                if name not in left_out
            ]
        return tuple(values)
