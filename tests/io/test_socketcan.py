"""SocketCAN's frames and troubles without a kernel that has it; the guest (``tests/qemu``) has the kernel."""

import errno
import socket
import sys

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

from onboard.core.frame import Frame
from onboard.io import socketcan
from onboard.io.driven import DrivenBus, DriverError
from onboard.io.open_bus import BusOpenError, BusSettings, open_bus
from onboard.io.socketcan import SocketCanDriver, to_bytes, to_frame
from onboard.io.transmit import Submitted
from tests.io.hub import Ears

FRAMES = [
    Frame(0x18FF0207, b"\x01\x02\x03"),
    Frame(0x7FF, bytes(8), False),
    Frame(0, b""),
    Frame(0x1FFFFFFF, b"", is_remote=True, remote_dlc=5),
    Frame(0x123, b"", False, is_remote=True),
]


class RawSocket:
    """As a raw CAN socket answers: what it is told to raise, else what is in its queue, with the flags beside it."""

    def __init__(self) -> None:
        self.error: OSError | None = None
        self.sent: list[bytes] = []
        self.queue: list[tuple[bytes, int]] = []

    def send(self, content: bytes) -> int:
        if self.error is not None:
            raise self.error
        self.sent.append(content)
        return len(content)

    def recvmsg(self, size: int) -> tuple[bytes, list[object], int, None]:
        if self.error is not None:
            raise self.error
        if not self.queue:
            raise BlockingIOError
        content, flags = self.queue.pop(0)
        return content[:size], [], flags, None


def driver_on(raw: object) -> SocketCanDriver:
    assert isinstance(raw, RawSocket | socket.socket)
    return SocketCanDriver(raw, echoes=True)  # type: ignore[arg-type]  # what it calls of a socket is there


@pytest.mark.parametrize("frame", FRAMES)
def test_a_frame_has_the_bytes_that_python_can_gives_it(frame: Frame) -> None:
    message = can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended,
        is_remote_frame=frame.is_remote,
        data=None if frame.is_remote else frame.data,
        dlc=frame.dlc,
    )
    theirs = bytearray(build_can_frame(message))
    theirs[7] = 0  # ``len8_dlc``, which only CAN FD controllers look at
    assert to_bytes(frame) == bytes(theirs)
    assert dissect_can_frame(to_bytes(frame))[1] == frame.dlc
    assert to_frame(to_bytes(frame)) == frame


def test_an_error_frame_keeps_its_classes_and_data() -> None:
    content = bytes([0x40, 0, 0, 0x20, 8, 0, 0, 0, *range(8)])
    assert to_frame(content) == Frame(0x40, bytes(range(8)), is_error=True)


@pytest.mark.parametrize(
    ("number", "result"),
    [
        (errno.ENOBUFS, Submitted.FULL),
        (errno.EAGAIN, Submitted.FULL),
        (errno.ENETDOWN, Submitted.FAILED),
        (errno.ENXIO, Submitted.LOST),
        (errno.ENODEV, Submitted.LOST),
    ],
)
def test_what_the_kernel_refuses_has_its_own_end(number: int, result: Submitted) -> None:
    raw = RawSocket()
    raw.error = OSError(number, "no")
    assert driver_on(raw).submit(FRAMES[0]) is result


def test_an_interface_that_is_down_may_come_back_and_one_that_is_gone_does_not() -> None:
    raw = RawSocket()
    driver = driver_on(raw)
    assert driver.take(0) is None
    for number, is_permanent in ((errno.ENETDOWN, False), (errno.ENODEV, True)):
        raw.error = OSError(number, "no")
        with pytest.raises(DriverError, match=r"^no$") as caught:
            driver.take(0)
        assert caught.value.is_permanent is is_permanent


def test_only_what_this_socket_has_sent_is_its_own() -> None:
    """``MSG_CONFIRM`` says so; ``MSG_DONTROUTE`` is every process's of this computer."""
    raw = RawSocket()
    raw.queue = [(to_bytes(FRAMES[0]), 0x804), (to_bytes(FRAMES[0]), 0x4), (to_bytes(FRAMES[0]), 0)]
    driver = driver_on(raw)
    heard = [driver.take(0) for _ in range(3)]
    assert [one is not None and one.is_own for one in heard] == [True, False, False]


async def test_frames_come_to_the_port_through_the_loop() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    near.setblocking(False)
    bus = DrivenBus(SocketCanDriver(near, echoes=False), "socketcan:can0")
    ears = Ears()
    bus.subscribe(ears.on_frame, ears.on_sent)
    for frame in FRAMES:
        far.send(to_bytes(frame))
    assert await ears.hear(len(FRAMES)) == FRAMES
    assert bus.send(FRAMES[0]) and await ears.hear_sent(1) == FRAMES[:1]
    assert far.recv(64) == to_bytes(FRAMES[0])
    await bus.close()
    far.close()


async def test_python_can_is_asked_only_for_what_needs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[BusSettings] = []

    async def note(settings: BusSettings) -> DrivenBus:
        asked.append(settings)
        raise BusOpenError("noted")

    monkeypatch.setattr(socketcan, "open_socketcan", note)
    monkeypatch.setitem(sys.modules, "onboard.io.pycan", None)
    plain = BusSettings("socketcan", "can0", extra=(("receive_own_messages", True),))
    with pytest.raises(BusOpenError, match="noted"):
        await open_bus(plain)
    with pytest.raises(BusOpenError, match="python-can cannot be imported"):
        await open_bus(BusSettings("socketcan", "can0", extra=(("can_filters", []),)))
    assert asked == [plain]
