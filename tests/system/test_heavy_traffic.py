"""Four robots and two lifts under more traffic than they can serve: late, but nothing stands still."""

from itertools import pairwise

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand
from onboard.contract.codes import Grade, TaskPhase
from onboard.contract.messages import Bid, Itinerary, Stamp, TaskReport
from tests.system.scene import Scene, play

CARS = 16


@pytest.fixture(scope="module")
def rush() -> Scene:
    """A car every 20 s, fetched soon after; so dense that robots met head-on before plans kept their order."""
    return play(find_site("standard"), Demand.by_mean(20, 10, 3, count=CARS), limit_s=2_400)


def test_p44_everybody_is_served_and_the_machines_never_stand_still(rush: Scene) -> None:
    rush.assert_sound()
    street = rush.simulation.plant.street.summary()
    assert (street.parked, street.served) == (CARS, CARS)
    ends_us = [at for at, m in rush.all(TaskReport, "fleet") if m.phase is TaskPhase.DONE]
    gaps_s = [(after - before) / 1e6 for before, after in pairwise(ends_us)]
    # The longest single task, with a ride and both handlings, takes about 100 s.
    assert max(gaps_s) < 160


def test_p18_load_spreads_over_all_robots(rush: Scene) -> None:
    owners = {m.sender for _, m in rush.all(TaskReport, "fleet") if m.phase is TaskPhase.DONE}
    assert owners == {11, 12, 13, 14}


def test_p08_bids_of_every_call_strictly_improve_in_the_log(rush: Scene) -> None:
    """A later bid is earlier, or as early and from a lower node-ID; the second best speaks only if the best is late."""
    by_call: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for _, bid in rush.all(Bid, "fleet"):
        by_call.setdefault((bid.initiator, bid.call), []).append((bid.cost, bid.sender))
    contested = [bids for bids in by_call.values() if len(bids) > 1]
    assert len(contested) >= 3, "else this says little"
    assert all(later < earlier for bids in contested for earlier, later in pairwise(bids))


def test_plans_are_told_anew_with_other_times_and_keep_their_stamp(rush: Scene) -> None:
    stamps: dict[int, set[Stamp]] = {}
    versions: dict[int, set[int]] = {}
    for _, m in rush.all(Itinerary, "fleet"):
        if m.grade is Grade.FIRM:
            stamps.setdefault(m.sender, set()).add(m.stamp)
            versions.setdefault(m.sender, set()).add(m.version)
    assert all(len(versions[node]) > len(stamps[node]) for node in (11, 12, 13, 14))
