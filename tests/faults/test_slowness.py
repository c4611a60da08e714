"""A machine whose board is slow: thinking takes virtual time, motion goes on meanwhile, and runs repeat."""

from typing import TypeVar

import pytest

from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.messages import Bid, CallForProposals, Message
from onboard.core.serial import from_bus_ms
from tests.faults.world import Seen, watch

ROBOT = 11
M = TypeVar("M", bound=Message)


def times(seen: Seen, kind: type[M], sender: int | None = None) -> list[tuple[int, M]]:
    return [(t, m) for t, m in seen.fleet if isinstance(m, kind) and sender in (None, m.sender)]


def is_slow(simulation: Simulation) -> bool:
    return simulation.controllers[ROBOT].taken_us is not None


def test_runs_with_a_slow_machine_repeat() -> None:
    first, again = (watch("slow:target=MR1,factor=50", seconds=60) for _ in range(2))
    assert first.fleet == again.fleet and first.device == again.device
    assert first.fleet != watch(seconds=60).fleet


def test_a_slow_machine_bids_later() -> None:
    quick, slow = watch(seconds=60), watch("slow:target=MR1,factor=50", seconds=60)
    ((quick_us, _),), ((slow_us, _),) = times(quick, Bid), times(slow, Bid)
    assert quick_us + 10_000 < slow_us


@pytest.mark.parametrize(("factor", "unanswered"), [(50, 0), (300, 0), (1_000, 3)])
def test_no_bid_comes_after_its_deadline(factor: int, unanswered: int) -> None:
    """Who cannot find its cost in time is silent; the desk calls again, and then for longer."""
    seen = watch(f"slow:target=MR1,factor={factor}", seconds=60)
    deadlines = {call.call: from_bus_ms(call.deadline_ms, time_us) for time_us, call in times(seen, CallForProposals)}
    bids = {bid.call: time_us for time_us, bid in times(seen, Bid)}
    assert bids and all(time_us < deadlines[call] for call, time_us in bids.items())
    assert len(deadlines) - len(bids) == unanswered


@pytest.mark.parametrize(("fault", "after"), [("", False), ("crash:target=MR1,at_s=12,restart_s=3", True)])
def test_it_is_slow_for_so_long_and_after_a_restart_too(fault: str, after: bool) -> None:
    faults = ("slow:target=MR1,at_s=10,for_s=20", *([fault] if fault else []))
    seen = watch(*faults, seconds=26, look=(25, is_slow), cars=0)
    assert seen.looks == [True]
    assert watch(*faults, seconds=32, look=(31, is_slow), cars=0).looks == [False]
    assert seen.simulation.controllers[ROBOT].holon.boot == (2 if after else 1)
