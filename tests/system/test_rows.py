"""Rows of the systems list that need a whole site, or two machines, to be seen."""

import dataclasses
import itertools
from dataclasses import dataclass, field
from functools import cache

import pytest

from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import (
    CallResult,
    Criterion,
    DeskText,
    DriveMode,
    KindCode,
    LegAction,
    MachineState,
    Operation,
    Reason,
    ShuttleAction,
    Side,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    CarAt,
    DeskOrder,
    DriveState,
    Itinerary,
    Message,
    OperatorOrder,
    Reference,
    ShuttleOrder,
    Stamp,
    TaskReport,
)
from onboard.core.authority import TokenKey, segment_token
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Report, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, Proposal
from onboard.core.serial import to_bus_ms
from onboard.core.site import Machine, Segment, Site, Station
from onboard.holon.holon import Holon
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.compartment_factory import CompartmentFactory
from onboard.systems.car_park.generation import AWARD_LATENCY_US, CarParkGeneration
from onboard.systems.car_park.program import MAX_STEPS, CarHandling, CarStep, Program, StationWork
from onboard.ways.mirror import WayMirror
from onboard.wire.codec import fleet_codec
from tests.sites import at_the_key, one_floor
from tests.system.scene import car, play, stays

SITE = one_floor(robots=2)
BAY = SITE.compartments[1]


def a_call(
    deadline_us: int = 2_000_000, *, to_station: int = ANY_STATION, wheelbase_mm: int = 2700
) -> CallForProposals:
    task = Reference(1, 1)
    return CallForProposals(
        1, 1, task, Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, to_bus_ms(deadline_us), BAY.number,
        to_station, task, wheelbase_mm,
    )  # fmt: skip


def a_robot(standing: Segment, steps: list[CarStep] | None = None) -> CarParkGeneration:
    program = Program(SITE, standing)
    if steps:
        program.replace(steps, Stamp(0, 1, 1))
    return CarParkGeneration(SITE, SITE.machines[11], WayMirror(SITE, 11), program)


def test_p18_a_busy_robot_bids_later_on_the_bus_than_its_idle_twin() -> None:
    """The same site twice: with a car in hand for the first bay, and with nothing to do, when the call comes."""
    site = one_floor(extra='[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,6)"\n')
    took_ms = {}
    for cars in (1, 2):
        scene = play(site, stays(*[(float(number), None) for number in range(cars)]), extra_s=200)
        scene.assert_sound()
        call = scene.all(CallForProposals)[-1][1]
        if cars == 1:
            _, plan = scene.first(Itinerary, lambda m: m.sender == 11 and len(m.legs) > 2)
            assert plan.legs[0].action is LegAction.STAND
            until_ms = plan.legs[0].end_ms - call.deadline_ms
            assert until_ms == AWARD_LATENCY_US // 1_000, "nobody is under way before the award can be there"
        (bid,) = (m for _, m in scene.all(Bid) if (m.initiator, m.call) == (call.sender, call.call))
        took_ms[cars] = bid.cost - call.deadline_ms
        done = [report for _, report in scene.all(TaskReport) if report.phase is TaskPhase.DONE]
        assert [report.sender for report in done] == [11] * cars
    assert took_ms[2] > took_ms[1] + 25_000


def test_p36_the_car_is_taken_at_the_moment_that_the_call_names_by_who_waits_there() -> None:
    """At the key a call says when the customer will be out: the car is taken a handling later, to the millisecond."""
    site = one_floor()
    scene = play(site, stays((0.0, None)), limit_s=30, extra_s=0)
    _, call = scene.first(CallForProposals)
    _, plan = scene.first(Itinerary, lambda m: m.sender == 11 and len(m.legs) > 2)
    comes, takes = next(pair for pair in itertools.pairwise(plan.legs) if pair[1].action is LegAction.WORK)
    out_ms = call.deadline_ms + call.ready_ms
    assert comes.end_ms < out_ms, "it is there before"
    handling_us = a_robot(Segment(1, 8)).handling_us(site.compartments[1])
    assert takes.end_ms == out_ms + handling_us // 1_000


def test_p41_who_could_not_tell_the_plan_behind_a_date_names_none() -> None:
    """An itinerary has so many legs at most: whose program has no room for four more says nothing."""
    says = {}
    for steps in (MAX_STEPS - 4, MAX_STEPS - 3):
        stands = [CarStep(LegAction.STAND, 1, 8, 8, at * 1_000_000, (at + 1) * 1_000_000) for at in range(2, 2 + steps)]
        says[steps] = a_robot(Segment(1, 8), stands).lower_bound(a_call(), 1_000_000) is not None
    assert says == {MAX_STEPS - 4: True, MAX_STEPS - 3: False}


def test_p18_a_busy_robot_names_a_later_finishing_date_than_its_idle_twin() -> None:
    call = a_call()
    work = StationWork(CarHandling.LEAVE, Station(1, 8, BAY.side), Reference(1, 9), 2700, call)
    busy = a_robot(Segment(1, 8), [CarStep(LegAction.WORK, 1, 8, 8, 0, 30_000_000, work)])
    idle = a_robot(Segment(1, 8))
    slow, quick = busy.estimate(call, 1_000_000), idle.estimate(call, 1_000_000)
    assert slow is not None and quick is not None
    assert slow.cost >= quick.cost + 25_000


def test_p28_a_foreseen_task_of_another_delays_my_bid() -> None:
    call = a_call(to_station=Station(1, 10, BAY.side).number)
    alone, crowded = a_robot(Segment(1, 2)), a_robot(Segment(1, 2))
    step = CarStep(LegAction.STAND, 1, 7, 7, 0, 60_000_000)
    away = CarStep(LegAction.TRAVEL, 1, 7, 12, 60_000_000, 75_000_000)
    other = Program(SITE, Segment(1, 7))
    other.replace([step, away], Stamp(0, 1, 2))
    crowded.mirror.on_itinerary(other.itinerary(12, 0), 0)
    free, hindered = alone.estimate(call, 1_000_000), crowded.estimate(call, 1_000_000)
    assert free is not None and hindered is not None
    assert hindered.cost > free.cost
    blocking = Program(SITE, Segment(1, 7))
    blocking.replace([], Stamp(0, 1, 3))
    crowded.mirror.on_itinerary(dataclasses.replace(blocking.itinerary(12, 0), version=2), 0)
    asked = crowded.estimate(call, 1_000_000)
    assert asked is not None and asked.cost > free.cost, "whoever only stands there can go further in, in its time"
    end = a_call(to_station=Station(1, 12, BAY.side).number)
    assert crowded.estimate(end, 1_000_000) is None, "row P45: who cannot do it has nothing to say"


def test_p23_p46_the_program_is_data_and_every_solution_was_looked_at() -> None:
    proposal = a_robot(Segment(1, 2)).estimate(a_call(), 1_000_000)
    assert isinstance(proposal, Proposal)
    (solution,) = proposal.program
    assert [str(step).split("] ")[1] for step in solution.steps][:2] == ["travel p(1,2) to p(1,4)", "stand at p(1,4)"]
    ends = [step.end_us for step in solution.steps]
    assert ends == sorted(ends) and [step.begin_us for step in solution.steps[1:]] == ends[:-1]
    best = min(alternative.finish_us for alternative in proposal.alternatives if alternative.finish_us is not None)
    assert to_bus_ms(best) == proposal.cost
    assert solution.place in {alternative.station for alternative in proposal.alternatives}


def test_p46_of_all_solutions_the_earliest_is_bid_though_another_place_is_nearer() -> None:
    """p(1,5) is next to the compartment, but somebody stands before it for a minute; p(1,1) is farther and free."""
    robot = a_robot(Segment(1, 2))
    for number, place in enumerate(SITE.places):
        if place.index in (1, 2, 3, 4) and place != Station(1, 1, Side.NEAR):
            robot.mirror.on_car(CarAt(1, Reference(1, 10 + number), place.number, 1, 2700))
    other = Program(SITE, Segment(1, 5))
    steps = [
        CarStep(LegAction.STAND, 1, 5, 5, 0, 60_000_000),
        CarStep(LegAction.TRAVEL, 1, 5, 12, 60_000_000, 75_000_000),
    ]
    other.replace(steps, Stamp(0, 1, 2))
    robot.mirror.on_itinerary(other.itinerary(12, 0), 0)
    proposal = robot.estimate(a_call(), 1_000_000)
    assert isinstance(proposal, Proposal)
    (solution,) = proposal.program
    dates = {one.station: one.finish_us for one in proposal.alternatives if one.finish_us is not None}
    near, far = Station(1, 5, Side.NEAR), Station(1, 1, Side.NEAR)
    assert dates[near] > dates[far] + 5_000_000, "the nearer one was weighed, and is later"
    assert [one.station for one in proposal.alternatives].index(near) == 0
    assert proposal.cost == to_bus_ms(dates[far])
    assert solution.place == far


def test_p33_small_and_large_cars_are_parked_and_what_cannot_be_gripped_is_turned_away() -> None:
    wheelbases = (1_850, 3_350, 3_500)
    demand = [Stay(round(200e6 * n), None, car(n, wheelbase_mm=mm)) for n, mm in enumerate(wheelbases)]
    scene = play(one_floor(), Demand(tuple(demand)), limit_s=600)
    scene.assert_sound()
    grips = {order.wheelbase_mm for _, order in scene.all(ShuttleOrder) if order.action is ShuttleAction.GRIP}
    assert grips == {1_850, 3_350}
    scene.first(DeskOrder, lambda order: order.text is DeskText.CAR_TOO_LARGE, after_us=400_000_000)
    assert {award.winner for _, award in scene.all(Award) if award.result is CallResult.AWARDED} == {11}
    summary = scene.simulation.plant.street.summary()
    assert (summary.parked, summary.inside, summary.refused_too_large) == (2, 2, 1)


@pytest.mark.parametrize("wheelbase_mm", [1600, 3900])
def test_p33_a_car_that_the_shuttle_cannot_grip_gets_no_bid(wheelbase_mm: int) -> None:
    assert a_robot(Segment(1, 2)).lower_bound(a_call(wheelbase_mm=wheelbase_mm), 0) is None


def test_p12_nobody_can_so_the_call_is_opened_again_then_refused_and_the_customer_told() -> None:
    """The only robot stands still with a fault: five attempts, then the car is given back."""

    def stop_the_robot(simulation: Simulation) -> None:
        simulation.controllers[11].holon.behaviour.state  # noqa: B018  # it exists before it is broken
        simulation.plant.shuttles[11].fault = ""
        holon = simulation.controllers[11].holon
        fail = getattr(holon.behaviour, "_fail")  # noqa: B009  # a failed actuator, as its sensor would tell it
        simulation.loop.call_at(9.0, fail, Reason.ACTUATOR_FAULT, 9_000_000)

    scene = play(at_the_key(one_floor()), stays((0, None)), before=stop_the_robot)
    calls = [call for _, call in scene.all(CallForProposals)]
    assert [call.attempt for call in calls] == [1, 2, 3, 4, 5]
    assert len({call.call for call in calls}) == 5 and len({call.task for call in calls}) == 1
    awards = [award for _, award in scene.all(Award)]
    assert [award.result for award in awards] == [CallResult.REOPENED] * 4 + [CallResult.REFUSED]
    assert {award.reason for award in awards} == {Reason.NO_BID}
    assert not scene.all(Bid)
    scene.first(DeskOrder, lambda order: order.text is DeskText.OUT_OF_ORDER)
    summary = scene.simulation.plant.street.summary()
    assert (summary.refused_full, summary.queueing) == (1, 0)


def test_p52_an_operators_order_takes_the_same_path_as_a_customers_press() -> None:
    def gateway(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("operator", 251)
        simulation.loop.call_at(200.0, send, bus, simulation)

    def send(bus: object, simulation: Simulation) -> None:
        (parked,) = simulation.view.history.loads.stations
        order = OperatorOrder(251, 1, OperatorAction.INSERT_TICKET, parked)
        for frame in fleet_codec().encode(order):
            bus.send(frame)  # type: ignore[attr-defined]  # a SimulatedBus

    from onboard.contract.codes import OperatorAction

    scene = play(one_floor(), stays((0, None)), before=gateway, extra_s=400)
    called = [call.operation for _, call in scene.all(CallForProposals)]
    assert called == [Operation.PARK, Operation.RETRIEVE]
    scene.first(DeskOrder, lambda order: order.text is DeskText.CAR_READY)


def test_a_full_park_is_told_at_the_desk_and_a_large_car_turned_away() -> None:
    site = one_floor(positions=5, extra="")
    demand = stays(*[(100.0 * number, None) for number in range(10)])
    large = Stay(round(1_200e6), None, car(99, length_mm=6000))
    scene = play(site, Demand((*demand.stays, large)), limit_s=2_000)
    scene.assert_sound()
    summary = scene.simulation.plant.street.summary()
    assert len(site.places) == 9
    assert (summary.parked, summary.refused_full, summary.refused_too_large) == (9, 1, 1)


def test_p20_p49_a_compartment_is_a_participant_too_asked_twice() -> None:
    """A gateway asks which bay could give a car out soonest; the bay bids, is awarded, and has the car fetched."""

    def gateway(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("gateway", 251)

        def say(message: Message) -> None:
            for frame in fleet_codec().encode(message):
                bus.send(frame)

        def call() -> None:
            (parked,) = simulation.view.history.loads.stations
            deadline_ms = simulation.loop.now_us() // 1000 + 1_000
            task = Reference(251, 1)
            say(
                CallForProposals(
                    251, 1, task, Operation.RECEIVE, KindCode.COMPARTMENT, Criterion.FINISH_TIME, 1, 0, deadline_ms,
                    ANY_STATION, ANY_STATION, parked, 2700,
                )
            )  # fmt: skip
            simulation.loop.call_later(1.01, say, Award(251, 1, 1, task, 1, CallResult.AWARDED, Reason.NONE))

        simulation.loop.call_at(200.0, call)

    scene = play(one_floor(), stays((0, None)), before=gateway, extra_s=400)
    scene.assert_sound()
    bid_us, bid = scene.first(Bid, lambda m: m.initiator == 251)
    assert (bid.sender, bid.cost) == (1, 204_000), "deadline and one door"
    accepted_us, _ = scene.first(TaskReport, lambda m: m.task == Reference(251, 1))
    fetch_us, fetch = scene.first(CallForProposals, lambda m: m.operation is Operation.RETRIEVE)
    assert bid_us < accepted_us < fetch_us
    assert scene.first(DeskOrder, lambda order: order.text is DeskText.CAR_READY)[1].car == fetch.car
    assert any("lock the input door; call for a robot" in text for _, _, text in scene.simulation.log.lines)


@cache
def first_moves_us() -> int:
    """When the robot of the one-floor site begins to drive for the first car."""
    scene = play(one_floor(), stays((0, None)), limit_s=30, extra_s=0)
    return scene.first(DriveState, lambda m: m.mode is DriveMode.MOVING)[0]


@pytest.mark.parametrize("under_way_s", [0.3, 1.5, 3.0, 5.0, 8.0])
def test_a_drive_without_fresh_orders_stops_inside_its_machines_authority(under_way_s: float) -> None:
    """The controller dies while the robot moves: the drive brakes by itself, on segments whose tokens it holds."""
    site = one_floor()
    killed_s = first_moves_us() / 1e6 + under_way_s

    def kill(simulation: Simulation) -> None:
        def pull_the_plug() -> None:
            node = next(n for n in simulation.devices[11]._nodes if n.name == "MR1")
            node.power_off()

        simulation.loop.call_at(killed_s, pull_the_plug)

    # Soon after it stands: a drive that hears nobody says everything again and again.
    scene = play(site, stays((0, None)), before=kill, extra_s=15)
    body = scene.simulation.plant.world.robots[11]
    position_mm, speed_mm_s = body.motion.at(scene.simulation.loop.now_us())
    assert speed_mm_s == 0
    home_mm = site.position_mm(site.machines[11].home)
    tokens = scene.simulation.controllers[11].holon.tokens
    half_mm, pitch_mm = site.carrier_length_mm / 2, site.tracks[1].pitch_mm
    reached = {round((position_mm + side * half_mm) / pitch_mm) + 1 for side in (-1, 1)}
    assert position_mm < home_mm, "it was on its way"
    assert all(tokens.holds(segment_token(Segment(1, index))) for index in reached)
    assert scene.simulation.plant.oracle.finish() == []


def test_a_restarted_compartment_never_names_two_cars_alike() -> None:
    site = one_floor()
    entries: list[dict[str, str | int]] = [{"record": "boot", "boot": 3}, {"record": "number", "number": 7}]
    behaviour = Holon(site, site.machines[1], CompartmentFactory(), entries=entries).behaviour
    assert isinstance(behaviour, Compartment)
    assert behaviour.memory.number == 7


# --- row P22: a machine kind that the project does not know, with no line of protocol code ---------------------------


@dataclass
class Crane:
    """A stationary crane whose task-generation function names a price; it does nothing else."""

    fleet: Fleet
    price: int
    kind: KindCode = KindCode.LIFT
    won: list[CallForProposals] = field(default_factory=list)
    state: MachineState = MachineState.IDLE
    itinerary_version: int = 0

    def start(self, now_us: int) -> list[Effect]:
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        if not isinstance(event, Awarded):
            return []
        self.won.append(event.call)
        return [Report(f"lifts for {self.price}")]

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        return []

    def next_wake(self) -> int | None:
        return None

    def statements(self, now_us: int) -> list[Effect]:
        return []


@dataclass
class CraneFactory(BehaviourFactory):
    price: int

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Estimator:
        return CranePrice(self.price)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Crane:
        return Crane(fleet, self.price)


@dataclass
class CranePrice:
    price: int

    def floor(self, call: CallForProposals, now_us: int) -> int:
        return 0

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        return self.price if call.criterion is Criterion.MONEY else None

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        return Proposal(self.price, None, (), ())


def test_p22_a_new_kind_of_machine_bids_and_wins_without_protocol_code() -> None:
    machines = {node: Machine(node, f"CR{node}", KindCode.LIFT, Segment(1, 1)) for node in (21, 22)}
    site = dataclasses.replace(SITE, machines={**SITE.machines, **machines})
    holons = {node: Holon(site, machines[node], CraneFactory(price)) for node, price in ((21, 900), (22, 400))}
    call = dataclasses.replace(a_call(1_500_000), kind=KindCode.LIFT, criterion=Criterion.MONEY)
    said: list[Message] = []

    def deliver(effects: list[Effect], now_us: int) -> None:
        for effect in effects:
            if isinstance(effect, Send):
                said.append(effect.message)
                for node, holon in holons.items():
                    if node != effect.message.sender:
                        deliver(holon.receive(effect.message, now_us), now_us)

    for holon in holons.values():
        deliver(holon.start(0), 0)
        deliver(holon.receive(BusTime(1, 1000), 1000), 1000)
    for holon in holons.values():
        deliver(holon.receive(call, 2_000), 2_000)
    now_us = 0
    while now_us < 1_480_000:
        now_us = min(wake for holon in holons.values() if (wake := holon.next_wake()) is not None)
        for holon in holons.values():
            deliver(holon.wake(now_us), now_us)
    assert [(m.sender, m.cost) for m in said if isinstance(m, Bid)] == [(22, 400)], "the dearer one stays silent"
    award = Award(1, call.call, 22, call.task, 1, CallResult.AWARDED, Reason.NONE)
    for holon in holons.values():
        deliver(holon.receive(award, 1_501_000), 1_501_000)
    won = {node: holon.behaviour.won for node, holon in holons.items() if isinstance(holon.behaviour, Crane)}
    assert won == {21: [], 22: [call]}
