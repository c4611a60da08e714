"""A machine whose board is slow: thinking takes virtual time, motion goes on meanwhile, and runs repeat."""

from collections.abc import Iterator
from typing import TypeVar

import pytest

from bus_sim.faults import slowness
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.messages import Bid, CallForProposals, DriveOrder, DriveState, Message
from onboard.core.serial import from_bus_ms
from tests.faults.world import Seen, watch
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

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


@pytest.mark.parametrize(("slice_steps", "is_late"), [(60, False), (100_000, True)])
def test_motion_is_served_between_slices(monkeypatch: pytest.MonkeyPatch, slice_steps: int, is_late: bool) -> None:
    """No order to a drive that moves is later than 300 ms; where searches are not sliced one is."""
    monkeypatch.setattr(slowness, "SLICE_STEPS", slice_steps)
    faults = [parse_injection("slow:target=MR1|MR2,factor=150")]
    cars = stays(*[(20.0 * number, 150.0 + 20 * number) for number in range(5)])
    scene = play(at_the_key(find_site("small")), cars, plant=lambda run: arm(run, faults), limit_s=400, extra_s=0)
    refresh_us = scene.simulation.site.timing.drive_refresh_us
    late_us = [us - refresh_us for name in ("MR1", "MR2") for us in waits_for_order(scene, name)]
    assert len(late_us) > 100
    assert (max(late_us) > 300_000) is is_late


def waits_for_order(scene: Scene, name: str) -> Iterator[int]:
    """How long a moving drive waited each time until its order was said again, us."""
    said_us, sequence, moved = 0, None, False
    for one in scene.said:
        if one.bus == name and isinstance(one.message, DriveState):
            moved = one.message.speed_mm_s != 0
        elif one.bus == name and isinstance(one.message, DriveOrder):
            if moved and one.message.sequence == sequence:
                yield one.time_us - said_us
            said_us, sequence = one.time_us, one.message.sequence
