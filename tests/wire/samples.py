"""Messages at random within the contract, for every frame of every DBC file."""

import random
from collections.abc import Iterator, Mapping
from dataclasses import fields
from enum import IntEnum
from typing import Any

import cantools
from cantools.database.can import Database

from onboard.contract.base import FrameCode, Message, Reference, Stamp
from onboard.contract.packing import (
    announce,
    announce_device,
    battery,
    calls,
    change,
    device,
    plans,
    presence,
    rights,
    seal,
)
from onboard.systems.registry import own_names, part
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts

#: Frames that every system has.
SHARED: tuple[FrameCode, ...] = (
    *presence.FRAMES, *rights.FRAMES, *calls.FRAMES, *plans.FRAMES, *seal.FRAMES, *battery.FRAMES, *change.FRAMES,
    *announce.FRAMES, *device.FRAMES, *announce_device.FRAMES,
)  # fmt: skip


def frames_of(system: str) -> tuple[FrameCode, ...]:
    """What a system adds."""
    module = part(system, "frames")
    return module.FRAMES if module is not None else ()


#: Every frame of the tree by name; no two files have one of the same name.
CODES: dict[str, FrameCode] = {
    code.name: code for code in (*SHARED, *(code for name in own_names() for code in frames_of(name)))
}


def layouts() -> tuple[MessageLayout, ...]:
    return (*fleet_layouts(), *device_layouts())


def judge_of(text: str, *more: str) -> Database:
    """DBC texts as cantools reads them into one, with its checks."""
    database = cantools.database.load_string(text, "dbc", strict=True)
    assert isinstance(database, Database)
    for one in more:
        database.add_dbc_string(one)
    return database


def random_value(signal: SignalLayout, chance: random.Random) -> int:
    """Any value that the signal may have, its ends often."""
    if signal.choices:
        return chance.choice(signal.choices)[0]
    ends = [signal.minimum, signal.maximum]
    value = chance.choice([*ends, chance.randint(*ends), chance.randint(*ends)])
    return signal.offset + (value - signal.offset) // signal.scale * signal.scale


def random_frames(count: int, seed: int) -> Iterator[tuple[MessageLayout, int, dict[str, int]]]:
    """``count`` times for each message: its layout, a node-ID and the values of its signals."""
    chance = random.Random(seed)
    for layout in layouts():
        for _ in range(count):
            yield layout, chance.randint(1, 250), {s.name: random_value(s, chance) for s in layout.signals}


def message_of(name: str, sender: int, values: Mapping[str, int]) -> Message:
    """The message object of a frame with these values of its signals."""
    cls = CODES[name].frame
    return cls(sender, **{one.name: _value(one.name, one.type, values) for one in fields(cls)[1:]})


def _value(name: str, kind: Any, values: Mapping[str, int]) -> Any:
    if kind in (Reference, Stamp):
        return kind(*(values[f"{name}_{inner}"] for inner in kind._fields))
    value = values[name]
    return kind(value) if kind is bool or issubclass(kind, IntEnum) else value


def signal_values(message: Message) -> dict[str, int]:
    """Signals of a message of one frame. An inner field has its outer's name before its own."""
    found: dict[str, int] = {}
    for field in fields(message):
        value = getattr(message, field.name)
        if isinstance(value, Reference | Stamp):
            found.update({f"{field.name}_{name}": int(item) for name, item in value._asdict().items()})
        elif field.name != "sender":
            found[field.name] = int(value)
    return found
