"""Messages at random within the contract, for every class that travels."""

import dataclasses
import random
from collections.abc import Iterator

import cantools
from cantools.database.can import Database

from onboard.core.messages import Message
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts


def layouts() -> tuple[MessageLayout, ...]:
    return (*fleet_layouts(), *device_layouts())


def judge_of(text: str) -> Database:
    """A DBC text as cantools reads it, with its checks."""
    database = cantools.database.load_string(text, "dbc", strict=True)
    assert isinstance(database, Database)
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


def signal_values(message: Message) -> dict[str, int]:
    """Signals of a message of one frame. An inner field has its outer's name before its own."""
    found: dict[str, int] = {}
    for field in dataclasses.fields(message):
        value = getattr(message, field.name)
        if isinstance(value, tuple):
            inner: dict[str, int] = value._asdict()  # type: ignore[attr-defined]  # all of them are NamedTuples
            found.update({f"{field.name}_{name}": int(item) for name, item in inner.items()})
        elif field.name != "sender":
            found[field.name] = int(value)
    return found
