"""A lone robot that has more to do than it can plan: it stands before no bay for ever, and is never left out.

A building drawn by chance: four floors with a loop driven one way round, four bays, one robot. Its lift and then the
robot lose their power; with six tasks in hand another place for the car aboard was more than an itinerary tells.
"""

import pytest

from bus_sim.campaign.report import FAILURES
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.systems.car_park.demand import Arrivals
from onboard.config.site import parse_site
from onboard.systems.car_park.bay_calls import BayCalls

SITE = """\
[site]
name = "b463"

[floors]
count = 4
positions = 10

[[alleys]]
name = "B"
from = "p(*,2)"
positions = 7
one_way = "rising"

[[alleys]]
name = "C"
from = "p(*,B,7)"
positions = 4
side = "near"
one_way = "rising"

[[alleys]]
name = "D"
from = "p(*,C,4)"
positions = 6
side = "near"
to = "p(*,6)"
one_way = "rising"

[[lifts]]
name = "ER1"
node = 100
end = "left"

[[compartments]]
name = "IOC1"
node = 1
at = "p(1,9)"

[[compartments]]
name = "IOC2"
node = 2
at = "p(1,1)"
side = "far"

[[compartments]]
name = "IOC3"
node = 3
at = "p(3,B,3)"
side = "far"

[[compartments]]
name = "IOC4"
node = 4
at = "p(1,7)"

[[robots]]
name = "MR1"
node = 11
home = "p(3,5)"

[negotiation]
desk = "own"
rides = "before"
"""
FAULTS = (
    "crash:at_s=118.95839,target=ER1,restart_s=17.893,frame=37",
    "crash:at_s=406.532055,target=MR1,restart_s=18.287,write=5,durable=yes",
)


def played_s(monkeypatch: pytest.MonkeyPatch, *, has_care: bool) -> float:
    """How long it takes until all are served or told why, s; ``has_care`` of its bays, whether they look who comes."""
    if not has_care:
        monkeypatch.setattr(BayCalls, "_is_full", False)
    faults = tuple(parse_injection(one) for one in FAULTS)
    report = play(
        parse_site(SITE, "b463.toml"), FaultScenario("b463", 463, demand=Arrivals(12, 20, 10, 200), faults=faults)
    )
    assert report.verdict not in FAILURES, report.why()
    assert report.served + report.told == 12
    return report.simulated_s


def test_a_bay_calls_for_no_car_while_nobody_has_won_the_one_that_stands_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """It took 4,022 s: the robot brought a car to a full bay, and stood there for as long as ten minutes at a time."""
    assert played_s(monkeypatch, has_care=True) < 2_200


def test_who_stands_loaded_before_a_full_bay_gives_back_what_it_did_not_touch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing happened for 81 s, and then for 657: no place for the car aboard left room in a plan for six tasks."""
    assert played_s(monkeypatch, has_care=False) < 2_700
