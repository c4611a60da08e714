"""A bid brings its reservations: tentative with the bid, firm with the award, free when outbid (rows P47, P48)."""

from dataclasses import dataclass, field

import pytest

from bus_sim.can.node import SimulatedBus
from bus_sim.sites import find_site
from bus_sim.systems.car_park.planted.tools import replace
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, Grade, KindCode, Operation, Reason, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Itinerary,
    ItineraryHead,
    ItineraryLeg,
    Message,
    TaskReport,
)
from onboard.core.frame import Frame
from onboard.core.negotiation import CallKey
from onboard.core.serial import from_bus_ms
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.robot import ParkingRobot
from onboard.wire.codec import fleet_codec
from tests.sites import one_floor, telling
from tests.system.scene import Scene, play, stays

SITE = telling(find_site("small"))


@pytest.fixture(scope="module")
def frames() -> dict[int, list[Message]]:
    """What each machine put on the fleet bus, frame by frame, in order."""
    heard: dict[int, list[Message]] = {}

    def on_frame(frame: Frame, _time_us: int, _sender: str) -> None:
        part = fleet_codec().decode_part(frame)
        assert isinstance(part, Message)
        heard.setdefault(part.sender, []).append(part)

    scene = play(SITE, stays((0, 400), (60, 500)), before=lambda simulation: simulation.fleet.tap(on_frame))
    scene.assert_sound()
    return heard


def group_after(said: list[Message], number: int) -> tuple[ItineraryHead, list[ItineraryLeg]]:
    """The head and the legs that follow a frame without any other of the same sender between."""
    head = said[number + 1]
    assert isinstance(head, ItineraryHead), said[number + 1]
    legs = [leg for leg in said[number + 2 : number + 2 + head.legs] if isinstance(leg, ItineraryLeg)]
    assert len(legs) == head.legs
    return head, legs


def test_p48_performance_pre_assignment_and_tentative_itinerary_are_one_group_of_frames(
    frames: dict[int, list[Message]],
) -> None:
    """Bid, head and legs one after the other; head and legs carry the version that the bid names."""
    groups = 0
    for node, said in frames.items():
        for number, one in enumerate(said):
            if not isinstance(one, Bid) or SITE.machines[node].kind is not KindCode.ROBOT:
                continue
            head, legs = group_after(said, number)
            assert (head.version, head.grade) == (one.itinerary_version, Grade.TENTATIVE)
            assert [(leg.version, leg.leg) for leg in legs] == [(head.version, number) for number in range(head.legs)]
            # The last leg's end is beyond what was bid for: the way to a refuge follows.
            assert head.legs >= 3 and head.stamp.award_ms + legs[-1].end_ms >= one.cost
            groups += 1
    assert groups == 4


def test_p47_the_firm_itinerary_engages_the_way_that_the_tentative_one_pre_engaged(
    frames: dict[int, list[Message]],
) -> None:
    for node, said in frames.items():
        heads = [(i, p) for i, p in enumerate(said) if isinstance(p, ItineraryHead)]
        for at, (number, head) in enumerate(heads):
            if head.grade is not Grade.TENTATIVE:
                continue
            following, firm = heads[at + 1]
            assert firm.grade is Grade.FIRM and firm.version != head.version, "another grade, another version"
            _, tentative = group_after(said, number - 1)
            _, engaged = group_after(said, following - 1)
            # Tracks and indices of the whole way; kept steps of the task before may come first.
            way = [_place(leg) for leg in tentative]
            assert [_place(leg) for leg in engaged][-len(way) :] == way, node


def _place(leg: ItineraryLeg) -> tuple[int, ...]:
    return leg.action, leg.track, leg.from_index, leg.to_index


def test_a_plan_is_told_with_its_award_alone_unless_the_site_tells_offers() -> None:
    scene = play(find_site("small"), stays((0, 400)))
    scene.assert_sound()
    assert {plan.grade for _, plan in scene.all(Itinerary)} == {Grade.FIRM}
    robots = [bid for _, bid in scene.all(Bid) if SITE.machines[bid.sender].kind is KindCode.ROBOT]
    assert len(robots) == 2 and {bid.itinerary_version for bid in robots} == {0}


# --- outbid ----------------------------------------------------------------------------------------------------------


@dataclass
class Rival:
    """A machine from outside that underbids whatever is bid in the first call, and then gives the task up."""

    simulation: Simulation
    bus: SimulatedBus = field(init=False)
    call: tuple[int, int] | None = None
    kept: list[dict[CallKey, object]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.bus = self.simulation.fleet.attach("rival", 200)
        self.bus.subscribe(self._on_frame)

    def _on_frame(self, frame: Frame, _time_us: int) -> None:
        message = fleet_codec().decode_part(frame)
        if isinstance(message, Bid) and self.call in (None, (message.initiator, message.call)):
            self.call = (message.initiator, message.call)
            self.simulation.loop.call_later(0.02, self._outbid, message)
        if isinstance(message, Award) and (message.sender, message.call) == self.call and message.winner == 200:
            self._say(TaskReport(200, message.task, TaskPhase.AWARDED, 0, message.reason))

    def _outbid(self, bid: Bid) -> None:
        self.kept.append(dict(self._tentative))
        self._say(Bid(200, bid.initiator, bid.call, bid.cost - 100, 0))
        self.simulation.loop.call_later(0.01, lambda: self.kept.append(dict(self._tentative)))

    @property
    def _tentative(self) -> dict[CallKey, object]:
        behaviour = self.simulation.controllers[11].holon.behaviour
        assert isinstance(behaviour, ParkingRobot) and isinstance(behaviour.generation, CarParkGeneration)
        return dict(behaviour.generation.tentative)

    def _say(self, message: Message) -> None:
        for frame in fleet_codec().encode(message):
            self.bus.send(frame)


def admitted(simulation: Simulation) -> Simulation:
    """Machines that hear a node that their site does not have as if it were one of theirs."""
    for controller in simulation.controllers.values():
        replace(controller.holon.admission, "why_not", lambda _: lambda message: Reason.NONE)
    return simulation


@pytest.fixture(scope="module")
def outbid() -> tuple[Scene, Rival]:
    """Two customers come to two bays; robot 11 is outbid for the first car."""
    rivals: list[Rival] = []
    bay = '[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,6)"\n'
    scene = play(
        one_floor(extra=bay),
        stays((0, None), (1, None)),
        before=lambda simulation: rivals.append(Rival(admitted(simulation))),
        extra_s=60,
    )
    return scene, rivals[0]


def test_p47_being_outbid_frees_what_was_pre_engaged(outbid: tuple[Scene, Rival]) -> None:
    """Pre-engaged between its own bid and the better one, and nothing firm comes of it."""
    scene, rival = outbid
    assert rival.call is not None
    assert [list(kept) for kept in rival.kept] == [[rival.call], []]
    bid_us, _ = scene.first(Bid, lambda m: m.sender == 11)
    award_us, award = scene.first(Award, lambda m: (m.sender, m.call) == rival.call)
    assert (award.winner, award.result) == (200, CallResult.AWARDED) and award_us > bid_us
    # The better one does nothing, so that the car is called for once more.
    anew_us, _ = scene.first(CallForProposals, lambda m: m.task == award.task, after_us=award_us)
    assert not [t for t, m in scene.all(TaskReport) if m.sender == 11 and m.task == award.task and t < anew_us]


def test_p47_the_next_bid_is_as_if_the_lost_one_had_never_been(outbid: tuple[Scene, Rival]) -> None:
    """What was pre-engaged for the first car delays nothing: the second bid is what an idle robot offers."""
    scene, rival = outbid
    calls = {(c.sender, c.call): c for _, c in scene.all(CallForProposals) if c.operation is Operation.PARK}
    bids = [m for _, m in scene.all(Bid) if m.sender == 11]
    assert len(bids) >= 2 and (bids[0].initiator, bids[0].call) == rival.call
    took_ms = []
    for bid in bids[:2]:
        deadline_us = from_bus_ms(calls[bid.initiator, bid.call].deadline_ms, 0)
        took_ms.append(bid.cost - deadline_us // 1000)
    # The second bay is two segments nearer, 4.8 m at 1.5 m/s there and back again at most.
    assert took_ms[1] == pytest.approx(took_ms[0], abs=6_500)
    assert scene.first(Itinerary, lambda m: m.sender == 11 and m.grade is Grade.FIRM and len(m.legs) > 2)
