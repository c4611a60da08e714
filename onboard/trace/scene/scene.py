"""What a system adds to the picture: its drawing, where its machines are, and its words. All as plain values for JSON.

A drawing is either the car park's elevation, which the page knows how to draw, or a *plan*: shapes with a number of
their own in plan units, x to the right and y down, that the page scales to its width. A machine on a plan has a
``path``, points [x, y, time us] between which it moves evenly, so that nothing is asked for between two snapshots.
"""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from onboard.contract.messages import Message
from onboard.history.history import Fact

#: A value for JSON.
Json = dict[str, Any]
#: A point of a plan.
Spot = tuple[float, float]
#: How far along its way a machine is shown at most before it says that it is there.
NEARLY = 0.94


class Scene(Protocol):
    """One system's part of the picture; its words are ``onboard.systems.words``'s."""

    def layout(self) -> Json:
        """What never changes; a key ``plan`` holds its ``width``, ``height`` and ``shapes``."""

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """One message of the fleet bus, and what the history made of it."""

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """One message of a machine's device bus, where it is heard."""

    def machine(self, node: int, now_us: int) -> Json:
        """One machine: ``where`` and ``car`` in words, and what is drawn of it."""

    def marks(self, now_us: int) -> Json:
        """What changes beside the machines: on a plan ``marks`` by shape and ``things``, each at a spot."""


def shape(number: str, kind: str, name: str, points: Iterable[Spot], **more: object) -> Json:
    """One shape of a plan; two points of an area are its corners."""
    return {"id": number, "kind": kind, "name": name, "points": [_rounded(point) for point in points], **more}


def still(spot: Spot, time_us: int = 0) -> list[list[float]]:
    """The path of a machine that stands."""
    return [[*_rounded(spot), time_us]]


def along(points: Sequence[Spot], from_us: int, until_us: int, share: float = 1.0) -> list[list[float]]:
    """The path of a machine that goes evenly along ``points`` and is at ``share`` of its way at ``until_us``."""
    cut = part(points, 0.0, share)
    lengths = [0.0]
    for one, other in itertools.pairwise(cut):
        lengths.append(lengths[-1] + _far(one, other))
    whole = lengths[-1] or 1.0
    span_us = max(1, until_us - from_us)
    return [
        [*_rounded(point), from_us + round(span_us * length / whole)]
        for point, length in zip(cut, lengths, strict=True)
    ]


def part(points: Sequence[Spot], begin: float, end: float) -> list[Spot]:
    """The piece of a line between two shares of its length, 0 to 1."""
    lengths = [_far(one, other) for one, other in itertools.pairwise(points)]
    whole = sum(lengths)
    if whole <= 0:
        return [points[0]]
    found, passed = [_at(points, lengths, begin * whole)], 0.0
    for point, length in zip(points[1:], lengths, strict=True):
        passed += length
        if begin * whole < passed < end * whole:
            found.append(point)
    return [*found, _at(points, lengths, end * whole)]


def spot_on(points: Sequence[Spot], share: float) -> Spot:
    """The point at a share of a line's length."""
    return part(points, share, share)[0]


def _at(points: Sequence[Spot], lengths: list[float], far: float) -> Spot:
    for one, other, length in zip(points, points[1:], lengths, strict=False):
        if far <= length and length > 0:
            share = far / length
            return one[0] + (other[0] - one[0]) * share, one[1] + (other[1] - one[1]) * share
        far -= length
    return points[-1]


def _far(one: Spot, other: Spot) -> float:
    return float(((one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2) ** 0.5)


def _rounded(point: Spot) -> list[float]:
    return [round(point[0], 1), round(point[1], 1)]
