"""The scenarios of the bench in the simulator's own time: what a good controller passes, and broken ones do not."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from hil.bench import Bench, Target
from hil.device import Device
from hil.play import ScenarioOutcome, play
from hil.scenarios.registry import SCENARIOS
from hil.scenarios.scenario import BenchScenario
from hil.simulated_device import SimulatedDevice
from onboard.contract.codes import Reason
from onboard.contract.messages import Bid, Diagnostic, DriveOrder, Heartbeat, Message
from onboard.controller.shell import Controller
from onboard.core.effects import Actuate, Effect, Send
from tests.hil.bench_files import simulated

#: Makes another effect, or none, of what the device does.
Change = Callable[[Controller, Effect], Effect | None]


def named(name: str) -> BenchScenario:
    return next(one for one in SCENARIOS if one.name == name)


def play_with(name: str, directory: Path, change: Change | None = None) -> ScenarioOutcome:
    """Play a scenario with a device whose effects are changed."""

    def prepare(device: Device) -> None:
        assert isinstance(device, SimulatedDevice)
        if change is not None:
            device.before_start.append(lambda controller: spoil(controller, change))

    bench = simulated()
    return play(bench, bench.targets[0], named(name), directory, prepare)


def spoil(controller: Controller, change: Change) -> None:
    perform = controller._perform

    def changed(effect: Effect) -> None:
        instead = change(controller, effect)
        if instead is not None:
            perform(instead)

    controller._perform = changed  # type: ignore[method-assign]  # a controller that is broken, for this test


def cases_of(bench: Bench) -> Iterator[tuple[Target, BenchScenario]]:
    """Every machine of the site in turn is the device."""
    for machine in bench.site.machines.values():
        for scenario in SCENARIOS:
            if not scenario.kinds or machine.kind in scenario.kinds:
                yield replace(bench.targets[0], machine=machine), scenario


TESTS = [(simulated(), *case) for case in cases_of(simulated())]
#: Of other systems the one machine that their bench names.
TESTS += [
    (bench, bench.targets[0], scenario)
    for bench in map(simulated, ("cell", "graph", "turning"))
    for target, scenario in cases_of(bench)
    if target.machine == bench.targets[0].machine
]
NAMES = [f"{bench.name} {target.machine.name} {scenario.name}" for bench, target, scenario in TESTS]


@pytest.mark.parametrize(("bench", "target", "scenario"), TESTS, ids=NAMES)
def test_a_good_controller_passes(bench: Bench, target: Target, scenario: BenchScenario, tmp_path: Path) -> None:
    outcome = play(bench, target, scenario, tmp_path)
    assert outcome.is_good, "\n".join(outcome.lines())
    assert (tmp_path / "trace.log").stat().st_size > 0
    assert outcome.properties()["sent"] > 0


def test_latencies_are_measured_from_call_to_bid_and_from_grant_to_motion(tmp_path: Path) -> None:
    latencies = play_with("moves under authority", tmp_path).latencies
    # The best bidder speaks at once, in its slot; the drive says that it moves within a frame or two of its order.
    assert 0 < latencies.worst()["call_to_bid_worst_us"] < 20_000
    assert 0 < latencies.worst()["grant_to_motion_worst_us"] < 10_000


def silent_bidder(_: Controller, effect: Effect) -> Effect | None:
    return None if isinstance(effect, Send) and isinstance(effect.message, Bid) else effect


def test_a_device_that_does_not_bid_is_found_out(tmp_path: Path) -> None:
    failure = play_with("bids", tmp_path, silent_bidder).failure
    assert failure is not None
    assert failure.startswith("no bid within 20 s; MR1 last said ")


def lame_drive(_: Controller, effect: Effect) -> Effect | None:
    return None if isinstance(effect, Actuate) and isinstance(effect.message, DriveOrder) else effect


def test_a_device_that_does_not_move_is_found_out(tmp_path: Path) -> None:
    failure = play_with("moves under authority", tmp_path, lame_drive).failure
    assert failure is not None
    assert "no progress off the home segment" in failure
    assert play_with("yields", tmp_path, lame_drive).failure is not None


def test_a_device_that_moves_without_authority_is_found_by_the_judge(tmp_path: Path) -> None:
    def reckless(controller: Controller, effect: Effect) -> Effect | None:
        if isinstance(effect, Actuate) and isinstance(effect.message, DriveOrder):
            order = effect.message
            # Straight to the far end of the alley, whatever was granted.
            return replace(effect, message=DriveOrder(order.sender, order.sequence, 12_000, order.speed_limit_mm_s))
        return effect

    outcome = play_with("moves under authority", tmp_path, reckless)
    assert any("inside-authority" in fault and "BROKEN" in fault for fault in outcome.judgement.faults), outcome.lines()


def test_a_device_that_forgets_its_life_is_found_out(tmp_path: Path) -> None:
    def always_first(_: Controller, effect: Effect) -> Effect | None:
        if isinstance(effect, Send) and isinstance(effect.message, Heartbeat):
            beat = effect.message
            return Send(
                Heartbeat(beat.sender, beat.contract, beat.site_digest, beat.mirror_digest, 1, beat.kind, beat.state)
            )
        return effect

    failure = play_with("survives a reset", tmp_path, always_first).failure
    assert failure is not None


def test_input_that_is_dropped_for_no_good_reason_is_a_fault(tmp_path: Path) -> None:
    told: list[Effect] = []

    def complains(controller: Controller, effect: Effect) -> Effect | None:
        if isinstance(effect, Send) and isinstance(effect.message, Heartbeat) and not told:
            told.append(effect)
            complaint: Message = Diagnostic(controller.holon.node_id, Reason.SHORT_FRAME, 3)
            controller._perform(Send(complaint))
        return effect

    outcome = play_with("joins", tmp_path, complains)
    assert outcome.failure is None
    assert outcome.judgement.faults == ("it dropped input: SHORT_FRAME 3 times",)


def test_a_device_that_says_nothing_is_told_as_such(tmp_path: Path) -> None:
    outcome = play_with("joins", tmp_path, lambda _, effect: None if isinstance(effect, Send) else effect)
    assert outcome.failure == "no heartbeat of the device within 60 s; MR1 has said nothing on the fleet bus"
