"""Rows P38 and P46, from the bus: a robot waits where that is sooner than a way round, and chooses the soonest place.

Around one other robot whose words are the test's: it stands where it is until a time, and goes into a spur.
"""

from collections.abc import Sequence

from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import CONTRACT_VERSION, Grade, KindCode, LegAction, MachineState, Side
from onboard.contract.messages import Bid, CallForProposals, Heartbeat, Itinerary, Leg, Message, Progress, Stamp
from onboard.systems.car_park.site import CarPark
from onboard.wire.codec import fleet_codec
from tests.cut import first_of, shown
from tests.sites import at_the_key, telling
from tests.system.scene import play, stays

ROBOT, OTHER = 11, 12
LEFT, RIGHT, SPUR = 128, 129, 192
#: What the other robot does: action, track, from and to index, until so many s from power-up.
Told = tuple[LegAction, int, int, int, int]


def said(site: CarPark, *told: Told) -> list[Message]:
    """What is said about one car until the robot has bid; the other, of the site, is words alone."""
    plan = tuple(Leg(*leg[:4], Side.NEAR, 1_000 * leg[4]) for leg in told)
    _, track, index, _, _ = told[0]

    def words(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("other")
        # Somebody acknowledges what its devices say: a lone sensor would repeat its frame for ever.
        simulation.devices[OTHER].attach("listener")

        def say(message: Message) -> None:
            for frame in fleet_codec().encode(message):
                assert bus.send(frame)

        def beat() -> None:
            say(Heartbeat(OTHER, CONTRACT_VERSION, site.digest, 0, 1, KindCode.ROBOT, MachineState.WORKING))
            simulation.loop.call_later(1.0, beat)

        simulation.loop.call_at(0.5, beat)
        simulation.loop.call_at(0.6, say, Progress(OTHER, 1, 0, track, index, 0, 0))
        simulation.loop.call_at(0.7, say, Itinerary(OTHER, 1, Grade.FIRM, Stamp(0, 1, 99), plan))

    scene = play(site, stays((0, None)), before=words, without=frozenset({"MR2"}), limit_s=26.3, extra_s=0)
    return [one.message for one in scene.said if one.bus == "fleet"]


def offer(messages: Sequence[Message]) -> tuple[int, Itinerary]:
    """How long after the call's deadline the robot's bid is, ms, and its plan; that leaves the car at the bid."""
    timed = [(0, one) for one in messages]
    call, bid = first_of(timed, CallForProposals)[1], first_of(timed, Bid, lambda one: one.sender == ROBOT)[1]
    plan = first_of(timed, Itinerary, lambda one: one.sender == ROBOT and one.grade is Grade.TENTATIVE)[1]
    assert bid.cost == [leg.end_ms for leg in plan.legs if leg.action is LegAction.WORK][-1]
    return bid.cost - call.deadline_ms, plan


# --- to wait, or to go round -----------------------------------------------------------------------------------------


def two_floors() -> CarPark:
    """A lift at each end; the only place is p(2,7), and the other stands before it, as one comes by the left lift."""
    gone = ", ".join(['"p(1,*)"', *(f'"p(2,{index})"' for index in range(1, 13) if index != 7)])
    text = f"""
    site = {{name = "wait", bitrate = 500_000}}
    floors = {{count = 2, positions = 12, sides = ["far"], without = [{gone}]}}
    compartments = [{{name = "IOC1", node = 1, at = "p(1,4)"}}]
    lifts = [{{name = "ER1", node = 5, end = "left"}}, {{name = "ER2", node = 6, end = "right"}}]
    spurs = [{{at = "p(2,4)", side = "near"}}, {{at = "p(2,9)", side = "near"}}]
    robots = [
        {{name = "MR1", node = {ROBOT}, home = "p(1,6)"}},
        {{name = "MR2", node = {OTHER}, home = "p(2,6)"}},
    ]
    """
    return telling(at_the_key(parse_site(text, "wait.toml", crowded=True)))


def test_p38_a_robot_waits_where_that_is_sooner_than_the_way_round_and_else_goes_round() -> None:
    """The same call, and the other stands until 78 s, or 7 s longer."""

    def way(messages: Sequence[Message]) -> tuple[int, list[int], bool]:
        """When it would be done, the lifts that it rides, and whether it stands anywhere with the car."""
        date_ms, plan = offer(messages)
        taken, left = (number for number, leg in enumerate(plan.legs) if leg.action is LegAction.WORK)
        carried = plan.legs[taken:left]
        rides = [leg.track for leg in carried if leg.action is LegAction.RIDE]
        return date_ms, rides, any(leg.action is LegAction.STAND for leg in carried)

    def until(at_s: int) -> list[Message]:
        return said(two_floors(), (LegAction.STAND, 2, 4, 4, at_s), (LegAction.TRAVEL, SPUR, 0, 1, at_s + 8))

    free_ms, rides, stands = way(until(30))
    assert (rides, stands) == ([LEFT], False)
    round_ms, rides, stands = way(until(85))
    assert (rides, stands) == ([RIGHT], False)

    def check(messages: Sequence[Message]) -> None:
        waits_ms, rides, stands = way(messages)
        assert (rides, stands) == ([LEFT], True)
        assert free_ms + 3_000 < waits_ms < round_ms

    shown(check, until(78), CallForProposals, Bid, Itinerary)


# --- which place -----------------------------------------------------------------------------------------------------

#: Places by their indices; the compartment is at p(1,4), and somebody else stands before the first for a minute.
NEAR, AWAY, FAR = 6, 1, 9
PLACES = (NEAR, AWAY, FAR)


def alley(*places: int) -> CarPark:
    """One alley with these places alone."""
    gone = ", ".join(f'"p(1,{index})"' for index in range(1, 13) if index not in places)
    text = f"""
    site = {{name = "places", bitrate = 500_000}}
    floors = {{count = 1, positions = 12, sides = ["far"], without = [{gone}]}}
    compartments = [{{name = "IOC1", node = 1, at = "p(1,4)"}}]
    spurs = [{{at = "p(1,12)", side = "near"}}]
    robots = [
        {{name = "MR1", node = {ROBOT}, home = "p(1,2)"}},
        {{name = "MR2", node = {OTHER}, home = "p(1,{NEAR})"}},
    ]
    """
    return telling(at_the_key(parse_site(text, "places.toml", crowded=True)))


def test_p46_of_all_places_the_one_that_is_done_with_soonest_is_bid_for() -> None:
    """The bid where all three are free is the least of those that the same robot makes where one alone is."""

    def chosen(messages: Sequence[Message]) -> tuple[int, int]:
        date_ms, plan = offer(messages)
        return date_ms, [leg.to_index for leg in plan.legs if leg.action is LegAction.WORK][-1]

    def with_places(*places: int) -> list[Message]:
        legs = (LegAction.STAND, 1, NEAR, NEAR, 85), (LegAction.TRAVEL, 1, NEAR, 12, 105)
        return said(alley(*places), *legs, (LegAction.TRAVEL, SPUR, 0, 1, 110))

    alone = {index: chosen(with_places(index)) for index in PLACES}
    assert {index: where for index, (_, where) in alone.items()} == {index: index for index in PLACES}
    dates_ms = {index: date_ms for index, (date_ms, _) in alone.items()}
    assert dates_ms[NEAR] > dates_ms[AWAY] + 5_000, "the nearest is not the soonest"
    assert len(set(dates_ms.values())) == len(PLACES)

    def check(messages: Sequence[Message]) -> None:
        assert chosen(messages) == (min(dates_ms.values()), AWAY)

    shown(check, with_places(*PLACES), CallForProposals, Bid, Itinerary)
