"""The generated codec beside cantools: microseconds for each message, and the ratio, in one run.

Run: ``python bench/codec.py``. Ours goes from a message object to its bytes and back and checks every range on both
ways; cantools from a dictionary that is there already to bytes, with its checks, and from bytes to one, without.
"""

import math
import random
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from cantools.database import load_string
from cantools.database.can.database import Database
from cantools.database.can.message import Message as DbcMessage

from bench._arguments import given
from dbc import device_dbc_text, fleet_dbc_text, system_dbc_text, systems
from onboard.contract.base import FrameCode, Message
from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Bid, Itinerary, Leg, Stamp
from onboard.contract.packing import calls, device, plans, presence, rights
from onboard.systems.registry import part
from onboard.wire.codec import fleet_codec

ROUNDS = 500
SHARED = (*presence.FRAMES, *rights.FRAMES, *calls.FRAMES, *plans.FRAMES, *device.FRAMES)
#: Aims of the ratios: encode at least, decode at the median, decode at least.
AIMS = (25.0, 2.5, 1.5)
PLAN = Itinerary(
    11, 9, Grade.FIRM, Stamp(1_000, 1, 5), tuple(Leg(LegAction.TRAVEL, 1, 3, 7, Side.NEAR, 5_000) for _ in range(5))
)


class Row(NamedTuple):
    """Microseconds of one message: ours and theirs, out and in."""

    name: str
    ours_out: float
    theirs_out: float
    ours_in: float
    theirs_in: float

    @property
    def out(self) -> float:
        """How many times as fast encoding is."""
        return self.theirs_out / self.ours_out

    @property
    def back(self) -> float:
        """How many times as fast decoding is."""
        return self.theirs_in / self.ours_in


def per_call_us(*calls: tuple[Callable[[Any], object], object]) -> list[float]:
    """Microseconds of processor time of one call of each, the best of sixty rounds; called as a codec's users call it.

    Round by round in turn: what else the machine does falls on all alike.
    """
    best_s = [math.inf] * len(calls)
    for _ in range(60):
        best_s = [min(best, _timed_s(*call)) for best, call in zip(best_s, calls, strict=True)]
    return [best / ROUNDS * 1e6 for best in best_s]


def _timed_s(action: Callable[[Any], object], argument: object) -> float:
    started_s = time.process_time()
    for _ in range(ROUNDS):
        action(argument)
    return time.process_time() - started_s


def measured(code: FrameCode, judge: DbcMessage) -> Row:
    """One message of values drawn at random, the same in every run."""
    message, data = _drawn(code)
    values = judge.decode(data, decode_choices=False)
    assert isinstance(values, dict)
    assert judge.encode(values) == code.pack(message) == data and code.unpack(7, data) == message
    return Row(
        code.name,
        *per_call_us((code.pack, message), (judge.encode, values)),
        *per_call_us((partial(code.unpack, 7), data), (partial(judge.decode, decode_choices=False), data)),
    )


def _drawn(code: FrameCode) -> tuple[Message, bytes]:
    chance = random.Random(code.name)
    while True:
        message = code.unpack(7, chance.randbytes(code.length))
        if message is not None:
            return message, code.pack(message)


def rows() -> list[Row]:
    """Every message of every DBC."""
    found = []
    own = [(system_dbc_text(name) or "", part(name, "frames").FRAMES) for name in systems()]  # type: ignore[union-attr]  # all have
    for text, codes in ((fleet_dbc_text(), SHARED), (device_dbc_text(), SHARED), *own):
        database = load_string(text, "dbc")
        assert isinstance(database, Database)
        judges = {one.name: one for one in database.messages}
        found += [measured(code, judges[code.name]) for code in codes if code.name in judges]
    return found


def main() -> None:
    """Print a row for each message: us to encode and decode, here and with cantools, and the ratios aimed at."""
    given()
    print("| message | ours: encode us | cantools: encode us | ratio | ours: decode us | cantools: decode us | ratio |")
    print("|---|---|---|---|---|---|---|")
    every = rows()
    for row in sorted(every, key=lambda one: one.out):
        print(
            f"| {row.name} | {row.ours_out:.2f} | {row.theirs_out:.2f} | {row.out:.1f} "
            f"| {row.ours_in:.2f} | {row.theirs_in:.2f} | {row.back:.1f} |"
        )
    out, back = [row.out for row in every], [row.back for row in every]
    print(
        f"{len(every)} messages; encode: least {min(out):.1f} (aim {AIMS[0]:.0f}), median {statistics.median(out):.1f}"
    )
    print(f"decode: least {min(back):.2f} (aim {AIMS[2]}), median {statistics.median(back):.2f} (aim {AIMS[1]})")
    codec = fleet_codec()
    bid = Bid(11, 1, 300, 123_456_789, 7)
    (frame,) = codec.encode(bid)
    bid_us, known_us, plan_us = per_call_us((codec.encode, bid), (codec.decode_part, frame), (codec.encode, PLAN))
    print(f"a bid from object to frame: {bid_us:.2f} us")
    print(f"a frame that another receiver has decoded before: {known_us:.2f} us")
    print(f"an itinerary of five legs, six frames: encode {plan_us:.2f} us")


if __name__ == "__main__":
    main()
