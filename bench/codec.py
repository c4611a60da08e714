"""The compiled codec beside cantools: microseconds a message, and the ratio, in one run.

Run: ``python bench/codec.py``. cantools packs a dictionary and gives one back; ours goes from message object to frame
and back, checks every range, and so does more.
"""

import time
from collections.abc import Callable
from functools import partial

from cantools.database import load_string
from cantools.database.can.database import Database

from dbc import fleet_dbc_text
from onboard.core.codes import CallResult, Grade, KindCode, LegAction, MachineState, Reason, Side, TokenKind
from onboard.core.messages import Award, Bid, Heartbeat, Itinerary, Leg, Message, Reference, Stamp, TokenGrant
from onboard.wire.codec import fleet_codec
from onboard.wire.dbc_file import fleet_layouts

ROUNDS = 20_000
MESSAGES: tuple[Message, ...] = (
    Bid(11, 1, 300, 123_456_789, 7),
    TokenGrant(1, TokenKind.SEGMENT, 0x0107, 12, 11),
    Award(1, 300, 11, Reference(1, 40), 1, CallResult.AWARDED, Reason.NONE),
    Heartbeat(11, 1, 0x6C0A, 0x1234, 3, KindCode.ROBOT, MachineState.WORKING),
)
PLAN = Itinerary(
    11, 9, Grade.FIRM, Stamp(1_000, 1, 5), tuple(Leg(LegAction.TRAVEL, 1, 3, 7, Side.NEAR, 5_000) for _ in range(5))
)


def per_call_us(action: Callable[[], object]) -> float:
    """Microseconds of one call, the best of three rounds."""
    best_s = min(_timed_s(action) for _ in range(3))
    return best_s / ROUNDS * 1e6


def _timed_s(action: Callable[[], object]) -> float:
    started_s = time.perf_counter()
    for _ in range(ROUNDS):
        action()
    return time.perf_counter() - started_s


def main() -> None:
    """Print a row for each message of the fleet bus: us to encode and decode, here and with cantools."""
    database = load_string(fleet_dbc_text(), "dbc")
    assert isinstance(database, Database)
    codec, layouts = fleet_codec(), {layout.name: layout for layout in fleet_layouts()}
    print("| message | ours: encode us | cantools: encode us | ratio | ours: decode us | cantools: decode us | ratio |")
    print("|---|---|---|---|---|---|---|")
    for message in MESSAGES:
        name = type(message).__name__
        (frame,) = codec.encode(message)
        judge = database.get_message_by_name(name)
        values = judge.decode(frame.data, decode_choices=False)
        assert isinstance(values, dict)
        ours_out = per_call_us(partial(codec.encode, message))
        theirs_out = per_call_us(partial(judge.encode, values, strict=False))
        # Past the memory of frames that were decoded before: every receiver's first look at a new frame.
        ours_in = per_call_us(partial(codec._decode, frame.arbitration_id, frame.data))  # noqa: SLF001  # see above
        theirs_in = per_call_us(partial(judge.decode, frame.data, decode_choices=False))
        assert codec.decode_part(frame) == message and layouts[name].frame_id | message.sender == frame.arbitration_id
        print(
            f"| {name} | {ours_out:.2f} | {theirs_out:.2f} | {theirs_out / ours_out:.1f} "
            f"| {ours_in:.2f} | {theirs_in:.2f} | {theirs_in / ours_in:.1f} |"
        )
    (bid,) = codec.encode(MESSAGES[0])
    print(f"a frame that another receiver has decoded before: {per_call_us(partial(codec.decode_part, bid)):.2f} us")
    print(f"an itinerary of five legs, six frames: encode {per_call_us(partial(codec.encode, PLAN)):.2f} us")


if __name__ == "__main__":
    main()
