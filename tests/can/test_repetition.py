"""A lone node's attempts are not played one by one where nobody looks at them: all that can be seen is the same."""

import asyncio
import random
from collections.abc import Callable
from functools import partial

import pytest

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.can.medium import Medium
from bus_sim.can.node import NodeOptions, SimulatedBus
from bus_sim.can.statistics import BusStatistics
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.frame import Frame
from tests.can.rig import ext, std

DAY_US = 3_000_000
Act = Callable[[str, Frame, NodeOptions], object]


class Day:
    """Nodes that come, go, send and ask on one bus, drawn from a seed; ``seen`` is all that can be seen of it."""

    def __init__(self, seed: int, *, every_error: bool) -> None:
        self.seen: list[object] = []
        self.loop = VirtualTimeLoop()
        chance = random.Random(seed)
        bit_rate = chance.choice((10_000, 83_333, 125_000, 500_000, 1_000_000))
        struck_us = sorted(chance.sample(range(DAY_US), 2))
        strikes = InjectedFault(FaultKind.CORRUPTION, from_us=struck_us[0], until_us=struck_us[1], probability=0.5)
        self.medium = Medium(self.loop, bit_rate=bit_rate, faults=[strikes] if seed % 2 else [])
        if every_error:
            self.medium.tap(lambda _frame, _time_us, _sender: None, errors=ErrorsHeard.EVERY)
        self.medium.tap(
            lambda frame, time_us, sender: self.note(sender, "tap", frame, time_us), errors=ErrorsHeard.NONE
        )
        self.nodes: dict[str, SimulatedBus] = {}
        self.leaving: list[asyncio.Task[None]] = []
        for number in range(chance.randrange(10, 60)):
            act = chance.choice(
                (self.come, self.go, self.vanish, self.send, self.send, self.ask, self.measure, self.look)
            )
            name = chance.choice("abc" if seed % 3 else "ab")
            frame = (ext if chance.random() < 0.7 else std)(number, chance.randbytes(chance.randrange(9)))
            options = NodeOptions(mailboxes=chance.randrange(1, 4), receive_errors=chance.random() < 0.1)
            self.loop.at_us(chance.randrange(DAY_US), partial(self.do, act, name, frame, options))

    def do(self, act: Act, name: str, frame: Frame, options: NodeOptions, now_us: int) -> None:
        self.note(now_us, name, act.__name__, act(name, frame, options))

    def note(self, *what: object) -> None:
        self.seen.append(what)

    def come(self, name: str, _: Frame, options: NodeOptions) -> None:
        if name not in self.nodes:
            node = self.nodes[name] = self.medium.attach(name, options=options)
            node.subscribe(partial(self.note, name, "heard"), partial(self.note, name, "sent"))

    def go(self, name: str, _: Frame, __: NodeOptions) -> None:
        if name in self.nodes:
            self.leaving.append(self.loop.create_task(self.nodes.pop(name).close()))

    def vanish(self, name: str, _: Frame, __: NodeOptions) -> None:
        if name in self.nodes:
            self.nodes.pop(name).power_off()

    def send(self, name: str, frame: Frame, _: NodeOptions) -> object:
        return self.nodes[name].send(frame) if name in self.nodes else None

    def ask(self, name: str, _: Frame, __: NodeOptions) -> object:
        return self.nodes[name].health() if name in self.nodes else None

    def measure(self, *_: object) -> object:
        return self.medium.statistics()

    def look(self, *_: object) -> object:
        self.medium.restart_statistics()
        return self.medium.is_silent

    def play(self) -> list[object]:
        self.loop.run_until_complete(asyncio.sleep(DAY_US / 1e6))
        self.seen += [self.medium.statistics(), [node.health() for node in self.nodes.values()]]
        self.loop.close()
        return self.seen


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_what_can_be_seen_is_the_same_whether_each_attempt_is_played_or_not(first: int) -> None:
    saved = 0
    for seed in range(first, first + 20):
        played, told = Day(seed, every_error=True), Day(seed, every_error=False)
        assert told.play() == played.play(), seed
        saved += played.loop.events - told.loop.events
    assert saved > 10_000


def test_an_hour_of_attempts_costs_as_little_as_a_moment_and_is_counted_in_full() -> None:
    loop = VirtualTimeLoop()
    medium = Medium(loop)
    medium.attach("a").send(ext(0x123456, bytes(range(8))))
    loop.run_until_complete(asyncio.sleep(3600))
    assert loop.events < 50
    statistics = medium.statistics()
    assert statistics.error_frames > 10_000_000
    assert statistics.worst_second_load == pytest.approx(statistics.mean_load, rel=0.06)
    loop.close()


@pytest.mark.parametrize("leaves", [False, True])
def test_who_comes_or_goes_at_any_moment_of_an_attempt_finds_the_same(leaves: bool) -> None:
    """At whole microseconds too, where the bus has something to do itself: it comes last."""
    for when_us in range(4_000, 4_080):
        played, told = (moment(when_us, leaves=leaves, every_error=every_error) for every_error in (True, False))
        assert told == played, when_us


def moment(when_us: int, *, leaves: bool, every_error: bool) -> tuple[list[object], BusStatistics]:
    """One node says something to nobody, and then another comes, perhaps as it goes: what is heard."""
    loop = VirtualTimeLoop()
    medium = Medium(loop, bit_rate=1_000_000)
    heard: list[object] = []
    medium.tap(lambda *_: None, errors=ErrorsHeard.EVERY if every_error else ErrorsHeard.COUNTED)
    medium.tap(lambda *frame: heard.append(frame), errors=ErrorsHeard.NONE)
    sender = medium.attach("a")
    sender.send(std(0x55))

    def change(_now_us: int) -> None:
        heard.append(medium.statistics())
        if leaves:
            sender.power_off()
        medium.attach("b")

    loop.at_us(when_us, change)
    loop.run_until_complete(asyncio.sleep(0.005))
    loop.close()
    return heard, medium.statistics()


def test_a_log_has_what_a_lone_node_counts_and_not_its_attempts_of_an_hour() -> None:
    loop = VirtualTimeLoop()
    medium = Medium(loop)
    heard: list[Frame] = []
    medium.tap(lambda frame, _time_us, _sender: heard.append(frame))
    medium.attach("a").send(std(0x55))
    loop.run_until_complete(asyncio.sleep(3600))
    loop.close()
    assert [frame.data[6] for frame in heard] == list(range(8, 129, 8))
    assert medium.statistics().error_frames > 10_000_000
    assert loop.events < 100
