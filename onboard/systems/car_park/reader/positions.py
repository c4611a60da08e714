"""How places and positions are written in a car park's site file: one, a range, or all of a building.

``p(2,7)`` is floor 2, index 7 of the alley that the floor has by itself; ``p(2,B,7)`` index 7 of its alley B. A floor
and an index can be a range (``2-4``) or all (``*``), an alley all (``*``); N or F behind it is one side.
"""

import re
from typing import NamedTuple

_NUMBERS = r"\*|\d{1,3}(?:\s*-\s*\d{1,3})?"
_WRITTEN = re.compile(rf"p\(\s*({_NUMBERS})\s*,(?:\s*(\*|[A-Za-z]\w{{0,7}})\s*,)?\s*({_NUMBERS})\s*\)([NF]?)")

#: The alley that a floor has by itself.
BASE = ""
#: Any alley.
ANY = "*"
#: What an alley may be called.
ALLEY_NAME = re.compile(r"[A-Za-z]\w{0,7}")


class Numbers(NamedTuple):
    """From the first to the last, both included."""

    first: int
    last: int

    def __contains__(self, number: object) -> bool:
        return isinstance(number, int) and self.first <= number <= self.last

    @property
    def is_one(self) -> bool:
        """Whether a single number is meant."""
        return self.first == self.last


class Written(NamedTuple):
    """What a text means; ``side`` is N, F, or empty for both."""

    floors: Numbers
    alley: str
    indices: Numbers
    side: str

    def on(self, floor: int) -> "Written":
        """The same on one floor."""
        return self._replace(floors=Numbers(floor, floor))

    @property
    def is_one(self) -> bool:
        """Whether one position is meant, whatever its side."""
        return self.floors.is_one and self.indices.is_one and self.alley != ANY


def read_written(text: object) -> Written | None:
    """The meaning of a text, or None where it is of no such form."""
    found = _WRITTEN.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        return None
    floors, alley, indices, side = found.groups()
    return Written(_numbers(floors), alley or BASE, _numbers(indices), side)


def _numbers(text: str) -> Numbers:
    if text == "*":
        return Numbers(0, 999)
    first, _, last = text.partition("-")
    return Numbers(int(first), int(last or first))
