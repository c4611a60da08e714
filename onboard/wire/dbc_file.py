"""The one file that knows cantools: a DBC text becomes plain layouts.

cantools changes its internals with every release (it is pinned); nothing but this file would have to follow.
"""

from dataclasses import dataclass
from functools import cache

from cantools.database import Message as DbcMessage
from cantools.database import Signal as DbcSignal
from cantools.database import load_string
from cantools.database.can.database import Database

from dbc import device_dbc_text, fleet_dbc_text, system_dbc_text


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """One signal: value = raw * scale + offset; raw has ``bits`` bits at ``shift`` of the little-endian word."""

    name: str
    shift: int
    bits: int
    signed: bool
    scale: int
    offset: int
    minimum: int
    maximum: int
    unit: str
    comment: str
    choices: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class MessageLayout:
    """One message; ``frame_id`` has 0 in its lowest byte, where the sender's node-ID goes.

    ``cycle_ms`` is 0 for a message that is sent on events only, ``on_events`` False for one that is sent in its cycle
    only. ``timeout_ms`` is how long a drive goes on without hearing it, 0 where it is no such message.
    """

    name: str
    frame_id: int
    length: int
    cycle_ms: int
    on_events: bool
    timeout_ms: int
    comment: str
    senders: tuple[str, ...]
    receivers: tuple[str, ...]
    signals: tuple[SignalLayout, ...]


def _signal(signal: DbcSignal) -> SignalLayout:
    if signal.byte_order != "little_endian" or signal.minimum is None or signal.maximum is None:
        raise ValueError(f"signal {signal.name} must be little-endian and have a range")
    numbers = (signal.scale, signal.offset, signal.minimum, signal.maximum)
    if any(number != int(number) for number in numbers):
        raise ValueError(f"signal {signal.name} must have a whole scale, offset and range, not {numbers}")
    choices = tuple(sorted((value, str(name)) for value, name in (signal.choices or {}).items()))
    return SignalLayout(
        signal.name,
        signal.start,
        signal.length,
        signal.is_signed,
        int(signal.scale),
        int(signal.offset),
        int(signal.minimum),
        int(signal.maximum),
        signal.unit or "",
        signal.comment or "",
        choices,
    )


def _message(message: DbcMessage) -> MessageLayout:
    signals = tuple(_signal(signal) for signal in sorted(message.signals, key=lambda one: one.start))
    receivers = tuple(dict.fromkeys(node for signal in message.signals for node in signal.receivers))
    timeout = message.dbc.attributes.get("DriveTimeOutMs") if message.dbc is not None else None
    return MessageLayout(
        message.name,
        message.frame_id,
        message.length,
        message.cycle_time or 0,
        message.send_type != "Cyclic",
        int(timeout.value) if timeout is not None else 0,
        message.comment or "",
        tuple(message.senders),
        receivers,
        signals,
    )


def _load(text: str) -> Database:
    database = load_string(text, database_format="dbc", strict=True, sort_signals=None)
    assert isinstance(database, Database)
    return database


def read_layouts(text: str) -> tuple[MessageLayout, ...]:
    """All messages of a DBC text, in the order of their identifiers.

    Raises cantools' errors for a bad text and ``ValueError`` for one that our codec cannot take.
    """
    return tuple(_message(message) for message in sorted(_load(text).messages, key=lambda one: one.frame_id))


def read_nodes(text: str) -> tuple[tuple[str, str], ...]:
    """Name and comment of all nodes of a DBC text, in the file's order."""
    return tuple((node.name, node.comment or "") for node in _load(text).nodes)


#: The node of a DBC that is a machine's controller on its own device bus: others do not hear what it says there.
CONTROLLER = "Controller"


@cache
def fleet_layouts(system: str = "") -> tuple[MessageLayout, ...]:
    """Layouts of ``dbc/fleet.dbc``, and of what a system adds to the fleet bus."""
    return (*read_layouts(fleet_dbc_text()), *system_layouts(system)[0])


@cache
def device_layouts(system: str = "") -> tuple[MessageLayout, ...]:
    """Layouts of ``dbc/device.dbc``, and of what a system adds to the device buses of its machines."""
    return (*read_layouts(device_dbc_text()), *system_layouts(system)[1])


@cache
def system_layouts(system: str) -> tuple[tuple[MessageLayout, ...], tuple[MessageLayout, ...]]:
    """What a system says beyond the two contracts of all: on the fleet bus, and on device buses."""
    text = system_dbc_text(system) if system else None
    layouts = read_layouts(text) if text is not None else ()
    device = tuple(one for one in layouts if CONTROLLER in (*one.senders, *one.receivers))
    return tuple(one for one in layouts if one not in device), device
