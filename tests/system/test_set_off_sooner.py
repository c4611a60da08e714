"""Who stands by its plan sets off sooner as others are done, or give up, what it waits for."""

from bus_sim.campaign.report import RunVerdict
from bus_sim.campaign.trial import play
from bus_sim.faults.scenario import FaultScenario
from bus_sim.systems.car_park.demand import Arrivals
from onboard.config.site import parse_site
from onboard.systems.car_park.site import car_park

#: Six floors, one slow lift, and a bay at each end of the street: each robot plans its rides around the other's.
ONE_SLOW_LIFT = """
[site]
name = "one-slow-lift"
[floors]
count = 6
positions = 18
sides = ["near"]
[[lifts]]
name = "ER1"
node = 100
end = "left"
[[spurs]]
at = "p(*,17)"
side = "far"
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,2)"
[[compartments]]
name = "IOC2"
node = 2
at = "p(1,15)"
side = "far"
[[robots]]
name = "MR1"
node = 11
home = "p(3,14)"
[[robots]]
name = "MR2"
node = 12
home = "p(192,1)"
[lift]
speed_mm_s = 500
[negotiation]
desk = "own"
place = "random"
rest_at = "demand"
rides = "before"
offers = "kept"
call_at = "arrival"
promises = true
"""


def test_nobody_waits_for_what_another_has_given_up_to_the_end_of_its_time() -> None:
    """Both stood for minutes in front of the bays, each until the other was to have used the lift (drawn, 4016)."""
    site = car_park(parse_site(ONE_SLOW_LIFT, "one-slow-lift.toml"))
    report = play(site, FaultScenario("one-slow-lift", 3, 4_000, Arrivals(8, 20, 10, 100), ()))
    assert (report.verdict, report.served, report.stalls) == (RunVerdict.SERVED, 8, ())
    assert report.longest_wait_s < 900
