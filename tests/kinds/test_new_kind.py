"""The machine of docs/new-kind.md, exactly as it is written there, on a simulated CAN bus."""

import asyncio
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import pytest

from bus_sim.devices.timers import LoopTimers
from bus_sim.options import RunOptions
from bus_sim.run import BusRun, buses_of
from bus_sim.sites import find_site
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import Criterion, KindCode, Operation, TaskPhase
from onboard.contract.messages import NO_REFERENCE, Award, Bid, Message, Reference, TaskReport
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, RequestedTerms
from onboard.core.site import Machine, Segment, Site
from onboard.systems.registry import add_system, remove_system
from onboard.systems.system import System
from onboard.work.plain import NoEstimator, Plain

PAGE = Path(__file__).parents[2] / "docs" / "new-kind.md"
DESK, OLD, NEW = 1, 21, 22


@dataclass(frozen=True, kw_only=True)
class Shop(Site):
    system: ClassVar[str] = "workshop"


@dataclass
class Desk(Plain):
    """Has three parts, one each two seconds."""

    left: list[int] = field(default_factory=lambda: [1, 2, 3])

    def advance(self, now_us: int) -> list[Effect]:
        due_us = self.next_wake()
        if due_us is None or now_us < due_us:
            return []
        number = self.left.pop(0)
        terms = RequestedTerms(
            Reference(DESK, number), Operation.MACHINE, KindCode.LATHE, Criterion.FINISH_TIME, 0, 0, NO_REFERENCE, 0
        )
        return self.fleet.negotiation.open(terms, now_us)

    def next_wake(self) -> int | None:
        return 10_000_000 + 2_000_000 * self.left[0] if self.left else None


class DeskFactory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Desk:
        return Desk(fleet, KindCode.DESK)


class NoPlant:
    def __init__(self) -> None:
        self.timers = LoopTimers(asyncio.get_running_loop())

    def start(self) -> None:
        """Nothing outside the controllers."""


def written() -> dict[str, Any]:
    """What the page's Python defines."""
    text = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert text is not None
    namespace: dict[str, Any] = {"__name__": "page"}
    exec(compile(text[1], str(PAGE), "exec"), namespace)  # noqa: S102  # to run it as written is the point
    return namespace


@pytest.fixture
def shop() -> Iterator[Shop]:
    factory = written()["PolisherFactory"]()
    add_system(System("workshop", {KindCode.LATHE: factory, KindCode.DESK: DeskFactory()}))
    machines = {
        DESK: Machine(DESK, "Desk", KindCode.DESK, Segment(0, 0)),
        OLD: Machine(OLD, "Old", KindCode.LATHE, Segment(0, 0)),
        NEW: Machine(NEW, "New", KindCode.LATHE, Segment(0, 0)),
    }
    timing = find_site("level1").timing
    yield Shop(name="shop", digest=1, bitrate=500_000, machines=machines, timing=timing)
    remove_system("workshop")


def test_p22_the_machine_of_the_tutorial_works_as_it_is_written(shop: Shop) -> None:
    said: list[tuple[int, Message]] = []
    loop = VirtualTimeLoop()

    async def play() -> None:
        run = BusRun(shop, RunOptions(), loop, *buses_of(shop, (), loop), NoPlant())
        run.observers.append(lambda message, time_us: said.append((time_us, message)))
        run.start()
        await asyncio.sleep(120)

    try:
        loop.run_until_complete(play())
    finally:
        loop.close()
    winners = [m.winner for _, m in said if isinstance(m, Award)]
    done = [(m.sender, m.task.number) for _, m in said if isinstance(m, TaskReport) and m.phase is TaskPhase.DONE]
    assert {m.sender for _, m in said if isinstance(m, Bid)} == {OLD, NEW}
    assert sorted(winners) == [OLD, NEW, NEW], (
        "the new machine takes a second part while the old one is still at its first"
    )
    assert sorted(number for _, number in done) == [1, 2, 3]


def test_it_is_about_fifty_lines() -> None:
    text = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert text is not None
    assert sum(1 for line in text[1].splitlines() if line.strip()) <= 60
