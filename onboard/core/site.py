"""The site: what all machines of a fleet agree on, as plain values; read from a TOML file by ``onboard.config``.

A *segment* is what one body fills, a *station* what stands beside one: resources with numbers, each with its token.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import ClassVar, NamedTuple

from onboard.contract.codes import KindCode, Side, TokenKind


class Segment(NamedTuple):
    """One body slot: index 1 to n on a track; the number on the wire is ``track << 8 | index``."""

    track: int
    index: int  # type: ignore[assignment]  # the position number hides tuple.index on purpose

    @property
    def number(self) -> int:
        """16-bit number on the wire."""
        return self.track << 8 | self.index

    def __str__(self) -> str:
        return f"p({self.track},{self.index})"


class Station(NamedTuple):
    """What is beside a segment: 16-bit number ``track << 8 | side << 7 | index``, index 1 to 127."""

    track: int
    index: int  # type: ignore[assignment]  # the position number hides tuple.index on purpose
    side: Side

    @property
    def number(self) -> int:
        """16-bit number on the wire."""
        return self.track << 8 | self.side << 7 | self.index

    @property
    def segment(self) -> Segment:
        """The segment in front of it."""
        return Segment(self.track, self.index)

    @classmethod
    def from_number(cls, number: int) -> "Station":
        """Inverse of ``number``, for 0 to 0xFFFE."""
        return cls(number >> 8, number & 0x7F, Side(number >> 7 & 1))

    def __str__(self) -> str:
        return f"p({self.track},{self.index}){'NF'[self.side]}"


#: A sign of life that is given early comes so long after the last at the least, us: what a bus is asked for is bounded.
BEATS_APART_US = 300_000


@dataclass(frozen=True, slots=True)
class Machine:
    """One machine of the site. ``home`` is where it stands at first, or before its ``station`` where it is fixed."""

    node_id: int
    name: str
    kind: KindCode
    home: Segment
    station: Station | None = None


@dataclass(frozen=True, slots=True)
class Timing:
    """Times of the protocol, in microseconds unless named otherwise; those of devices a class beside it adds."""

    call_window_us: int
    bid_delay_us: int
    bid_half_us: int
    deadline_guard_us: int
    max_attempts: int
    award_repeat_us: int
    token_repeat_us: int
    heartbeat_us: int
    bus_time_us: int
    drive_refresh_us: int
    #: Share of the time left for a bid that its sub-calls may take, per cent.
    sub_call_percent: int = 50
    #: Nobody says awards: at the deadline the best bid that was heard has won (row P11).
    silent: bool = field(default=False, kw_only=True)


class MotionNeeds(Enum):
    """What an order by which something moves needs beside a machine that stands in nobody's way."""

    RIGHT = "each needs a right: what it moves in is shared with others"
    PLACE = "some need a right, by where they move: there is open ground, or a part that nobody else comes to"
    ALONE = "none: it moves within the machine only"


@dataclass(frozen=True, kw_only=True)
class Site:
    """Everything a machine knows beforehand, of any system. Built and checked by ``onboard.config``; frozen thereafter.

    ``stewards`` maps each track number to the node-ID of the fixed machine that holds the tokens of its segments and
    stations at first. ``digest`` is 16 bits over what the site is (docs/site-file.md): two files that mean the same
    have the same. A system adds its own in a class of its own.
    """

    #: Which system this is, as the site file says it; it chooses the kinds' behaviours.
    system: ClassVar[str] = ""
    #: What people call such a site.
    called: ClassVar[str] = "site"
    #: Whether rights can be made anew one by one: only where it is known whose each right is, and what stands where.
    has_regeneration: ClassVar[bool] = False
    #: Why a person cannot hold one machine by itself; empty where that can be.
    no_hold: ClassVar[str] = ""
    #: Fields that say what comes to the site in a run of the simulator. No machine knows them: not in the digest.
    demand: ClassVar[frozenset[str]] = frozenset()
    #: The messages of the device bus by which something moves: no other does, and these only as ``authorised`` lets.
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {}

    name: str
    digest: int
    bitrate: int
    machines: dict[int, Machine]
    timing: Timing
    stewards: dict[int, int] = field(default_factory=dict)
    #: IANA name of the site's local time, for people who look at it; empty where the file has none. Not in the digest.
    time_zone: str = ""
    #: Proof of who says what: "off", "watch" (wrong words are told), "required" (and dropped). Never negotiated.
    seals: str = "off"

    @cached_property
    def at_first(self) -> dict[TokenKind, dict[int, int]]:
        """Whose home a segment is, and who is at a station, by their numbers; of several machines the first."""
        machines = list(reversed(self.machines.values()))
        homes = {one.home.number: one.node_id for one in machines if one.kind is KindCode.ROBOT}
        stations = {one.station.number: one.node_id for one in machines if one.station is not None}
        return {TokenKind.SEGMENT: homes, TokenKind.STATION: stations}

    def machine(self, name: str) -> Machine:
        """The machine so named. Raises ``KeyError`` where there is none."""
        for machine in self.machines.values():
            if machine.name == name:
                return machine
        raise KeyError(name)


def journal_owner(site: Site, machine: Machine) -> str:
    """Whose journal a machine's is: another board with the same machine file may go on with it, nobody else."""
    return f"{site.name} node {machine.node_id}"
