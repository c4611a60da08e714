"""One order from outside and what is known of it: its life as it is told back, and its record in the journal."""

import zlib
from dataclasses import dataclass, replace
from enum import Enum

from onboard.core.messages import Reference
from onboard.ports.journal import Entry


class Life(Enum):
    """Where an order is (docs/mqtt.md). ACCEPTED is durable; CALLED and what follows is heard on the bus."""

    ACCEPTED = "accepted"
    CALLED = "called"
    AWARDED = "awarded"
    MOVING = "moving"
    DONE = "done"
    REFUSED = "refused"

    @property
    def is_over(self) -> bool:
        """Whether nothing follows."""
        return self in (Life.DONE, Life.REFUSED)


#: In the order in which they come; an order never goes back but to CALLED, when it is called again.
RANK = {life: rank for rank, life in enumerate(Life)}


@dataclass(frozen=True, slots=True)
class Wish:
    """What an order asks of the bus: a compartment to fetch ``car`` or to park, or a robot to visit ``stops``.

    ``base`` is the last node that a VDA 5050 order releases and its sequence number, where an update goes on;
    ``is_open`` tells that it has a horizon, so that an update is to come (VDA 5050 2.1, section 6.6.4).

    ``node`` is the compartment or robot; ``number`` names a visit list on the bus (16 bits); ``urgent`` overtakes.
    """

    what: str
    node: int
    car: Reference | None = None
    stops: tuple[int, ...] = ()
    number: int = 0
    urgent: bool = False
    base: tuple[str, int] = ("", 0)
    is_open: bool = False


@dataclass(slots=True)
class Order:
    """One order. ``name`` is the giver's; ``content`` tells a second order under the same name from a repetition.

    Times in us of the loop; ``before_us`` in wall time since 1970. ``due_us``: when it is to be said (again).
    """

    name: str
    wish: Wish
    content: int
    before_us: int | None = None
    update: int = 0
    life: Life = Life.ACCEPTED
    reason: str = ""
    why: str = ""
    task: Reference | None = None
    owner: int = 0
    was_said: bool = False
    due_us: int | None = None
    #: Stops of updates, list by list, that the robot gets once it has done those of ``wish``.
    ahead: tuple[tuple[int, ...], ...] = ()
    #: It was taken back while the robot had it: the robot is told until it says so.
    is_cancelled: bool = False

    def entry(self) -> Entry:
        """The whole order, for the journal; the newest record of a name counts."""
        wish = self.wish
        found: dict[str, str | int] = {
            "record": "order",
            "name": self.name,
            "what": wish.what,
            "node": wish.node,
            "stops": _words(wish.stops),
            "ahead": ",".join(_words(stops) for stops in self.ahead),
            "base": wish.base[0],
            "sequence": wish.base[1],
            "open": int(wish.is_open),
            "cancelled": int(self.is_cancelled),
            "number": wish.number,
            "urgent": int(wish.urgent),
            "content": self.content,
            "update": self.update,
            "life": self.life.value,
            "reason": self.reason,
            "why": self.why,
            "owner": self.owner,
            "said": int(self.was_said),
        }
        for key, one in (("car", wish.car), ("task", self.task)):
            if one is not None:
                found |= {f"{key}_origin": one.origin, key: one.number}
        if self.before_us is not None:
            found["before_us"] = self.before_us
        return found


def read_order(entry: Entry) -> Order:
    """Inverse of ``Order.entry``."""
    ahead = str(entry.get("ahead", ""))
    wish = Wish(
        str(entry["what"]),
        int(entry["node"]),
        _reference(entry, "car"),
        _numbers(entry["stops"]),
        int(entry["number"]),
        bool(entry["urgent"]),
        (str(entry.get("base", "")), int(entry.get("sequence", 0))),
        bool(entry.get("open", 0)),
    )
    before = int(entry["before_us"]) if "before_us" in entry else None
    return Order(
        str(entry["name"]),
        wish,
        int(entry["content"]),
        before,
        int(entry["update"]),
        Life(str(entry["life"])),
        str(entry["reason"]),
        str(entry["why"]),
        _reference(entry, "task"),
        int(entry["owner"]),
        bool(entry["said"]),
        ahead=tuple(_numbers(stops) for stops in ahead.split(",")) if ahead else (),
        is_cancelled=bool(entry.get("cancelled", 0)),
    )


def same_content(*parts: object) -> int:
    """A number that is the same for an order that is sent again: CRC-32 of what it says."""
    return zlib.crc32(repr(parts).encode())


def with_number(wish: Wish, number: int) -> Wish:
    """The same wish under a number on the bus."""
    return replace(wish, number=number)


def _words(stops: tuple[int, ...]) -> str:
    return " ".join(str(stop) for stop in stops)


def _numbers(words: str | int) -> tuple[int, ...]:
    return tuple(int(one) for one in str(words).split())


def _reference(entry: Entry, key: str) -> Reference | None:
    return Reference(int(entry[f"{key}_origin"]), int(entry[key])) if key in entry else None
