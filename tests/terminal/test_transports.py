"""Transports to a container terminal: a mission of the desk, done by the vehicle that bids best (rows M05, M39)."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import pytest

from bus_sim.options import RunOptions
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import CallForProposals, Message, TaskReport
from onboard.contract.terminal import BoxOrder, TaskTerms
from tests.mqtt.ordered import NODE, Ordered
from tests.terminal.seeds import short

#: The desk's own mission, which keeps the run going.
MISSION = '[[missions]]\nat_s = {}\ntranship = ["B3"]\nto = "S4"\n'
SITE = short(MISSION.format(5))
DESK = SITE.desk
Said = list[tuple[int, Message]]


def orders_topic(site: Any = SITE) -> str:
    return f"onboard/{site.name}/orders"


def order(name: str = "T1", load: str = "B4", end: str = "S4", **more: Any) -> dict[str, Any]:
    return {"id": name, "load": load, "to": end} | more


def run(
    told: Sequence[tuple[float, dict[str, Any]]],
    *,
    stop_s: float = 320.0,
    crash_s: float | None = None,
    deaths_s: Sequence[float] = (),
    mission_s: int = 300,
) -> tuple[TerminalOutcome, Said, Ordered]:
    site, said = short(MISSION.format(mission_s)), Said()
    ordered = Ordered([(at_s, orders_topic(site), one) for at_s, one in told], deaths_s=deaths_s)

    def prepare(simulated: TerminalRun) -> None:
        simulated.observers.append(lambda message, time_us: said.append((time_us, message)))
        ordered.attach(simulated)
        simulated.loop.call_at(stop_s, ordered.stop)
        if crash_s is not None:
            machine = site.machines[site.desk]
            simulated.plant.timers.call_at(round(crash_s * 1e6), partial(simulated.crash, machine))
            again_us = round(crash_s * 1e6) + 2_000_000
            simulated.plant.timers.call_at(again_us, partial(simulated.start_controller, machine))

    outcome = play(site, RunOptions(seed=1), limit_us=900_000_000, prepare=prepare)
    return outcome, said, ordered


def done(said: Said) -> set[int]:
    """Who told that a task of the gateway was done."""
    reports = [one for _, one in said if isinstance(one, TaskReport) and one.task.origin == NODE]
    return {one.sender for one in reports if one.phase is TaskPhase.DONE}


@pytest.mark.parametrize("deaths_s", [(), (20.002,), (60.0,)])
def test_a_transport_is_a_mission_of_the_desk_and_its_life_comes_back(deaths_s: tuple[float, ...]) -> None:
    """Given three times, once when it is done; the gateway may die."""
    told = [(20.0, order()), (30.0, order()), (310.0, order())]
    outcome, said, ordered = run(told, deaths_s=deaths_s)
    assert outcome.is_good
    calls = [one for _, one in said if isinstance(one, CallForProposals) and one.task.origin == NODE]
    assert {(one.sender, one.car.number, one.to_station) for one in calls} == {
        (DESK, SITE.boxes.index(next(box for box in SITE.boxes if box.name == "B4")) + 1, SITE.by_name["S4"].number)
    }
    assert len({one.task for one in calls}) == 1 and len(done(said) - {DESK}) == 1
    lives = ordered.lives(SITE.name, "T1")
    assert lives[0] == "accepted" and lives[-1] == "done" and "refused" not in lives
    assert deaths_s or lives[:3] == ["accepted", "called", "awarded"]
    assert str(ordered.told(SITE.name, "T1")[-1]["owner"]).startswith("R")


def test_a_deadline_and_a_priority_are_passed_on_to_the_mission() -> None:
    """The loop's zero is 06:00:00 on the wall; `before` is 40 s after the order."""
    told = order(before="2026-03-01T06:01:00Z", priority=5)
    _, said, _ = run([(20.0, told)])
    (first, *_) = [(t, one) for t, one in said if isinstance(one, BoxOrder)]
    assert first[1].urgent and 38 <= first[1].within_s <= 40
    terms = next(one for _, one in said if isinstance(one, TaskTerms) and one.task.origin == NODE)
    assert 58_000 <= terms.before_ms <= 61_000


def test_the_desk_keeps_a_transport_over_its_own_restart() -> None:
    outcome, said, ordered = run([(20.0, order())], crash_s=22.0)
    assert outcome.is_good and ordered.lives(SITE.name, "T1")[-1] == "done"
    assert len(done(said) - {DESK}) == 1


def test_what_cannot_be_a_transport_is_refused_with_the_place() -> None:
    wrong = [
        ({"id": "x", "to": "S4"}, "INCOMPLETE", "$.load"),
        (order(load="B999"), "UNKNOWN_LOAD", "$.load"),
        (order(end="A1"), "UNKNOWN_PLACE", "$.to"),
        (order("twice", load="B3"), "IMPOSSIBLE", None),
    ]
    told = [(20.0 + 2 * place, one) for place, (one, *_) in enumerate(wrong)]
    _, said, ordered = run(told, mission_s=5, stop_s=60.0)
    refused = [(one["reason"], one.get("path")) for one in ordered.told(SITE.name) if one["phase"] == "refused"]
    assert refused == [(why, path) for _, why, path in wrong]
    assert len({one.number for _, one in said if isinstance(one, BoxOrder)}) == 1
