"""Our port over python-can: its virtual interface, and drivers that behave as SocketCAN's and others do in trouble."""

import argparse
import asyncio
import errno
import itertools
import logging
import socket
import threading
from typing import Any

import can
import can.cli
import pytest

from onboard.core.frame import Frame
from onboard.io import transmit
from onboard.io.open_bus import BusOpenError, BusSettings, OpenBus, add_bus_arguments, bus_settings, cast, open_bus
from onboard.io.pycan import PythonCanBus
from onboard.ports.bus import ErrorState
from tests.io.hub import Ears, until
from tests.tools import DEADLINE_S

FRAMES = [Frame(0x18FF0200 + number, bytes([number] * (number % 9))) for number in range(50)]
_numbers = itertools.count()


class Driver(can.BusABC):
    """A python-can driver with a file descriptor whose troubles a test sets."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.channel_info = "test"
        self.arrived: list[can.Message | Exception] = []
        self.sent: list[can.Message] = []
        self.full_for = 0
        self.send_error: Exception | None = None
        super().__init__(channel="test")

    def arrive(self, item: can.Message | Exception) -> None:
        self.arrived.append(item)
        self.far.send(b"x")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.arrived:
            return None, True
        self.near.recv(1)
        item = self.arrived.pop(0)
        if isinstance(item, Exception):
            raise item
        return item, True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.full_for:
            self.full_for -= 1
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        if self.send_error is not None:
            raise self.send_error
        self.sent.append(msg)

    def fileno(self) -> int:
        return self.near.fileno()

    def shutdown(self) -> None:
        super().shutdown()
        self.near.close()
        self.far.close()


def error_frame(classes: int, **data: int) -> can.Message:
    content = [data.get(f"byte{number}", 0) for number in range(8)]
    return can.Message(arbitration_id=classes, is_error_frame=True, data=content)


def message(number: int, **keywords: Any) -> can.Message:
    return can.Message(arbitration_id=number, **keywords)


async def virtual(channel: str, **extra: object) -> OpenBus:
    return await open_bus(BusSettings("virtual", channel, extra=tuple(extra.items())))


def fresh_channel() -> str:
    return f"test-{next(_numbers)}"


async def test_frames_go_both_ways_and_not_back() -> None:
    channel = fresh_channel()
    one, two = await virtual(channel), await virtual(channel)
    ears_one, ears_two = Ears(), Ears()
    one.subscribe(ears_one.on_frame, ears_one.on_sent)
    two.subscribe(ears_two.on_frame, ears_two.on_sent)
    assert all(one.send(frame) for frame in FRAMES)
    assert await ears_two.hear(50) == FRAMES
    assert await ears_one.hear_sent(50) == FRAMES
    odd = [Frame(0x7FF, b"\x01", False), Frame(0x100, b"", True, is_remote=True, remote_dlc=5), Frame(0, b"", False)]
    assert all(two.send(frame) for frame in odd)
    assert await ears_one.hear(3) == odd
    assert ears_one.sent.empty()
    assert one.health().sent == two.health().received == 50
    assert ears_two.times_us == sorted(ears_two.times_us)
    await one.close()
    await two.close()
    assert not one.send(FRAMES[0])
    assert one.health().send_refused == 1


async def test_a_failing_subscriber_does_not_stop_the_others() -> None:
    """A listener that raises ends python-can's own reader thread in silence."""
    channel = fresh_channel()
    one, two = await virtual(channel), await virtual(channel)
    reported: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: reported.append(context))
    ears = Ears()

    def fail(frame: Frame, time_us: int) -> None:
        raise RuntimeError("broken")

    two.subscribe(fail)
    two.subscribe(ears.on_frame)
    for frame in FRAMES[:2]:
        one.send(frame)
    assert await ears.hear(2) == FRAMES[:2]
    assert [str(context["exception"]) for context in reported] == ["broken", "broken"]
    await one.close()
    await two.close()


async def test_a_full_driver_is_tried_again_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """SocketCAN answers ENOBUFS at once, whatever time-out was asked for."""
    monkeypatch.setattr(transmit, "RETRY_US", 100)
    driver = Driver()
    bus = PythonCanBus(driver, BusSettings("socketcan", "can0"), echoing=False)
    ears = Ears()
    bus.subscribe(ears.on_frame, ears.on_sent)
    driver.full_for = 5
    assert all(bus.send(frame) for frame in FRAMES)
    assert not driver.sent
    assert await ears.hear_sent(50) == FRAMES
    assert [one.arbitration_id for one in driver.sent] == [frame.arbitration_id for frame in FRAMES]
    assert bus.health().send_refused == 0
    await bus.close()


async def test_a_driver_that_stays_full_costs_frames_not_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transmit, "RETRY_US", 100)
    monkeypatch.setattr(transmit, "GIVE_UP_US", 1_000)
    monkeypatch.setattr(transmit, "QUEUE_LIMIT", 10)
    driver = Driver()
    bus = PythonCanBus(driver, BusSettings("socketcan", "can0"), echoing=False)
    driver.full_for = 1 << 30
    assert [bus.send(frame) for frame in FRAMES[:12]] == [True] * 10 + [False] * 2
    assert bus.health().send_refused == 2
    await until(lambda: bus.counts["send_failed"] == 10)
    driver.full_for = 0
    assert bus.send(FRAMES[0])
    await bus.close()


async def test_a_blocking_driver_does_not_block_the_loop() -> None:
    """Serial lines and TCP block in ``send``: such a driver gets a thread."""
    driver, gate = Driver(), threading.Event()
    plain_send = driver.send

    def blocking(msg: can.Message, timeout: float | None = None) -> None:
        assert gate.wait(DEADLINE_S)
        plain_send(msg)

    driver.send = blocking  # type: ignore[method-assign]  # this driver blocks
    bus, ears = PythonCanBus(driver, BusSettings("slcan", "/dev/ttyACM0")), Ears()
    bus.subscribe(ears.on_frame, ears.on_sent)
    assert all(bus.send(frame) for frame in FRAMES)
    assert ears.sent.empty()
    gate.set()
    assert await ears.hear_sent(50) == FRAMES
    await bus.close()


async def test_sent_means_seen_on_the_bus_where_the_interface_echoes() -> None:
    driver = Driver()
    bus, ears = PythonCanBus(driver, BusSettings("socketcan", "can0")), Ears()
    bus.subscribe(ears.on_frame, ears.on_sent)
    bus.send(Frame(0x100, b"\x01", False))
    driver.arrive(message(0x200, is_extended_id=False))
    assert await ears.hear(1) == [Frame(0x200, b"", False)]
    assert ears.sent.empty()
    # Another program on the same computer: marked as local, but not ours.
    driver.arrive(message(0x300, is_extended_id=False, is_rx=False))
    driver.arrive(message(0x100, data=b"\x01", is_extended_id=False, is_rx=False))
    assert await ears.hear(1) == [Frame(0x300, b"", False)]
    assert await ears.hear_sent(1) == [Frame(0x100, b"\x01", False)]
    assert bus.health().sent == 1
    await bus.close()


async def test_error_frames_tell_the_state() -> None:
    """Classes and bits of linux/can/error.h."""
    driver = Driver()
    bus, ears = PythonCanBus(driver, BusSettings("socketcan", "can0")), Ears()
    bus.subscribe(ears.on_frame)
    steps = [
        (error_frame(0x204, byte1=0x20, byte6=128, byte7=3), ErrorState.ERROR_PASSIVE, (128, 3)),
        (error_frame(0x040), ErrorState.BUS_OFF, (128, 3)),
        (error_frame(0x100), ErrorState.ERROR_ACTIVE, (128, 3)),
        (error_frame(0x204, byte1=0x10, byte7=130), ErrorState.ERROR_PASSIVE, (0, 130)),
        (error_frame(0x204, byte1=0x40), ErrorState.ERROR_ACTIVE, (0, 0)),
    ]
    for count, (frame, state, counters) in enumerate(steps, 1):
        driver.arrive(frame)
        await until(lambda count=count: bus.counts["error_frames"] == count)  # type: ignore[misc]  # bound at once
        assert (bus.health().state, (bus.health().tec, bus.health().rec)) == (state, counters)
    driver.arrive(message(1, is_fd=True, data=bytes(12)))
    driver.arrive(message(2))
    assert await ears.hear(1) == [Frame(2)]
    assert bus.counts["fd_frames"] == 1
    await bus.close()


async def test_an_interface_that_goes_down_and_up_is_not_lost() -> None:
    driver = Driver()
    bus, ears = PythonCanBus(driver, BusSettings("socketcan", "can0")), Ears()
    bus.subscribe(ears.on_frame)
    driver.arrive(can.CanOperationError("Error receiving: Network is down", errno.ENETDOWN))
    await until(lambda: bus.health().state is ErrorState.BUS_OFF)
    driver.arrive(message(5))
    assert await ears.hear(1) == [Frame(5)]
    assert bus.health().state is ErrorState.ERROR_ACTIVE
    await bus.close()


async def test_an_unplugged_adapter_is_lost_with_a_reason() -> None:
    driver = Driver()
    bus = PythonCanBus(driver, BusSettings("socketcan", "can0"))
    driver.arrive(can.CanOperationError("Error receiving: No such device", errno.ENODEV))
    async with asyncio.timeout(DEADLINE_S):
        assert (
            await bus.wait_lost()
            == "bus socketcan:can0: reading failed: Error receiving: No such device [Error Code 19]"
        )
    assert not bus.send(FRAMES[0])
    await bus.close()


@pytest.mark.parametrize("error", [can.CanTimeoutError("slow"), ValueError("surprise")])
async def test_send_never_raises(error: Exception) -> None:
    driver = Driver()
    bus = PythonCanBus(driver, BusSettings("socketcan", "can0"))
    driver.send_error = error
    assert not bus.send(FRAMES[0])
    assert bus.health().send_refused == 1
    driver.send_error = None
    assert bus.send(FRAMES[0])
    await bus.close()


async def test_a_slow_loop_loses_frames_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("onboard.io.receive.QUEUE_LIMIT", 10)
    channel = fresh_channel()
    one, two = await virtual(channel), await virtual(channel, receive_own_messages=True)
    ears = Ears()
    two.subscribe(ears.on_frame)
    for _ in range(30):
        one.send(FRAMES[1])
    # The loop is busy until the reader's thread has seen all thirty.
    reader = two._reader  # type: ignore[attr-defined]  # the thread's progress shows nowhere else
    for _ in range(2_000):
        if reader.overflows == 20:
            break
        threading.Event().wait(0.005)
    assert await ears.hear(10) == [FRAMES[1]] * 10
    assert two.health().receive_overflows == 20
    await one.close()
    await two.close()


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (
            BusSettings("socketcam", "can0"),
            'interface "socketcam": python-can does not know it; did you mean "socketcan',
        ),
        (BusSettings("socketcand", "can0"), "host.*give what the interface needs with --bus-kwargs"),
        (BusSettings("slcan", "/dev/no-such-line"), 'interface "slcan", channel "/dev/no-such-line": '),
        (BusSettings("socketcan", "no-such-can0"), 'interface "socketcan", channel "no-such-can0": .*; .*'),
    ],
)
async def test_what_cannot_be_opened_is_one_line(
    settings: BusSettings, expected: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL, "can")
    with pytest.raises(BusOpenError, match=expected) as error:
        await open_bus(settings)
    assert "\n" not in str(error.value)


FILE = BusSettings("socketcand", "fleet", 250_000, (("host", "127.0.0.1"), ("port", 29536)))


@pytest.mark.parametrize(
    ("line", "settings"),
    [
        ("", FILE),
        ("-c other", BusSettings("socketcand", "other", 250_000, FILE.extra)),
        ("-i socketcan -c can0 -b 500000", BusSettings("socketcan", "can0", 500_000)),
        ("--bus-kwargs port=1", BusSettings("socketcand", "fleet", 250_000, (("host", "127.0.0.1"), ("port", 1)))),
    ],
)
def test_the_command_line_overrides_the_file(line: str, settings: BusSettings) -> None:
    parser = argparse.ArgumentParser()
    add_bus_arguments(parser)
    assert bus_settings(parser.parse_args(line.split()), FILE) == settings


def test_one_bus_named_twice_is_one_bus() -> None:
    """A machine file may give fleet and device bus the same interface; it is opened once."""
    turned = BusSettings("socketcand", "fleet", 250_000, FILE.extra[::-1])
    assert BusSettings.of(turned) == BusSettings.of(FILE)


@pytest.mark.parametrize(
    "line",
    [
        "-i virtual -c 1 -b 500000",
        "--interface socketcand --channel fleet --bitrate 125000",
        "--bus-kwargs host=127.0.0.1 port=29536 tcp_tune=True ratio=.5 gain=1.5e3 name=x=y empty= sign=-3",
        "",
    ],
)
def test_options_mean_what_they_mean_to_python_can(line: str) -> None:
    ours, theirs = argparse.ArgumentParser(), argparse.ArgumentParser()
    add_bus_arguments(ours)
    can.cli.add_bus_arguments(theirs)
    assert vars(ours.parse_args(line.split())) == vars(theirs.parse_args(line.split()))


def test_a_mistake_in_the_options_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    parser = argparse.ArgumentParser()
    add_bus_arguments(parser)
    with pytest.raises(SystemExit) as stop:
        parser.parse_args(["--bus-kwargs", "host"])
    assert stop.value.code == 2
    assert "'host' is not of the form NAME=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["1", "-5", "1.5", "true", "FALSE", "can0", "1e3", "", "0x10"])
def test_values_are_cast_as_python_can_does(text: str) -> None:
    theirs = can.util.cast_from_string(text)
    assert (cast(text), type(cast(text))) == (theirs, type(theirs))
