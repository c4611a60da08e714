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
from types import BuiltinFunctionType, CellType, FunctionType, MethodType, ModuleType
from typing import Any

from onboard.contract.base import Message
from onboard.core.site import Machine, Site, Timing

#: Bus time of all that is explored, us: no number of another kind is within a half of it.
NOW_US = 1 << 40
_LEAST_US, _MOST_US = NOW_US // 2, 2 * NOW_US
#: Older than this nothing becomes, us: no machine here waits for longer since something happened (``LOST_AFTER_US``).
OLDEST_US = 20_000_000

_ATOMS = (int, str, bytes, float, bool, type(None), type, frozenset, BuiltinFunctionType, ModuleType)
#: The same for all copies: nobody changes them.
_SHARED = (Site, Machine, Timing, Message, Enum)


def _is_time(value: int) -> bool:
    return _LEAST_US < value < _MOST_US


@dataclass
class _Copier:
    """One copy of one machine, ``by_us`` older."""

    by_us: int
    known: dict[int, Any] = field(default_factory=dict)

    def copy(self, thing: Any) -> Any:
        kind = type(thing)
        if kind is int:
            return max(thing - self.by_us, NOW_US - OLDEST_US) if self.by_us and _is_time(thing) else thing
        if kind in _ATOM_SET or isinstance(thing, _SHARED):
            return thing
        found = self.known.get(id(thing))
        if found is not None:
            return found
        made = _BY_KIND.get(kind, _Copier._instance)(self, thing)
        # The original is kept as long as its number stands for it.
        self.known[id(thing)] = made
        return made

    def _tuple(self, thing: Any) -> Any:
        return tuple([self.copy(one) for one in thing])

    def _list(self, thing: Any) -> Any:
        made: list[Any] = []
        self.known[id(thing)] = made
        made.extend([self.copy(one) for one in thing])
        return made

    def _dict(self, thing: Any) -> Any:
        made = type(thing)()
        self.known[id(thing)] = made
        for key, value in thing.items():
            made[self.copy(key)] = self.copy(value)
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
        kind = type(thing)
        if issubclass(kind, tuple):
            return tuple.__new__(kind, [self.copy(one) for one in thing])
        if not kind.__module__.startswith(_COPIED):
            return thing
        made = object.__new__(kind)
        self.known[id(thing)] = made
        for name in _slots(kind):
            if hasattr(thing, name):
                object.__setattr__(made, name, self.copy(getattr(thing, name)))
        own = getattr(thing, "__dict__", None)
        if own is not None:
            new = made.__dict__
            for name, value in own.items():
                new[name] = self.copy(value)
        return made


_ATOM_SET = frozenset(_ATOMS)
_COPIED = ("onboard.", "tests.")
_BY_KIND: dict[type, Callable[[_Copier, Any], Any]] = {
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


def _slots(kind: type) -> list[str]:
    return [name for one in kind.__mro__ for name in getattr(one, "__slots__", ()) if not name.startswith("__")]


def copied(machine: Any, by_us: int = 0) -> Any:
    """A machine of its own that has lived as the given one has, its times ``by_us`` older."""
    return _Copier(by_us).copy(machine)


def essence(thing: Any, left_out: frozenset[str]) -> Any:
    """What decides what a machine does, as one value to compare; attributes ``left_out`` decide nothing."""
    return _Essence(left_out).of(thing)


@dataclass
class _Essence:
    left_out: frozenset[str]
    #: Things that were met: a second way to one of them tells nothing new.
    met: set[int] = field(default_factory=set)

    def of(self, thing: Any) -> Any:
        kind = type(thing)
        if kind in _ATOM_SET or isinstance(thing, (Message, Enum)):
            return thing
        if issubclass(kind, tuple):
            return tuple([self.of(one) for one in thing])
        if isinstance(thing, (Site, Machine, Timing)) or id(thing) in self.met:
            return None
        self.met.add(id(thing))
        if kind in (list, deque):
            return tuple([self.of(one) for one in thing])
        if kind in (dict, Counter):
            return frozenset([(self.of(key), self.of(value)) for key, value in thing.items()])
        if kind is set:
            return frozenset([self.of(one) for one in thing])
        if not kind.__module__.startswith(_COPIED):
            return None
        own, left_out = getattr(thing, "__dict__", {}), self.left_out
        values = [(name, self.of(value)) for name, value in own.items() if name not in left_out]
        values += [(name, self.of(getattr(thing, name))) for name in _slots(kind) if name not in left_out]
        return tuple(values)
