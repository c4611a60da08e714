"""Things by number: an exploration compares and keeps small numbers instead of what they stand for."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

Thing = TypeVar("Thing")


@dataclass
class Table(Generic[Thing]):
    """Things by number, in the order in which they came."""

    things: list[Thing] = field(default_factory=list)
    _numbers: dict[Thing, int] = field(default_factory=dict)

    def number(self, thing: Thing) -> int:
        """The number of a thing, new or known."""
        found = self._numbers.get(thing)
        if found is None:
            found = self._numbers[thing] = len(self.things)
            self.things.append(thing)
        return found


def ones(bits: int) -> Iterator[int]:
    """The places of the bits that are set, from 0."""
    place = 0
    while bits:
        if bits & 1:
            yield place
        bits, place = bits >> 1, place + 1


def put(values: tuple[Any, ...], at: int, value: Any) -> tuple[Any, ...]:
    """The same values, but this one at its place."""
    return (*values[:at], value, *values[at + 1 :])
