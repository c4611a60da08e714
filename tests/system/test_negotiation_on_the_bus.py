"""Negotiation on a site, as it travels (rows P02 to P07, P09, P12, P14, P15, P17): calls, bids, winners."""

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import pytest

from bus_sim.can.faults import parse_fault
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.battery import BatteryLevel
from onboard.contract.codes import (
    CallResult,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    ManualMode,
    Operation,
    Reason,
    TaskPhase,
)
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Heartbeat,
    Itinerary,
    ManualOrder,
    Message,
    Reference,
    TaskReport,
)
from onboard.core.negotiation import Estimator, NeededAnswers, Proposal
from onboard.core.serial import from_bus_ms
from onboard.systems.car_park.site import CarPark, RideCalls, car_park
from onboard.wire.codec import fleet_codec
from tests.cut import Timed, shown_at
from tests.sites import at_arrival, at_the_key, one_floor
from tests.system.scene import Scene, play, stays
from tests.system.test_batteries import begin
from tests.system.test_batteries import site as with_batteries
from tests.system.test_p47_p48_reservations import RIVAL, admitted

Key = tuple[int, int]
SITE = """
site = {name = "rush", bitrate = 500_000}
floors = {count = 5, positions = 10, without = ["p(1,*)"]}
compartments = [
    {name = "IOC1", node = 1, at = "p(1,3)"},
    {name = "IOC2", node = 2, at = "p(1,5)"},
    {name = "IOC3", node = 3, at = "p(1,7)"},
]
lifts = [{name = "ER1", node = 5, end = "left"}, {name = "ER2", node = 6, end = "right"}]
robots = [
    {name = "MR1", node = 11, home = "p(2,3)"},
    {name = "MR2", node = 12, home = "p(3,8)"},
    {name = "MR3", node = 13, home = "p(4,5)"},
    {name = "MR4", node = 14, home = "p(5,5)"},
]
"""


def rush() -> CarPark:
    """Three bays, two lifts, four robots, who ask the lifts before they bid."""
    return dataclasses.replace(car_park(parse_site(SITE, "rush.toml")), rides=RideCalls.BEFORE)


def played(site: CarPark, *faults: str) -> list[Timed]:
    """Three cars come within 0.2 s; what is said until the last is awarded."""
    slow = [parse_injection(fault) for fault in faults]
    cars = stays((0, None), (0.1, None), (0.2, None))
    scene = play(at_arrival(site), cars, plant=lambda run: arm(run, slow), limit_s=14.5, extra_s=0)
    return on_the_fleet_bus(scene)


def on_the_fleet_bus(scene: Scene) -> list[Timed]:
    """What travelled there."""
    return [(said.time_us, said.message) for said in scene.said if said.bus == "fleet"]


@pytest.fixture(scope="module")
def heard() -> list[Timed]:
    """With calls for rides: 14 stand at one moment."""
    return played(rush())


@pytest.fixture(scope="module")
def contested() -> list[Timed]:
    """The two nearest robots think slowly, so that others bid before them."""
    return played(car_park(parse_site(SITE, "rush.toml")), "slow:target=MR1|MR2,factor=60")


class Calls:
    """What was said of each call, by its initiator and number; of one that is opened again, of each opening."""

    def __init__(self, heard: Sequence[Timed]) -> None:
        self.calls: dict[Key, tuple[int, CallForProposals]] = {}
        self.bids: dict[Key, list[tuple[int, Bid]]] = {}
        self.awards: dict[Key, tuple[int, Award]] = {}
        for at_us, one in heard:
            if isinstance(one, CallForProposals):
                self.calls.setdefault((one.sender, one.call), (at_us, one))
            if isinstance(one, Bid):
                self.bids.setdefault((one.initiator, one.call), []).append((at_us, one))
            if isinstance(one, Award):
                self.awards.setdefault((one.sender, one.call), (at_us, one))
        assert self.calls and self.bids and self.awards

    def open_at(self, at_us: int) -> list[Key]:
        """Calls that stand at a time."""
        closed = {key: at for key, (at, _) in self.awards.items()}
        return [key for key, (at, _) in self.calls.items() if at < at_us < closed.get(key, at_us + 1)]

    def best(self, key: Key) -> int:
        """Who bid best; of equal ones the lower node-ID."""
        return min((bid.cost, bid.sender) for _, bid in self.bids[key])[1]


def kinds(nodes: set[int]) -> set[KindCode]:
    machines = rush().machines
    return {machines[node].kind for node in nodes}


def test_p02_machines_of_each_kind_call_and_answer(heard: list[Timed]) -> None:
    """Compartments and robots call, robots and lifts answer, and who called is assigned what others called for."""

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        callers, winners = (
            {node for node, _ in said.calls},
            {one.winner for _, one in said.awards.values() if one.winner},
        )
        assert kinds(callers) == {KindCode.COMPARTMENT, KindCode.ROBOT}
        assert kinds({bid.sender for bids in said.bids.values() for _, bid in bids}) == {KindCode.ROBOT, KindCode.LIFT}
        assert kinds(winners) == {KindCode.ROBOT, KindCode.LIFT}
        parks = [one for _, one in said.awards.values() if one.result is CallResult.AWARDED and one.sender in (1, 2, 3)]
        assert len(parks) >= 3 and {one.winner for one in parks} <= callers

    shown_at(check, heard, CallForProposals, Bid, Award)


def test_p03_a_robot_has_calls_of_its_own_open_while_it_bids_in_several_foreign_ones(heard: list[Timed]) -> None:
    """Beside calls of its own three foreign ones stand at one moment: one robot bids in two, and wins."""

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        found = set()
        for robot in (11, 12, 13, 14):
            mine = [key for key, bids in said.bids.items() if robot in [bid.sender for _, bid in bids]]
            for at_us, one in heard:
                if isinstance(one, CallForProposals) and one.sender == robot:
                    standing = said.open_at(at_us + 1)
                    foreign = [key for key in standing if key[0] in (1, 2, 3)]
                    bids_in = [key for key in foreign if key in mine]
                    found |= {robot} if len(foreign) == 3 and len(bids_in) > 1 else set()
        assert found
        reports = {(one.task, one.sender) for _, one in heard if isinstance(one, TaskReport)}
        won = [one for _, one in said.awards.values() if one.sender in (1, 2, 3) and one.winner in found]
        assert won and all((one.task, one.winner) in reports for one in won)

    shown_at(check, heard, CallForProposals, Bid, Award, TaskReport)


def check_winners(said: Calls) -> int:
    """Whoever wins a call bid best of all in that very call, before it; how many were won."""
    won = [(key, at_us, award) for key, (at_us, award) in said.awards.items() if award.winner]
    for key, at_us, award in won:
        assert key in said.bids and all(at < at_us for at, _ in said.bids[key])
        assert award.winner == said.best(key)
    return len(won)


def test_p04_of_many_calls_at_once_each_goes_to_the_best_bid_of_its_own(heard: list[Timed]) -> None:
    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        assert max(len(said.open_at(at)) for at, _ in said.calls.values()) >= 10
        assert check_winners(said) > 20

    shown_at(check, heard, CallForProposals, Bid, Award)


def test_p17_the_best_wins_though_it_is_ready_last(contested: list[Timed]) -> None:
    """Two calls are answered by one robot, and then by the one that does it sooner."""

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        assert check_winners(said) >= 3
        several = {key: [bid.sender for _, bid in bids] for key, bids in said.bids.items() if len(bids) > 1}
        assert several == {(1, 257): [13, 11], (2, 257): [14, 12]}

    shown_at(check, contested, Bid, Award)


def test_p05_p07_bids_improve_and_none_is_late(heard: list[Timed], contested: list[Timed]) -> None:
    """No bid is as bad as one that was heard before in its call, nobody bids twice, nobody after the deadline."""

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        for key, bids in said.bids.items():
            assert key in said.calls
            deadline_us = from_bus_ms(said.calls[key][1].deadline_ms, said.calls[key][0])
            assert all(said.calls[key][0] < at < deadline_us - 1_000 for at, _ in bids)
            ranks = [(bid.cost, bid.sender) for _, bid in bids]
            assert ranks == sorted(ranks, reverse=True) and len({sender for _, sender in ranks}) == len(ranks)

    for run in (heard, contested):
        shown_at(check, run, CallForProposals, Bid)


def test_p07_who_has_heard_a_better_bid_says_nothing(contested: list[Timed]) -> None:
    """MR3 and MR4 are idle and free for the third call as well: one of them bids, and the other, later, does not."""

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        assert [len(said.bids.get((desk, 257), ())) for desk in (1, 2, 3)] == [2, 2, 1]

    shown_at(check, contested, CallForProposals, Bid)


@pytest.mark.parametrize(
    ("before_ms", "better_ms", "counts"), [(100, 100, True), (4, 100, False), (100, 60_000, False)]
)
def test_p05_p07_a_bid_behind_the_cut_off_counts_for_nobody(before_ms: int, better_ms: int, counts: bool) -> None:
    """A machine from outside bids better: in time it wins, later the robot does, who has heard it as well.

    In time as well, where the bid is better than any machine's could be.
    """

    def before(simulation: Simulation) -> None:
        bus = admitted(simulation).fleet.attach("rival", RIVAL)

        deadline_us: dict[Key, int] = {}

        def hear(message: Message, time_us: int) -> None:
            if isinstance(message, CallForProposals):
                deadline_us[message.sender, message.call] = from_bus_ms(message.deadline_ms, time_us)
            if isinstance(message, Bid) and message.sender == 11 and message.call == 257:
                late_us = deadline_us[message.initiator, message.call] - 1_000 * before_ms
                for frame in fleet_codec().encode(
                    Bid(RIVAL, message.initiator, message.call, message.cost - better_ms, 0)
                ):
                    simulation.loop.call_at(late_us / 1e6, bus.send, frame)

        simulation.observers.append(hear)

    scene = play(at_arrival(one_floor()), stays((0, None)), before=before, limit_s=15, extra_s=0)

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        (at_us, bid) = said.bids[1, 257][-1]
        (award_us, award) = said.awards[1, 257]
        assert bid.sender == RIVAL and at_us < award_us
        assert said.best((1, 257)) == RIVAL
        assert award.winner == (RIVAL if counts else 11)
        taken = {one.sender for _, one in heard if isinstance(one, TaskReport) and one.phase is TaskPhase.AWARDED}
        assert taken == (set() if counts else {11})

    shown_at(check, on_the_fleet_bus(scene), Bid, Award)


def test_p12_a_call_that_nobody_answers_is_opened_again_for_longer_and_then_given_up() -> None:
    """The only robot is in a person's hand: five attempts, each as long as the last or longer, then it is refused."""

    def before(simulation: Simulation) -> None:
        person = simulation.fleet.attach("person", 254)

        def say(order: ManualOrder) -> None:
            for frame in fleet_codec().encode(order):
                assert person.send(frame)

        simulation.loop.call_at(5.0, partial(say, ManualOrder(254, 11, 1, ManualMode.HELD)))

    scene = play(at_the_key(one_floor()), stays((0, None)), before=before, limit_s=60, extra_s=5)

    def check(heard: Sequence[Timed]) -> None:
        calls = [(at, one) for at, one in heard if isinstance(one, CallForProposals)]
        assert {one.operation for _, one in calls[:5]} == {Operation.PARK} and len(
            {one.task for _, one in calls[:5]}
        ) == 1
        assert [one.attempt for _, one in calls[:5]] == [1, 2, 3, 4, 5]
        windows = [one.deadline_ms - at // 1000 for at, one in calls[:5]]
        assert windows == sorted(windows) and windows[-1] > 2 * windows[0]
        results = [one.result for at, one in heard if isinstance(one, Award) and at > calls[4][0]]
        assert results[:1] == [CallResult.REFUSED]
        assert {one.reason for _, one in heard if isinstance(one, Award)} == {Reason.NO_BID}
        assert not [one for _, one in heard if isinstance(one, Bid)]

    shown_at(check, on_the_fleet_bus(scene), CallForProposals, Award)


# --- who is not asked, and who says nothing --------------------------------------------------------------------------


@dataclass
class Eager:
    """The lift's own task-generation function, which would do anything else as well, and best of all."""

    own: Estimator
    robot: Estimator
    asked: set[KindCode]

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """As every machine computes it."""
        return (self.own if call.operation is Operation.RIDE else self.robot).floor(call, now_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """For any work but rides, as little as anybody could name."""
        self.asked.add(call.kind)
        is_ride = call.operation is Operation.RIDE
        return self.own.lower_bound(call, now_us) if is_ride else self.floor(call, now_us) + 1

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        """The same."""
        self.asked.add(call.kind)
        is_ride = call.operation is Operation.RIDE
        return self.own.estimate(call, now_us) if is_ride else Proposal(self.floor(call, now_us) + 1, None, (), ())


def test_p06_who_is_of_another_kind_than_called_for_is_not_asked_and_does_not_answer() -> None:
    """A lift whose task-generation function would beat every robot: it is asked for rides, and bids for rides."""
    asked: set[KindCode] = set()

    def before(simulation: Simulation) -> None:
        lift, robot = (simulation.controllers[node].holon.negotiation for node in (5, 11))
        lift.estimator = Eager(lift.estimator, robot.estimator, asked)

    scene = play(at_arrival(rush()), stays((0, None)), before=before, limit_s=14, extra_s=0)
    assert asked == {KindCode.LIFT}

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        assert {call.kind for _, call in said.calls.values()} == {KindCode.ROBOT, KindCode.LIFT}
        bidders: dict[KindCode, set[int]] = {}
        for key, bids in said.bids.items():
            assert key in said.calls
            bidders.setdefault(said.calls[key][1].kind, set()).update(bid.sender for _, bid in bids)
        assert 5 in bidders[KindCode.LIFT], "it does bid"
        for kind, nodes in bidders.items():
            assert kinds(nodes) == {kind}
        won = {award.winner for key, (_, award) in said.awards.items() if said.calls[key][1].kind is KindCode.ROBOT}
        assert won and kinds(won - {0}) == {KindCode.ROBOT}

    shown_at(check, on_the_fleet_bus(scene), CallForProposals, Bid, Award)


def test_p09_who_cannot_do_it_is_heard_to_live_and_says_nothing_of_the_call() -> None:
    """By its search, shut in behind one that is dead: a third robot does it."""
    site = at_arrival(one_floor(robots=3))

    def before(simulation: Simulation) -> None:
        simulation.loop.call_at(7.0, simulation.crash, site.machines[12])
        simulation.devices[12].attach("listener")

    scene = play(site, stays((0, None)), before=before, limit_s=16, extra_s=0)
    counters = scene.simulation.controllers[11].holon.negotiation.counters
    assert (counters.calls_heard, counters.searches, counters.calls_impossible) == (1, 1, 1)

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        ((called_us, _),) = said.calls.values()
        ((awarded_us, award),) = said.awards.values()
        assert award.winner == 13 and {bid.sender for bids in said.bids.values() for _, bid in bids} == {13}
        mine = [(at, type(one)) for at, one in heard if one.sender == 11 and at > called_us]
        assert {kind for at, kind in mine if at < awarded_us} <= {Heartbeat} and Heartbeat in dict(mine).values()

    shown_at(check, on_the_fleet_bus(scene), CallForProposals, Bid, Award, Heartbeat)


def test_p09_who_cannot_do_it_by_its_bound_says_nothing_of_the_call_either() -> None:
    """Its battery is nearly empty, as it tells: it drives to charge, and lets the other robot do it."""
    scene = play(with_batteries(), stays((0, None)), plant=begin(0.05), limit_s=16, extra_s=0)
    counters = scene.simulation.controllers[11].holon.negotiation.counters
    assert (counters.calls_heard, counters.searches, counters.calls_impossible) == (1, 0, 1)

    def check(heard: Sequence[Timed]) -> None:
        said = Calls(heard)
        ((called_us, _),) = said.calls.values()
        told = {one.sender: one.bids for at, one in heard if isinstance(one, BatteryLevel) and at < called_us}
        assert (told.get(11), told.get(12)) == (False, True)
        assert {bid.sender for bids in said.bids.values() for _, bid in bids} == {12}
        assert {award.winner for _, award in said.awards.values()} == {12}

    shown_at(check, on_the_fleet_bus(scene), CallForProposals, Bid, Award, BatteryLevel)


# --- what is lost, and how far anybody looks -------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_p14_whatever_is_lost_at_single_receivers_one_does_it_and_nobody_waits_for_ever(seed: int) -> None:
    """For 12 s, from when the car comes, each receiver misses every other frame; then the bus is well."""
    loss = f"omission:probability=0.5,from_us=10000000,until_us=22000000,seed={seed}"
    scene = play(
        at_arrival(one_floor(robots=2)), stays((0, None)), faults=[parse_fault(loss)], limit_s=200, extra_s=100
    )

    def check(heard: Sequence[Timed]) -> None:
        called = {(one.sender, one.call): one.task for _, one in heard if isinstance(one, CallForProposals)}
        closed = {(one.sender, one.call): one for _, one in heard if isinstance(one, Award)}
        assert called and called.keys() <= closed.keys(), "every call comes to its end"
        owner: dict[Reference, int] = {}
        done = set()
        for _, one in heard:
            match one:
                case TaskReport(phase=TaskPhase.AWARDED | TaskPhase.STARTED | TaskPhase.LOADED | TaskPhase.DONE):
                    assert owner.setdefault(one.task, one.sender) == one.sender, "one machine at most has it"
                    done |= {one.task} if one.phase is TaskPhase.DONE else set()
                case TaskReport(phase=TaskPhase.FORFEITED):
                    owner.pop(one.task, None)
                case _:
                    pass
        refused = {one.task for one in closed.values() if one.result is CallResult.REFUSED}
        opened = Counter(called.values())
        assert all(one.result is not CallResult.REOPENED or opened[one.task] > 1 for one in closed.values())
        assert all(opened[task] == 5 for task in refused)
        assert done and done == set(called.values()) - refused, (
            "what nobody could be heard to bid for, in five attempts"
        )
        assert {closed[max(called)].winner} == set(owner.values())
        last = {one.sender: one.state for _, one in heard if isinstance(one, Heartbeat)}
        assert last == dict.fromkeys((1, 11, 12), MachineState.IDLE)

    shown_at(
        check,
        on_the_fleet_bus(scene),
        *(CallForProposals, Award, TaskReport, Heartbeat),
    )


#: How far a plan's last work may be ahead for each task that its robot has in hand, ms.
HORIZON_MS = 180_000


def test_p15_no_plan_holds_more_than_what_was_called_for_and_is_in_hand() -> None:
    """Six cars before four robots: work only for tasks that were called for, won and are not done, and not far off."""
    cars = stays(*((at_s, None) for at_s in (0, 0.1, 0.2, 20, 21, 22)))
    scene = play(at_arrival(car_park(parse_site(SITE, "rush.toml"))), cars, limit_s=70, extra_s=0)

    def check(heard: Sequence[Timed]) -> None:
        called: set[Reference] = set()
        in_hand: dict[int, set[Reference]] = {}
        reported: set[Reference] = set()
        most = 0
        for at_us, one in heard:
            match one:
                case CallForProposals():
                    called.add(one.task)
                case Award(result=CallResult.AWARDED):
                    assert one.task in called
                    in_hand.setdefault(one.winner, set()).add(one.task)
                case TaskReport():
                    assert one.task in in_hand.get(one.sender, set()), "of no other task anything is said"
                    in_hand[one.sender] -= {one.task} if one.phase is TaskPhase.DONE else set()
                    reported.add(one.task)
                case Itinerary(grade=Grade.FIRM):
                    works = [leg.end_ms + one.stamp.award_ms for leg in one.legs if leg.action is LegAction.WORK]
                    tasks = len(in_hand.get(one.sender, set()))
                    assert len(works) <= 2 * tasks, "a car is taken and left, and no more"
                    assert all(end_ms - at_us // 1000 < HORIZON_MS * tasks for end_ms in works)
                    most = max(most, len(works))
                case _:
                    pass
        assert most == 3 and reported == called

    shown_at(
        check,
        on_the_fleet_bus(scene),
        *(CallForProposals, Award, TaskReport, Itinerary),
    )
