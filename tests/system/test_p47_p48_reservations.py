"""A bid brings its reservations: tentative with the bid, firm with the award, free when outbid (rows P47, P48)."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest

from bus_sim.can.node import SimulatedBus
from bus_sim.sites import find_site
from bus_sim.systems.car_park.planted.tools import replace
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import CallResult, Grade, KindCode, LegAction, Reason, TaskPhase
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
from onboard.ways.occupancy import itinerary_windows
from onboard.ways.reservations import Reservations, SlotWindow
from onboard.ways.site import BayUse
from onboard.wire.codec import fleet_codec
from tests.cut import shown
from tests.sites import one_floor, telling
from tests.system.scene import play, stays

SITE = telling(find_site("small"))
#: A machine that the site does not have.
RIVAL = 200


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

    def __post_init__(self) -> None:
        self.bus = self.simulation.fleet.attach("rival", RIVAL)
        self.bus.subscribe(self._on_frame)

    def _on_frame(self, frame: Frame, _time_us: int) -> None:
        message = fleet_codec().decode_part(frame)
        if isinstance(message, Bid) and self.call in (None, (message.initiator, message.call)):
            self.call = (message.initiator, message.call)
            self.simulation.loop.call_later(0.02, self._outbid, message)
        if isinstance(message, Award) and (message.sender, message.call) == self.call and message.winner == RIVAL:
            self._say(TaskReport(RIVAL, message.task, TaskPhase.AWARDED, 0, message.reason))

    def _outbid(self, bid: Bid) -> None:
        self._say(Bid(RIVAL, bid.initiator, bid.call, bid.cost - 100, 0))

    def _say(self, message: Message) -> None:
        for frame in fleet_codec().encode(message):
            self.bus.send(frame)


def admitted(simulation: Simulation) -> Simulation:
    """Machines that hear a node that their site does not have as if it were one of theirs."""
    for controller in simulation.controllers.values():
        replace(controller.holon.admission, "why_not", lambda _: lambda message: Reason.NONE)
    return simulation


def two_bays(*times_s: float, rival: bool = False, uses: dict[int, BayUse] | None = None) -> list[Message]:
    """What is said on the fleet bus where cars come to two bays before one robot."""
    bay = '[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,6)"\n'
    site = dataclasses.replace(telling(one_floor(extra=bay)), bay_uses=uses or {})

    def before(simulation: Simulation) -> None:
        if rival:
            Rival(admitted(simulation))

    scene = play(site, stays(*((at_s, None) for at_s in times_s)), before=before, limit_s=40, extra_s=0)
    return [said.message for said in scene.said if said.bus == "fleet"]


def test_p10_p47_being_outbid_frees_what_was_pre_engaged() -> None:
    """Outbid for the first car, it offers for the second what it would have offered without the first; else not."""
    alone = [one.cost for one in two_bays(1, uses={1: BayUse.EXIT}) if isinstance(one, Bid)]
    engaged = [one.cost for one in two_bays(0, 1) if isinstance(one, Bid) and one.initiator == 2]
    outbid = two_bays(0, 1, rival=True)

    def check(said: Sequence[Message]) -> None:
        calls = [one for one in said if isinstance(one, CallForProposals)]
        bids = [one for one in said if isinstance(one, Bid)]
        assert len(bids) > 2
        first, better, second = bids[:3]
        assert [first.sender, better.sender, second.sender] == [11, RIVAL, 11] and better.cost < first.cost
        assert [(first.initiator, first.call), (second.initiator, second.call)] == [
            (one.sender, one.call) for one in calls[:2]
        ]
        awards = [one for one in said if isinstance(one, Award)]
        assert [(one.sender, one.winner, one.result) for one in awards[:2]] == [
            (1, RIVAL, CallResult.AWARDED),
            (2, 11, CallResult.AWARDED),
        ]
        plans = [one for one in said if isinstance(one, Itinerary) and one.sender == 11]
        told = [plan.version for plan in plans if plan.grade is Grade.TENTATIVE]
        assert told[:2] == [first.itinerary_version, second.itinerary_version]
        firm = [plan for plan in plans if plan.grade is Grade.FIRM and len(plan.legs) > 2]
        works = {leg.to_index for leg in firm[0].legs if leg.action is LegAction.WORK}
        assert works == {6}, "nothing firm comes of what it was outbid for"
        assert [second.cost] == alone and second.cost < engaged[0] - 40_000

    shown(check, outbid, CallForProposals, Bid, Award, Itinerary)


def test_p48_what_is_pre_assigned_with_a_bid_comes_before_the_next_one() -> None:
    """Two calls stand at one moment: the only robot's offer for the second begins with what it offers for the first."""

    def check(said: Sequence[Message]) -> None:
        kinds = [type(one) for one in said]
        bids = [one for one in said if isinstance(one, Bid)]
        assert len(bids) == 2 and Award in kinds
        first, second = bids
        assert (first.initiator, second.initiator) == (1, 2) and kinds.index(Award) > said.index(second)
        offers = [one for one in said if isinstance(one, Itinerary) and one.grade is Grade.TENTATIVE]
        works = [[leg.to_index for leg in one.legs if leg.action is LegAction.WORK] for one in offers]
        assert [one[0] for one in works] == [4, 6], "each offer takes the car of its own bay"
        assert second.cost > first.cost + 25_000, "the second behind the first"

    shown(check, two_bays(0, 0.1), Bid, Award, Itinerary)


# --- what others make of it ------------------------------------------------------------------------------------------


def test_p47_two_pre_engage_the_same_segments_and_of_what_they_engage_nothing_meets() -> None:
    """Nobody plans around a standing bid, which may come to nothing: the awards, and who was first, decide."""
    text = """
    site = {name = "pre", bitrate = 500_000}
    floors = {count = 3, positions = 10, without = ["p(1,*)"]}
    compartments = [{name = "IOC1", node = 1, at = "p(1,4)"}, {name = "IOC2", node = 2, at = "p(1,7)"}]
    lifts = [{name = "ER1", node = 5, end = "left"}]
    spurs = [{at = "p(1,9)", side = "far"}]
    robots = [{name = "MR1", node = 11, home = "p(2,3)"}, {name = "MR2", node = 12, home = "p(3,3)"}]
    """
    site = telling(parse_site(text, "pre.toml"))

    def said_where(*comes: float) -> list[Message]:
        scene = play(site, stays(*((at_s, None) for at_s in comes)), limit_s=30, extra_s=0)
        return [one.message for one in scene.said if one.bus == "fleet"]

    def check(said: Sequence[Message]) -> None:
        bids = [one for one in said if isinstance(one, Bid)]
        assert [(one.sender, one.initiator) for one in bids] == [(11, 1), (12, 2)]
        awards = [one for one in said if isinstance(one, Award) and one.result is CallResult.AWARDED]
        assert {one.winner for one in awards} == {11, 12}

        def windows(grade: Grade) -> dict[int, list[SlotWindow]]:
            """Of the last plan of each robot."""
            plans = {one.sender: one for one in said if isinstance(one, Itinerary) and one.grade is grade}
            return {node: itinerary_windows(site, plan, 12_000_000) for node, plan in plans.items()}

        held = {}
        for grade in (Grade.TENTATIVE, Grade.FIRM):
            found = windows(grade)
            assert found.keys() >= {11, 12}
            reservations = Reservations()
            reservations.reserve(11, found[11], [])
            held[grade] = {window.segment.track for window, _ in reservations.conflicts(12, found[12])}
        assert held[Grade.TENTATIVE] >= {1, 128} and not held[Grade.FIRM]

    shown(check, said_where(0, 0), Bid, Award, Itinerary)
