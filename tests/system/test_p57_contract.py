"""The DBC is the common interface: every frame of a run is in it, and a bid means what it says (rows P16, P57)."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from bus_sim.run import FLEET
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from dbc import device_dbc_text, fleet_dbc_text
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, TaskReport
from onboard.core.frame import Frame
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.wire.dbc_file import read_layouts
from onboard.wire.site_dbc import site_dbc
from tests.system.scene import Scene, play, stays
from tests.wire.samples import judge_of

SITE = find_site("small")


@dataclass
class Heard:
    """A finished run and every frame of it, with the bus that it was on."""

    scene: Scene
    frames: list[tuple[str, Frame]] = field(default_factory=list)


@pytest.fixture(scope="module")
def run() -> Heard:
    """Cars in and out on three floors, frames of the fleet bus and of all device buses."""
    frames: list[tuple[str, Frame]] = []

    def listen(simulation: Simulation) -> None:
        simulation.fleet.tap(_listener(frames, FLEET))
        for node_id, medium in simulation.devices.items():
            medium.tap(_listener(frames, SITE.machines[node_id].name))

    scene = play(SITE, stays((0, 500), (60, 620), (120, None)), before=listen)
    scene.assert_sound()
    return Heard(scene, frames)


def _listener(frames: list[tuple[str, Frame]], bus: str) -> Callable[[Frame, int, str], None]:
    return lambda frame, _time_us, _sender: frames.append((bus, frame))


def test_p57_every_frame_used_is_in_the_dbc_and_in_the_sites_dbc_with_the_same_meaning(run: Heard) -> None:
    types = {
        message.frame_id: message
        for text in (fleet_dbc_text(), device_dbc_text())
        for message in judge_of(text).messages
    }
    of_site = {message.frame_id: message for message in judge_of(site_dbc(SITE)).messages}
    names = {machine.node_id: machine.name for machine in SITE.machines.values()}
    assert len(run.frames) > 4_000
    for bus, frame in set(run.frames):
        kind, one = types.get(frame.arbitration_id & ~0xFF), of_site.get(frame.arbitration_id)
        assert kind is not None, f"{frame.arbitration_id:08X} on {bus} is in no DBC"
        sender = names[frame.arbitration_id & 0xFF]
        assert one is not None, f"{kind.name} of {sender} is not in the site's DBC"
        assert one.name == f"{sender}_{kind.name}" and one.comment == kind.comment
        assert len(frame.data) == kind.length == one.length
        assert bus in (FLEET, sender)
        values = kind.decode(frame.data)
        assert isinstance(values, dict)
        assert one.decode(frame.data) == values
        for signal in kind.signals:
            # A value without a name in its table stays a number.
            assert not signal.choices or not isinstance(values[signal.name], int), (kind.name, signal.name)


def test_p57_the_run_used_most_of_the_contract(run: Heard) -> None:
    """Else the test above would say little."""
    used = {frame.arbitration_id & ~0xFF for bus, frame in run.frames if bus == FLEET}
    unused = {layout.name for layout in read_layouts(fleet_dbc_text()) if layout.frame_id not in used}
    assert unused <= {
        "Blocked",
        "Clear",
        "EmergencyStop",
        "OperatorOrder",
        "CallParent",
        "Diagnostic",
        "Waiting",
        "TokenRefusal",
        "ManualOrder",
        "ManualState",
        "Go",
        "Halted",
        "LeftOut",
        "Regeneration",
        "RegenerationState",
        "SyncDone",
        "TokenAssigned",
        "TokenDispute",
        "TokenGiven",
        "TokenSeen",
    }


def test_p16_unit_and_meaning_of_a_bid_are_defined_once_in_the_dbc() -> None:
    messages = judge_of(fleet_dbc_text()).messages
    costs = [signal for message in messages for signal in message.signals if signal.name == "cost"]
    criteria = [signal for message in messages for signal in message.signals if signal.name == "criterion"]
    (cost,), (criterion,) = costs, criteria
    names = {value: str(name) for value, name in (criterion.choices or {}).items()}
    assert names == {int(one): one.name for one in Criterion}
    assert cost.comment is not None
    for name, unit in {"FINISH_TIME": "bus time in ms", "MONEY": "cents", "LENGTH": "mm"}.items():
        assert f"{name} {unit}" in cost.comment or f"{name} in {unit}" in cost.comment
    assert "Lower is better" in cost.comment


def test_p16_robots_and_lifts_bid_in_the_same_unit_which_is_when_the_work_is_done() -> None:
    """The winner's cost of each call, read as a date, is when its winner was done, early or late by little."""
    scene = play(dataclasses.replace(car_park(SITE), rides=RideCalls.BEFORE), stays((0, 500), (60, 620), (120, None)))
    scene.assert_sound()
    kinds = {node: machine.kind for node, machine in SITE.machines.items()}
    bidders = {kinds[bid.sender] for _, bid in scene.all(Bid)}
    assert bidders == {KindCode.ROBOT, KindCode.LIFT}
    awarded = {(a.sender, a.call): a.winner for _, a in scene.all(Award) if a.result is CallResult.AWARDED}
    checked, winners = 0, set[KindCode]()
    for opened_us, call in scene.all(CallForProposals):
        assert call.criterion is Criterion.FINISH_TIME
        winner = awarded.get((call.sender, call.call))
        bids = [b for _, b in scene.all(Bid) if (b.initiator, b.call, b.sender) == (call.sender, call.call, winner)]
        if not bids:
            continue
        assert bids[-1].cost * 1000 > opened_us
        winners.add(kinds[bids[-1].sender])
        if call.operation in (Operation.PARK, Operation.RETRIEVE):
            (done_us,) = (t for t, m in scene.all(TaskReport) if (m.task, m.phase) == (call.task, TaskPhase.DONE))
            assert done_us / 1000 == pytest.approx(bids[-1].cost, abs=20_000)
            checked += 1
    assert checked == 5
    assert winners == bidders, "what lifts bid is a date as well, by which robots take them"
