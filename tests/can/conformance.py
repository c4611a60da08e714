"""What every implementation of ``ports.Bus`` must do: one body of checks, run on each of them.

A test module makes a ``Pair`` of its technology and calls each function of ``CONFORMANCE`` with a fresh one::

    @pytest.mark.parametrize("check", CONFORMANCE, ids=lambda check: check.__name__)
    async def test_conforms(check): await check(await make_pair())

The checks close ``a`` where they test closing; whoever made the pair closes the rest.
"""

from collections.abc import Awaitable, Callable
from typing import Final, Protocol

import pytest

from onboard.core.frame import Frame
from onboard.ports.bus import Bus, ErrorState

#: What ``Pair.filtered`` must let through: 29-bit identifiers with 0x05 in their lowest byte.
FILTER_VALUE: Final = 0x05
FILTER_MASK: Final = 0xFF


class Pair(Protocol):
    """Connections to one bus, just opened. None where the technology has no such thing; the check is then skipped."""

    a: Bus
    b: Bus
    #: A third node that hears everything.
    c: Bus | None
    #: A node with the one acceptance filter (FILTER_VALUE, FILTER_MASK, extended).
    filtered: Bus | None
    #: How many frames ``a`` takes in one go, before anything has had time to leave.
    send_capacity: int | None

    async def settle(self) -> None:
        """Return when everything sent so far has arrived and the handlers have been called."""


class Listener:
    """Writes down what one bus hands over."""

    def __init__(self, bus: Bus) -> None:
        self.heard: list[Frame] = []
        self.sent: list[Frame] = []
        self.times_us: list[int] = []
        bus.subscribe(self._on_frame, self._on_sent)

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        self.heard.append(frame)
        self.times_us.append(time_us)

    def _on_sent(self, frame: Frame, time_us: int) -> None:
        self.sent.append(frame)
        self.times_us.append(time_us)


async def frames_arrive_unchanged(pair: Pair) -> None:
    """Standard and extended identifiers at both ends of their ranges, 0 to 8 data bytes."""
    heard = Listener(pair.b).heard
    frames = [Frame(identifier, b"", False) for identifier in (0, 1, 0x7FF)]
    frames += [Frame(identifier, b"\x80", True) for identifier in (0, 0x7FF, 0x800, 0x1FFFFFFF)]
    frames += [Frame(0x123, bytes(range(0xF0, 0xF0 + length)), False) for length in range(9)]
    frames += [Frame(0x18FF0005, bytes(range(length)), True) for length in range(9)]
    for frame in frames:
        assert pair.a.send(frame) is True
        await pair.settle()
    assert heard == frames


async def remote_frames_arrive(pair: Pair) -> None:
    """A remote frame keeps the length that it asks for, and has no data."""
    heard = Listener(pair.b).heard
    frames = [
        Frame(0x7FF, b"", False, True, remote_dlc=0),
        Frame(0x100, b"", False, True, remote_dlc=8),
        Frame(0x1ABCDEF0, b"", True, True, remote_dlc=3),
    ]
    for frame in frames:
        assert pair.a.send(frame) is True
        await pair.settle()
    assert heard == frames


async def both_directions_work(pair: Pair) -> None:
    """A conversation: each hears the other."""
    at_a, at_b = Listener(pair.a), Listener(pair.b)
    pair.a.send(Frame(0x100, b"ping"))
    await pair.settle()
    pair.b.send(Frame(0x101, b"pong"))
    await pair.settle()
    assert at_b.heard == [Frame(0x100, b"ping")]
    assert at_a.heard == [Frame(0x101, b"pong")]


async def a_handler_may_send(pair: Pair) -> None:
    """An answer sent from within the handler of the question arrives."""
    at_a = Listener(pair.a)

    def answer(frame: Frame, _time_us: int) -> None:
        pair.b.send(Frame(0x201, frame.data))

    pair.b.subscribe(answer)
    pair.a.send(Frame(0x200, b"\x01\x02"))
    await pair.settle()
    await pair.settle()
    assert at_a.heard == [Frame(0x201, b"\x01\x02")]


async def one_sender_keeps_its_order(pair: Pair) -> None:
    """Frames of one identifier arrive in the order in which they were sent."""
    at_b = Listener(pair.b)
    frames = [Frame(0x0CF00105, bytes((number,))) for number in range(50)]
    for frame in frames:
        assert pair.a.send(frame) is True
    await pair.settle()
    assert at_b.heard == frames
    assert at_b.times_us == sorted(at_b.times_us)


async def nobody_hears_itself(pair: Pair) -> None:
    """The sender's ``on_frame`` is silent, the other's ``on_sent`` is."""
    at_a, at_b = Listener(pair.a), Listener(pair.b)
    pair.a.send(Frame(0x300, b"\x01"))
    await pair.settle()
    assert at_a.heard == []
    assert at_b.sent == []


async def sending_is_confirmed_once(pair: Pair) -> None:
    """``on_sent`` is called for each frame, in order, with the frame as it was sent."""
    at_a = Listener(pair.a)
    frames = [Frame(0x310, bytes((number, 0))) for number in range(5)]
    for frame in frames:
        pair.a.send(frame)
    await pair.settle()
    assert at_a.sent == frames
    assert at_a.times_us == sorted(at_a.times_us)


async def everybody_hears_the_same(pair: Pair) -> None:
    """Two receivers hear all frames of two senders in one order."""
    if pair.c is None:
        pytest.skip("no third node")
    at_b, at_c = Listener(pair.b), Listener(pair.c)
    for number in range(10):
        pair.a.send(Frame(0x320 + number, bytes((number,))))
    await pair.settle()
    assert len(at_b.heard) == 10
    assert at_c.heard == at_b.heard


async def filters_let_pass_what_they_say(pair: Pair) -> None:
    """Value, mask and format count."""
    if pair.filtered is None:
        pytest.skip("no acceptance filters")
    heard = Listener(pair.filtered).heard
    passing = [Frame(0x18000005), Frame(0x00000005, b"\x01")]
    for frame in (passing[0], Frame(0x18000006), Frame(0x005, b"", False), passing[1]):
        pair.a.send(frame)
        await pair.settle()
    assert heard == passing


async def health_counts(pair: Pair) -> None:
    """Counters of frames, and a healthy state."""
    Listener(pair.b)
    for number in range(3):
        pair.a.send(Frame(0x330 + number))
    await pair.settle()
    assert pair.a.health().sent == 3
    assert pair.a.health().received == 0
    assert pair.b.health().received == 3
    assert pair.a.health().state is ErrorState.ERROR_ACTIVE
    assert pair.a.health().send_refused == 0


async def what_is_no_frame_is_refused(pair: Pair) -> None:
    """``send`` never raises, whatever it is given."""
    heard = Listener(pair.b).heard
    refused = [Frame(0x800, b"", False), Frame(0x20000000), Frame(1, bytes(9)), Frame(0x80, bytes(8), is_error=True)]
    assert [pair.a.send(frame) for frame in refused] == [False] * len(refused)
    await pair.settle()
    assert heard == []
    assert pair.a.health().send_refused == len(refused)


async def a_full_queue_refuses(pair: Pair) -> None:
    """Beyond its bound the transmit queue answers False, counts, and loses nothing that it took."""
    if pair.send_capacity is None:
        pytest.skip("the bound of the transmit queue is not known")
    heard = Listener(pair.b).heard
    asked = pair.send_capacity + 3
    answers = [pair.a.send(Frame(0x340, number.to_bytes(2, "big"))) for number in range(asked)]
    assert answers == [True] * pair.send_capacity + [False] * 3
    await pair.settle()
    assert len(heard) == pair.send_capacity
    assert pair.a.health().send_refused == 3


async def closing_ends_it(pair: Pair) -> None:
    """After ``close`` a bus refuses to send, hears nothing, and may be closed again."""
    at_a, at_b = Listener(pair.a), Listener(pair.b)
    await pair.a.close()
    assert pair.a.send(Frame(0x350)) is False
    pair.b.send(Frame(0x351))
    await pair.settle()
    assert at_a.heard == []
    assert at_b.heard == []
    assert pair.a.health().send_refused == 1
    await pair.a.close()


CONFORMANCE: list[Callable[[Pair], Awaitable[None]]] = [
    frames_arrive_unchanged,
    remote_frames_arrive,
    both_directions_work,
    a_handler_may_send,
    one_sender_keeps_its_order,
    nobody_hears_itself,
    sending_is_confirmed_once,
    everybody_hears_the_same,
    filters_let_pass_what_they_say,
    health_counts,
    what_is_no_frame_is_refused,
    a_full_queue_refuses,
    closing_ends_it,
]
