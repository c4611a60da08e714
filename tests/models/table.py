"""Things by number: an exploration compares and keeps small numbers instead of what they stand for."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

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
