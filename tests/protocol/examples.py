"""The examples of docs/protocol.md: frames of a run that the tests play anyway, decoded with the DBC alone.

``python -m tests.system.test_same_traces`` takes them anew where runs change on purpose.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import cantools
from cantools.database.can import Database

from tests.project.rows import ROOT

#: The run that they are from, of ``tests.system.test_same_traces``.
RUN = "small --random 40 15 --cars 3 --fault crash:target=MR1,at_s=80,restart_s=5"
#: One frame as candump logs it, and below it what it says.
LINE = re.compile(r"^\((?P<time>\d+\.\d+)\) fleet (?P<id>[0-9A-F]{8})#(?P<data>(?:[0-9A-F]{2})*)$")
_ROBOT1, _ROBOT2, _BAY, _LIFT = 11, 12, 1, 5


class Told(NamedTuple):
    """One frame of a log."""

    line: str
    name: str
    sender: int
    signals: Mapping[str, Any]


class Wanted(NamedTuple):
    """The next frame of this message, sender and these signals."""

    name: str
    sender: int
    signals: tuple[tuple[str, object], ...] = ()


def _one(name: str, sender: int, **signals: object) -> Wanted:
    return Wanted(name, sender, tuple(signals.items()))


#: Each block's frames in the order in which they are found in the run.
EXAMPLES: dict[str, tuple[Wanted, ...]] = {
    "bus-time": (_one("BusTime", _BAY, bus_time_us=0), _one("BusTime", _BAY)),
    "joining": (
        _one("Heartbeat", _ROBOT1, state="STARTING"),
        _one("SyncRequest", _ROBOT1),
        _one("Progress", _ROBOT1),
        _one("ItineraryHead", _ROBOT1),
        _one("ItineraryLeg", _ROBOT1),
        _one("Heartbeat", _ROBOT1, state="IDLE"),
        _one("SyncDone", _ROBOT1),
    ),
    "calls": (
        _one("Call", _BAY, attempt=1),
        _one("CallTerms", _BAY),
        _one("CallLoad", _BAY),
        _one("Bid", _ROBOT1),
    ),
    "awards": (
        _one("Award", _BAY, winner=_ROBOT1),
        _one("ItineraryHead", _ROBOT1),
        _one("TaskReport", _ROBOT1, phase="AWARDED"),
    ),
    "undertaking": (
        _one("TaskReport", _ROBOT1, phase="AWARDED"),
        _one("TaskReport", _ROBOT1, phase="STARTED"),
        _one("TaskReport", _ROBOT1, phase="LOADED"),
        _one("TaskReport", _ROBOT1, phase="DONE"),
    ),
    "plans": (
        _one("ItineraryHead", _ROBOT1, stamp_initiator=_BAY),
        _one("ItineraryLeg", _ROBOT1, leg=0),
        _one("ItineraryLeg", _ROBOT1, leg=1),
        _one("ItineraryLeg", _ROBOT1, leg=2),
        _one("Progress", _ROBOT1),
    ),
    "tokens": (
        _one("TokenRequest", _ROBOT1, token_kind="RUN"),
        _one("TokenGrant", _LIFT, token_kind="RUN", holder=_ROBOT1),
        _one("TokenHeld", _ROBOT1, token_kind="RUN"),
        _one("TokenRefusal", _LIFT, requester=_ROBOT1),
    ),
    "lifts": (
        _one("TokenGrant", _LIFT, token_kind="SEGMENT", token=0x80FF, holder=_ROBOT1),
        _one("Progress", _LIFT, itinerary_version=1),
        _one("TokenHeld", _ROBOT1, token=0x80FF),
    ),
    "custody": (
        _one("CarAt", _ROBOT1, station=65535),
        _one("CarAt", _ROBOT1, station=389),
        _one("TokenGrant", _ROBOT1, token_kind="CAR", holder=_BAY),
        _one("TokenHeld", _BAY, token_kind="CAR"),
        _one("CarAt", _BAY, car_number=1, version=3),
    ),
    "restart": (
        _one("Heartbeat", _ROBOT1, boot=2),
        _one("SyncRequest", _BAY, whom=_ROBOT1, boot_before=1),
        _one("SyncRequest", _ROBOT1, whom=0),
        _one("SyncDone", _BAY, whom=_ROBOT1),
        _one("TokenSeen", _ROBOT1),
        _one("SyncDone", _ROBOT1, whom=0),
    ),
}
#: What the run does not say: name, sender and signals, put together with the DBC.
MADE: dict[str, tuple[Wanted, ...]] = {
    "halting": (
        _one("EmergencyStop", 251, reason="OPERATOR"),
        _one("Halted", 11, machine=11, reason="EMERGENCY_STOP", cause=251, needs_person="NO", boot=2),
        _one("Go", 251, stopper=251),
    ),
    "left-out": (_one("LeftOut", 1, call=259, node_a=11, node_b=0, node_c=0, node_d=0, node_e=0, node_f=0),),
}


@cache
def contract() -> Database:
    """The fleet's DBC file, as cantools reads it."""
    found = cantools.database.load_file(ROOT / "dbc" / "fleet.dbc")
    assert isinstance(found, Database)
    return found


def told(line: str) -> Told | None:
    """A line of a log, decoded with the DBC; None for one of another bus."""
    found = LINE.match(line)
    if found is None:
        return None
    number = int(found["id"], 16)
    one = contract().get_message_by_frame_id(number & ~0xFF)
    signals = one.decode(bytes.fromhex(found["data"]))
    assert isinstance(signals, dict)
    return Told(line, one.name, number & 0xFF, {name: _plain(value) for name, value in signals.items()})


def _plain(value: object) -> object:
    return value if isinstance(value, int | float) else str(value)


def said(one: Told) -> str:
    """What a frame says, in the DBC's words."""
    units = {signal.name: signal.unit for signal in contract().get_message_by_name(one.name).signals}
    words = [f"{name} {value}" + (f" {units[name]}" if units[name] else "") for name, value in one.signals.items()]
    return f"{one.name} of node {one.sender}: " + ", ".join(words)


def found(log: Iterable[Told], wanted: tuple[Wanted, ...]) -> Iterator[Told]:
    """The frames wanted, each behind the one before. Raises ``LookupError`` for one that the log has not."""
    lines = iter(log)
    for one in wanted:
        for line in lines:
            given = dict(line.signals)
            if (line.name, line.sender) == one[:2] and all(given[name] == value for name, value in one.signals):
                yield line
                break
        else:
            raise LookupError(
                f"no {one.name} of node {one.sender} with {dict(one.signals)} in the run, behind those before"
            )


def made(one: Wanted) -> Told:
    """A frame of these signals, at time 0."""
    message = contract().get_message_by_name(one.name)
    number, data = (
        message.frame_id | one.sender,
        message.encode({name: value for name, value in one.signals if isinstance(value, int | str)}),
    )
    line = told(f"(0000000000.000000) fleet {number:08X}#{data.hex().upper()}")
    assert line is not None
    return line


def drawn(frames: Iterable[Told]) -> str:
    """The block of one chapter."""
    return "\n".join(("```text", *(f"{one.line}\n    {said(one)}" for one in frames), "```"))


def blocks(log: Path) -> dict[str, str]:
    """All examples from the log of the run."""
    lines = [one for line in log.read_text(encoding="utf-8").splitlines() if (one := told(line)) is not None]
    return {name: drawn(found(lines, wanted)) for name, wanted in EXAMPLES.items()}


def lines_of(text: str) -> list[str]:
    """The lines of candump in a text."""
    return [line for line in text.splitlines() if LINE.match(line)]
