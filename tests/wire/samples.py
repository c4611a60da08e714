"""Messages at random within the contract, for every class that travels."""

import random
from collections.abc import Iterator

from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts


def layouts() -> tuple[MessageLayout, ...]:
    return (*fleet_layouts(), *device_layouts())


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
