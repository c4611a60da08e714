"""Figure 7 of Pujo, Ounnar, Zanni 2006 on the bus: what a robot bids around a plan that another has told (P28, P43).

Five floors of sixteen positions and a lift at each end. MRalpha goes up by the left lift, works at p(5,12) and at
p(5,8) and leaves by the right one; its words are the test's. MRlambda, with all its layers and its plant, takes a car
at p(1,4) that has no other place to go to than p(5,12). Durations are not in the paper; with real accelerations a
carrier waits one place farther off than the paper's and passes it at speed.
"""

from functools import cache

import pytest

from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import CONTRACT_VERSION, Grade, KindCode, LegAction, MachineState, Side
from onboard.contract.messages import Bid, CallForProposals, Heartbeat, Itinerary, Leg, Message, Stamp
from onboard.core.serial import from_bus_ms
from onboard.systems.car_park.site import CarPark
from onboard.ways.occupancy import itinerary_windows
from onboard.ways.reservations import Reservations
from onboard.wire.codec import fleet_codec
from tests.sites import at_the_key, telling
from tests.system.scene import Scene, play, stays

LAMBDA, ALPHA = 11, 12
LEFT, RIGHT = 128, 129
PLACES, PITCH_MM = 16, 2_400
#: MRalpha's way in the figure: each leg with its end, s after the deadline of the call.
FIGURE = (
    (LegAction.STAND, 2, 6, 6, 5),
    (LegAction.TRAVEL, 2, 6, 0, 18),
    (LegAction.RIDE, LEFT, 2, 5, 28),
    (LegAction.TRAVEL, 5, 0, 12, 51),
    (LegAction.WORK, 5, 12, 12, 75),
    (LegAction.TRAVEL, 5, 12, 8, 85),
    (LegAction.WORK, 5, 8, 8, 100),
    (LegAction.TRAVEL, 5, 8, PLACES + 1, 118),
    (LegAction.RIDE, RIGHT, 5, 3, 125),
    (LegAction.TRAVEL, 3, PLACES + 1, 9, 141),
)
#: Another, for the rows' rule alone: over the place where MRlambda stands and back over it.
OVER_ITS_PLACE = (
    (LegAction.STAND, 2, 6, 6, 5),
    (LegAction.TRAVEL, 2, 6, 0, 18),
    (LegAction.RIDE, LEFT, 2, 1, 24),
    (LegAction.TRAVEL, 1, 0, 10, 44),
    (LegAction.WORK, 1, 10, 10, 60),
    (LegAction.TRAVEL, 1, 10, 0, 80),
    (LegAction.RIDE, LEFT, 1, 3, 88),
    (LegAction.TRAVEL, 3, 0, 9, 106),
)
Way = tuple[tuple[LegAction, int, int, int, int], ...]


def park(clearance: int) -> CarPark:
    """The clearance is between two bodies, in places: each keeps half of what lies between their own places."""
    gone = ", ".join(
        f'"p({floor},{index})"' for floor in range(1, 6) for index in range(1, PLACES + 1) if (floor, index) != (5, 12)
    )
    text = f"""
    site = {{name = "figure", bitrate = 500_000}}
    floors = {{count = 5, positions = {PLACES}, pitch_mm = {PITCH_MM}, sides = ["near"], without = [{gone}]}}
    carrier = {{length_mm = {PITCH_MM}, clearance_mm = {(clearance - 1) * PITCH_MM // 2}}}
    compartments = [{{name = "IOC1", node = 1, at = "p(1,4)"}}]
    lifts = [{{name = "ER1", node = 5, end = "left"}}, {{name = "ER2", node = 6, end = "right"}}]
    robots = [
        {{name = "MRlambda", node = {LAMBDA}, home = "p(1,6)"}},
        {{name = "MRalpha", node = {ALPHA}, home = "p(2,6)"}},
    ]
    """
    return telling(at_the_key(parse_site(text, "figure.toml", crowded=True)))


def alpha_plan(deadline_ms: int, way: Way = FIGURE) -> Itinerary:
    """MRalpha's firm itinerary, told when the call is."""
    legs = tuple(
        Leg(action, track, from_index, to_index, Side.FAR, deadline_ms + 1_000 * end_s)
        for action, track, from_index, to_index, end_s in way
    )
    return Itinerary(ALPHA, 2, Grade.FIRM, Stamp(deadline_ms - 1_000, 1, 99), legs)


@cache
def played(clearance: int, way: Way) -> Scene:
    """One car comes; MRalpha stands on the second floor and, if it has a ``way``, tells it from then on."""
    site = park(clearance)

    def words(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("alpha")
        # Somebody acknowledges what its devices say: a lone sensor would repeat its frame for ever.
        simulation.devices[ALPHA].attach("listener")

        def say(message: Message) -> None:
            for frame in fleet_codec().encode(message):
                assert bus.send(frame)

        def beat() -> None:
            say(Heartbeat(ALPHA, CONTRACT_VERSION, site.digest, 0, 1, KindCode.ROBOT, MachineState.WORKING))
            simulation.loop.call_later(1.0, beat)

        def hear(message: Message, time_us: int) -> None:
            if way and isinstance(message, CallForProposals) and message.sender == 1:
                say(alpha_plan(message.deadline_ms, way))

        simulation.observers.append(hear)
        simulation.loop.call_at(0.5, beat)
        stand = (Leg(LegAction.STAND, 2, 6, 6, Side.NEAR, 1_000),)
        simulation.loop.call_at(0.6, say, Itinerary(ALPHA, 1, Grade.FIRM, Stamp(0, ALPHA, 0), stand))

    return play(site, stays((0, None)), before=words, without=frozenset({"MRalpha"}), limit_s=60, extra_s=0)


def bid_of(scene: Scene) -> tuple[CallForProposals, Bid, Itinerary]:
    """MRlambda's first bid, the call that it is for, and the tentative itinerary that goes with it."""
    _, bid = scene.first(Bid, lambda m: m.sender == LAMBDA)
    _, call = scene.first(CallForProposals, lambda m: (m.sender, m.call) == (bid.initiator, bid.call))
    _, plan = scene.first(Itinerary, lambda m: m.sender == LAMBDA and m.grade is Grade.TENTATIVE)
    return call, bid, plan


@pytest.mark.parametrize(("clearance", "waits_at"), [(4, 3), (3, 4)])
def test_p43_the_bid_waits_a_clearance_before_mralpha_and_follows(clearance: int, waits_at: int) -> None:
    call, bid, plan = bid_of(played(clearance, FIGURE))
    way = [(leg.action.name, leg.track, leg.to_index) for leg in plan.legs]
    assert way[: way.index(("WORK", 1, 4)) + 1][-1:] == [("WORK", 1, 4)]
    assert way[way.index(("WORK", 1, 4)) + 1 :] == [
        ("TRAVEL", 1, 1),
        ("STAND", 1, 1),
        ("TRAVEL", 1, 0),
        ("RIDE", LEFT, 5),
        ("TRAVEL", 5, waits_at),
        ("STAND", 5, waits_at),
        ("TRAVEL", 5, 12),
        ("WORK", 5, 12),
    ]
    alpha = alpha_plan(call.deadline_ms)
    works_until_ms, leaves_ms = alpha.legs[6].end_ms, alpha.legs[7].end_ms
    waits, run, work = plan.legs[-3:]
    assert works_until_ms < waits.end_ms < leaves_ms - 10_000, "it follows a moving body"
    assert (bid.cost, bid.itinerary_version) == (work.end_ms, plan.version)
    assert run.end_ms < work.end_ms


@pytest.mark.parametrize("clearance", [3, 4])
def test_p28_a_plan_told_and_not_begun_delays_the_bid(clearance: int) -> None:
    """The same call: with MRalpha only standing on its floor the bid is on a free way, 38 s and more sooner."""
    bids = {tells: bid_of(played(clearance, FIGURE if tells else ())) for tells in (True, False)}
    took_ms = {tells: bid.cost - call.deadline_ms for tells, (call, bid, _) in bids.items()}
    assert took_ms[True] > took_ms[False] + 38_000
    free = bids[False][2]
    assert [leg.track for leg in free.legs if leg.action is LegAction.STAND] == [1], "but for the customer's leaving"


@pytest.mark.parametrize(("way", "shared"), [(FIGURE, {LEFT, 5}), (OVER_ITS_PLACE, {1})])
@pytest.mark.parametrize("clearance", [3, 4])
def test_p40_the_windows_of_both_plans_on_the_bus_never_meet(clearance: int, way: Way, shared: set[int]) -> None:
    site = park(clearance)
    call, _, plan = bid_of(played(clearance, way))
    now_us = from_bus_ms(call.deadline_ms, 0)
    alpha = itinerary_windows(site, alpha_plan(call.deadline_ms, way), now_us)
    reservations = Reservations()
    reservations.reserve(ALPHA, alpha, [])
    mine = itinerary_windows(site, plan, now_us)
    assert {window.segment.track for window in mine} & {window.segment.track for window in alpha} >= shared
    assert reservations.conflicts(LAMBDA, mine) == []
