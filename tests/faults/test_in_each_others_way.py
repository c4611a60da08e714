"""Robots with cars aboard in each other's way, after a person has blocked a slot or held one of them.

Two buildings drawn by chance (car parks 5814 and 5799).
"""

from bus_sim.campaign.report import RunVerdict, TrialReport
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.systems.car_park.demand import Arrivals
from onboard.config.site import parse_site

FACE_TO_FACE = """\
[site]
name = "d5814"
bitrate = 125000
[floors]
count = 3
positions = 19
sides = ["far"]
without = ["p(*,15)F"]
[floors.3]
sides = ["near"]
height_mm = 4000
[[lifts]]
name = "ER1"
node = 100
end = "left"
[[spurs]]
at = "p(*,15)"
side = "far"
length = 1
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,14)"
side = "far"
use = "both"
[[compartments]]
name = "IOC2"
node = 2
at = "p(1,14)"
side = "near"
use = "both"
[[compartments]]
name = "IOC3"
node = 3
at = "p(1,13)"
side = "near"
use = "both"
[[compartments]]
name = "IOC4"
node = 4
at = "p(1,15)"
side = "near"
use = "both"
[[robots]]
name = "MR1"
node = 11
home = "p(3,17)"
[[robots]]
name = "MR2"
node = 12
home = "p(192,1)"
[[robots]]
name = "MR3"
node = 13
home = "p(194,1)"
[[robots]]
name = "MR4"
node = 14
home = "p(2,19)"
[[robots]]
name = "MR5"
node = 15
home = "p(193,1)"
[carrier]
speed_mm_s = 3000
turn_ms = 5000
[negotiation]
desk = "own"
place = "cost"
rest_at = "nearest"
call_at = "arrival"
rides = "before"
offers = "told"
promises = true
quiet_moves = false
"""
BEHIND_ONE = """\
[site]
name = "d5799"
bitrate = 500000
[floors]
count = 4
positions = 24
sides = ["near"]
[[lifts]]
name = "ER1"
node = 100
end = "right"
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,19)"
side = "near"
use = "both"
[[compartments]]
name = "IOC2"
node = 2
at = "p(1,15)"
side = "near"
use = "both"
[[compartments]]
name = "IOC3"
node = 3
at = "p(1,18)"
side = "far"
use = "both"
[[robots]]
name = "MR1"
node = 11
home = "p(2,19)"
[[robots]]
name = "MR2"
node = 12
home = "p(3,20)"
[battery]
capacity_wh = 480
charge_w = 1200
[timing]
call_window_ms = 2500
heartbeat_ms = 1500
[negotiation]
desk = "nearest"
place = "nearest"
rest_at = "nearest"
call_at = "arrival"
rides = "planned"
offers = "told"
promises = false
quiet_moves = false
"""


def played(site: str, seed: int, cars: int, fault: str, limit_s: float) -> TrialReport:
    faults = (parse_injection(fault),)
    return play(
        parse_site(site, "drawn.toml"), FaultScenario("drawn", seed, limit_s, Arrivals(cars, 15, 7.5, 200), faults)
    )


def test_of_two_that_stand_face_to_face_with_cars_aboard_one_gives_way() -> None:
    """Neither had a plan, as the other stood there; the slot that had kept them from going was free again.

    Five of ten customers waited for good.
    """
    report = played(FACE_TO_FACE, 5814, 10, "blocked:at_s=397.028815,track=1,index=2,for_s=132.826", 1_600)
    assert report.verdict is RunVerdict.SERVED, report.why()


def test_who_is_left_alone_goes_on_with_what_it_can_reach() -> None:
    """The held robot stood between all refuges and the other, which did nothing any more: nine of fourteen served."""
    report = played(BEHIND_ONE, 5799, 14, "held:at_s=705.345803,target=MR1,for_s=100000", 1_300)
    assert (report.verdict, report.waiting, report.served) == (RunVerdict.TOLD, 0, 12), report.why()
