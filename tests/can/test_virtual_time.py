import asyncio
import threading
import time
from collections.abc import Iterator
from functools import partial
from types import SimpleNamespace

import pytest

from bus_sim import virtual_time
from bus_sim.virtual_time import DeadlockError, LoopClock, VirtualTimeLoop, now_us, run
from tests.tools import DEADLINE_S


@pytest.fixture
def loop() -> Iterator[VirtualTimeLoop]:
    made = VirtualTimeLoop()
    yield made
    made.close()


def test_an_hour_passes_at_once() -> None:
    async def scenario() -> int:
        await asyncio.sleep(3600)
        return now_us(asyncio.get_running_loop())

    begin = time.monotonic()
    assert run(scenario()) == 3_600_000_000
    assert time.monotonic() - begin < 60


def test_timers_of_equal_time_fire_in_the_order_they_were_set(loop: VirtualTimeLoop) -> None:
    fired: list[int] = []

    def note(number: int, _when_us: int) -> None:
        fired.append(number)

    for number in range(200):
        # Both ways of setting a timer share one order; so do floats that mean the same microsecond.
        if number % 3:
            loop.call_at(0.1 + 0.2 if number % 2 else 0.3, fired.append, number)
        else:
            loop.at_us(300_000, partial(note, number))
    loop.run_until_complete(asyncio.sleep(1))
    assert fired == list(range(200))


def test_what_a_timer_made_ready_runs_before_the_next_timer_of_that_time(loop: VirtualTimeLoop) -> None:
    order: list[str] = []

    async def sleeper(name: str) -> None:
        await asyncio.sleep(0.5)
        order.append(f"{name} woke")
        await asyncio.sleep(0)
        order.append(f"{name} went on")

    async def scenario() -> None:
        await asyncio.gather(sleeper("a"), sleeper("b"))

    loop.run_until_complete(scenario())
    assert order == ["a woke", "a went on", "b woke", "b went on"]


@pytest.mark.parametrize("start_us", [0, 1_700_000_000_000_000])
def test_every_microsecond_survives_the_float(start_us: int) -> None:
    loop = VirtualTimeLoop(start_us=start_us)
    seen: list[tuple[int, int]] = []

    def note(when_us: int) -> None:
        seen.append((when_us, now_us(loop)))

    for offset_us in (1, 2, 3, 7, 333_333, 999_999, 86_400_000_001):
        when_us = start_us + offset_us
        loop.call_at(when_us / 1e6, note, when_us)
    loop.run_until_complete(asyncio.sleep(100_000))
    loop.close()
    assert len(seen) == 7
    assert all(asked == got for asked, got in seen)


def test_a_time_that_is_past_means_now(loop: VirtualTimeLoop) -> None:
    loop.run_until_complete(asyncio.sleep(5))
    seen: list[int] = []
    loop.call_at(1.0, lambda: seen.append(loop.now_us()))
    loop.at_us(1_000_000, seen.append)
    loop.run_until_complete(asyncio.sleep(1))
    assert seen == [5_000_000, 5_000_000]


def test_deadlock_says_when_and_who(loop: VirtualTimeLoop) -> None:
    async def wait_for_nobody() -> None:
        await asyncio.sleep(1.5)
        await asyncio.Event().wait()

    task = loop.create_task(wait_for_nobody())
    with pytest.raises(DeadlockError, match=r"deadlock at 1\.500000 s.*wait_for_nobody"):
        loop.run_until_complete(task)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        loop.run_until_complete(task)


def test_a_cancelled_timer_neither_fires_nor_moves_the_clock(loop: VirtualTimeLoop) -> None:
    fired: list[str] = []
    loop.call_later(9.0, fired.append, "late").cancel()
    loop.run_until_complete(asyncio.sleep(1))
    assert fired == []
    assert loop.now_us() == 1_000_000
    with pytest.raises(DeadlockError, match=r"at 1\.000000 s"):
        loop.run_forever()


def test_cancelled_timers_do_not_pile_up(loop: VirtualTimeLoop) -> None:
    kept: list[int] = []
    for number in range(20_000):
        loop.call_later(100.0 + number, kept.append, number).cancel()
    loop.call_later(50.0, kept.append, -1)
    assert len(loop._timers) < 1_000
    loop.run_until_complete(asyncio.sleep(60))
    assert kept == [-1]


def test_time_outs_work_in_virtual_time() -> None:
    async def scenario() -> float:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(30):
                await asyncio.Event().wait()
        return asyncio.get_running_loop().time()

    assert run(scenario()) == 30.0


def test_a_thread_takes_no_virtual_time() -> None:
    async def scenario() -> tuple[float, str]:
        loop = asyncio.get_running_loop()
        other = loop.create_task(asyncio.sleep(0.001))
        answer = await loop.run_in_executor(None, lambda: threading.current_thread().name)
        passed = loop.time()
        await other
        return passed, answer

    passed, answer = run(scenario())
    assert passed == 0.0
    assert answer != threading.current_thread().name


def test_an_exception_in_a_plain_callback_ends_the_run(loop: VirtualTimeLoop) -> None:
    def broken(_when_us: int) -> None:
        raise RuntimeError("invariant broken")

    loop.at_us(10, broken)
    with pytest.raises(RuntimeError, match="invariant broken"):
        loop.run_until_complete(asyncio.sleep(1))


def test_stop_from_a_timer_stops_there(loop: VirtualTimeLoop) -> None:
    fired: list[int] = []
    loop.at_us(10, lambda _when_us: loop.stop())
    loop.at_us(20, fired.append)
    loop.run_forever()
    assert loop.now_us() == 10
    assert fired == []


def test_a_paced_clock_never_runs_ahead_of_the_wall() -> None:
    begin = time.monotonic()
    run(asyncio.sleep(0.5), pace=50.0)
    assert time.monotonic() - begin >= 0.01


def test_a_paced_clock_gives_up_a_large_lag_instead_of_racing(monkeypatch: pytest.MonkeyPatch) -> None:
    wall_s = [100.0]
    monkeypatch.setattr(virtual_time, "time", SimpleNamespace(monotonic=lambda: wall_s[0]))
    loop = VirtualTimeLoop(pace=1.0)
    fired: list[int] = []

    def machine_was_asleep(_when_us: int) -> None:
        wall_s[0] += 30.0

    loop.at_us(0, machine_was_asleep)
    for when_us in (1_000_000, 1_000_000, 29_000_000):
        loop.at_us(when_us, fired.append)
    loop.at_us(1_000_000, lambda _when_us: loop.stop())
    loop.run_forever()
    loop.close()
    # The second that was due is served; the other 28 are not made up for.
    assert fired == [1_000_000, 1_000_000]
    assert loop.slipped_s == pytest.approx(29.0)


def test_sockets_work_at_a_pace() -> None:
    async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(await reader.readline())
        await writer.drain()
        writer.close()
        await writer.wait_closed()

    async def scenario() -> tuple[bytes, list[float]]:
        loop = asyncio.get_running_loop()
        ticks: list[float] = []
        loop.call_later(0.001, lambda: ticks.append(loop.time()))
        server = await asyncio.start_server(echo, "127.0.0.1", 0)
        async with server, asyncio.timeout(DEADLINE_S):
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname()[:2])
            await asyncio.sleep(0.01)
            writer.write(b"hello\n")
            answer = await reader.readline()
            writer.close()
            await writer.wait_closed()
        return answer, ticks

    answer, ticks = run(scenario(), pace=1.0)
    assert answer == b"hello\n"
    assert len(ticks) == 1
    assert round(ticks[0] * 1e6) >= 1_000


def test_sockets_work_without_a_pace_too() -> None:
    async def scenario() -> bytes:
        async def answer(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(b"served\n")
            writer.close()
            await writer.wait_closed()

        server = await asyncio.start_server(answer, "127.0.0.1", 0)
        async with server:
            reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname()[:2])
            line = await reader.readline()
            writer.close()
            await writer.wait_closed()
            return line

    assert run(scenario()) == b"served\n"


@pytest.mark.parametrize("pace", [0.0, -1.0, float("nan")])
def test_a_pace_must_be_positive(pace: float) -> None:
    with pytest.raises(ValueError, match="pace"):
        VirtualTimeLoop(pace=pace)


def test_a_loop_clock_never_shows_less_than_was_asked_for(loop: VirtualTimeLoop) -> None:
    clock = LoopClock(loop)
    seen: list[tuple[int, int]] = []
    clock.at_us(1_234_567, lambda when_us: seen.append((when_us, clock.now_us())))
    loop.run_until_complete(asyncio.sleep(2))
    assert seen == [(1_234_567, 1_234_567)]


def test_the_pace_may_change_while_the_clock_runs() -> None:
    """An hour at once, then 100 ms at real time, then an hour at once again."""

    async def main(loop: VirtualTimeLoop) -> list[float]:
        walls = [time.monotonic()]
        for pace, wait_s in ((None, 3_600.0), (1.0, 0.1), (None, 3_600.0)):
            loop.set_pace(pace)
            await asyncio.sleep(wait_s)
            walls.append(time.monotonic())
        assert loop.now_us() == 7_200_100_000
        with pytest.raises(ValueError, match="pace 0"):
            loop.set_pace(0)
        return walls

    loop = VirtualTimeLoop()
    try:
        begin, hurried, paced, end = loop.run_until_complete(main(loop))
    finally:
        loop.close()
    assert hurried - begin < 1 and end - paced < 1
    assert paced - hurried >= 0.1


def test_a_pace_set_by_a_plain_callback_holds_for_the_next_timer() -> None:
    loop = VirtualTimeLoop()
    walls: list[float] = []

    def slow_down(_: int) -> None:
        loop.set_pace(1.0)
        walls.append(time.monotonic())

    def stop(_: int) -> None:
        walls.append(time.monotonic())
        loop.stop()

    loop.at_us(1_000_000_000, slow_down)
    loop.at_us(1_000_100_000, stop)
    try:
        loop.run_forever()
    finally:
        loop.close()
    assert walls[1] - walls[0] >= 0.1
