"""Row P37: each of the eight ways from the first to the fifth floor is bid for and driven, the others being shut."""

from collections.abc import Sequence
from itertools import groupby

import pytest

from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import Grade, LegAction, TaskPhase
from onboard.contract.messages import Bid, CallForProposals, Itinerary, Progress, TaskReport
from onboard.systems.car_park.site import CarPark
from tests.cut import Timed, first_of, shown_at
from tests.sites import at_arrival, telling
from tests.system.scene import play, stays
from tests.ways.lift_itineraries import Ride, lift_itineraries

ROBOT, LEFT, RIGHT, FLOORS, PLACES = 11, 128, 129, 5, 10
#: Where somebody has died: on the way to the lift that is not to be taken, on that from the one not to be left, and on
#: the alleys that are not to be crossed.
AWAY, BACK = {LEFT: (1, 8), RIGHT: (1, 2)}, {LEFT: (5, 9), RIGHT: (5, 3)}


def park(rides: Sequence[Ride]) -> tuple[CarPark, list[int]]:
    """The site, and the node-IDs of those who stand in the way. The only place is p(5,6)."""
    crossed = {ride.to_floor for ride in rides[:-1]}
    across = [(floor, 5) for floor in range(2, FLOORS) if floor not in crossed]
    shut = [AWAY[rides[0].lift_track], BACK[rides[-1].lift_track], *across]
    gone = ", ".join(f'"p({floor},*)"' for floor in range(1, FLOORS))
    gone += "".join(f', "p({FLOORS},{index})"' for index in range(1, PLACES + 1) if index != 6)
    robots = ", ".join(
        f'{{name = "MR{number}", node = {ROBOT + number}, home = "p({floor},{index})"}}'
        for number, (floor, index) in enumerate([(1, 5), *shut])
    )
    text = f"""
    site = {{name = "eight", bitrate = 500_000}}
    floors = {{count = {FLOORS}, positions = {PLACES}, sides = ["near"], without = [{gone}]}}
    compartments = [{{name = "IOC1", node = 1, at = "p(1,4)"}}]
    lifts = [{{name = "ER1", node = 5, end = "left"}}, {{name = "ER2", node = 6, end = "right"}}]
    spurs = [{{at = "p(5,7)", side = "far"}}]
    robots = [{robots}]
    """
    site = parse_site(text, "eight.toml", crowded=True)
    return telling(at_arrival(site)), [ROBOT + number for number in range(1, len(shut) + 1)]


EIGHT = lift_itineraries(park([Ride(LEFT, 1, FLOORS)])[0], 1, FLOORS)


@pytest.mark.parametrize(
    "rides",
    EIGHT,
    ids=lambda rides: "-".join(str(one.to_floor) + ("L" if one.lift_track == LEFT else "R") for one in rides),
)
def test_p37_each_of_the_eight_ways_is_bid_for_and_driven(rides: tuple[Ride, ...]) -> None:
    site, dead = park(rides)

    def before(simulation: Simulation) -> None:
        for node in dead:
            simulation.loop.call_at(5.0, simulation.crash, site.machines[node])
            simulation.devices[node].attach("listener")

    scene = play(site, stays((0, None)), before=before, limit_s=200, extra_s=30 + 65 * len(rides))
    assert len(EIGHT) == 8 and scene.simulation.plant.oracle.finish() == []

    def check(said: Sequence[Timed]) -> None:
        call_us, call = first_of(said, CallForProposals)
        bid_us, bid = first_of(said, Bid, lambda one: (one.initiator, one.call) == (call.sender, call.call))
        plans = [one for at, one in said if at > bid_us and isinstance(one, Itinerary) and one.sender == ROBOT]
        for grade in (Grade.TENTATIVE, Grade.FIRM):
            plan = next((one for one in plans if one.grade is grade), None)
            assert plan is not None
            ridden = [leg for leg in plan.legs if leg.action is LegAction.RIDE]
            assert tuple(Ride(leg.track, leg.from_index, leg.to_index) for leg in ridden) == rides
        done_us, _ = first_of(said, TaskReport, lambda one: one.phase is TaskPhase.DONE)
        assert bid.sender == ROBOT and call_us < bid_us < done_us
        # Where it says that it is: on each floor of the way in turn.
        tracks = [one.track for at, one in said if isinstance(one, Progress) and one.sender == ROBOT and at < done_us]
        floors = [one for one in tracks if one <= FLOORS]
        assert [floor for floor, _ in groupby(floors)] == [1, *(ride.to_floor for ride in rides)]

    fleet = [(one.time_us, one.message) for one in scene.said if one.bus == "fleet"]
    shown_at(check, fleet, CallForProposals, Bid, Itinerary, TaskReport, Progress)
