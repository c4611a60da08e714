"""Row P46, from the bus: of all places where a car could go a robot bids for the one that is done with soonest."""

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
#: Places by their indices; the compartment is at p(1,4), and somebody else stands before the first for a minute.
NEAR, AWAY, FAR = 6, 1, 9
PLACES = (NEAR, AWAY, FAR)


def park(*places: int) -> CarPark:
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


def said(*places: int) -> list[Message]:
    """What is said about one car, where MR2, whose words are the test's, stands for a minute and goes on to a spur."""
    site = park(*places)

    def words(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("other")
        simulation.devices[OTHER].attach("listener")

        def say(message: Message) -> None:
            for frame in fleet_codec().encode(message):
                assert bus.send(frame)

        def beat() -> None:
            say(Heartbeat(OTHER, CONTRACT_VERSION, site.digest, 0, 1, KindCode.ROBOT, MachineState.WORKING))
            simulation.loop.call_later(1.0, beat)

        legs = [(LegAction.STAND, 1, NEAR, NEAR), (LegAction.TRAVEL, 1, NEAR, 12), (LegAction.TRAVEL, 192, 0, 1)]
        plan = tuple(Leg(*leg, Side.NEAR, 1_000 * end_s) for leg, end_s in zip(legs, (85, 105, 110), strict=True))
        simulation.loop.call_at(0.5, beat)
        simulation.loop.call_at(0.6, say, Progress(OTHER, 1, 0, 1, NEAR, 0, 0))
        simulation.loop.call_at(0.7, say, Itinerary(OTHER, 1, Grade.FIRM, Stamp(0, 1, 99), plan))

    scene = play(site, stays((0, None)), before=words, without=frozenset({"MR2"}), limit_s=26.3, extra_s=0)
    return [one.message for one in scene.said if one.bus == "fleet"]


def offer(messages: Sequence[Message]) -> tuple[int, int]:
    """How long after the call's deadline the robot's bid is, ms, and where its plan leaves the car."""
    timed = [(0, one) for one in messages]
    call, bid = first_of(timed, CallForProposals)[1], first_of(timed, Bid, lambda one: one.sender == ROBOT)[1]
    plan = first_of(timed, Itinerary, lambda one: one.sender == ROBOT and one.grade is Grade.TENTATIVE)[1]
    works = [leg for leg in plan.legs if leg.action is LegAction.WORK]
    assert bid.cost == works[-1].end_ms
    return bid.cost - call.deadline_ms, works[-1].to_index


def test_p46_of_all_places_the_one_that_is_done_with_soonest_is_bid_for() -> None:
    """The bid where all three are free is the least of those that the same robot makes where one alone is."""
    alone = {index: offer(said(index)) for index in PLACES}
    assert {index: where for index, (_, where) in alone.items()} == {index: index for index in PLACES}
    dates_ms = {index: date_ms for index, (date_ms, _) in alone.items()}
    assert dates_ms[NEAR] > dates_ms[AWAY] + 5_000, "the nearest is not the soonest"
    assert len(set(dates_ms.values())) == len(PLACES)

    def check(messages: Sequence[Message]) -> None:
        assert offer(messages) == (min(dates_ms.values()), AWAY)

    shown(check, said(*PLACES), CallForProposals, Bid, Itinerary)
