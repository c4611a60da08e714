"""Factory graphs drawn by chance that did not come to their end: words unheard for a while, and a clock set anew."""

from bus_sim.campaign.report import TrialReport
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.systems.orders import OrderArrivals
from onboard.config.site import parse_site

HALL = """\
[site]
name = "d37"
system = "graph"
bitrate = 125000

[graph]
speed_mm_s = 2000
load_ms = 0
edges = [[0, 1, 15000], [1, 2, 12000], [2, 3, 7000], [3, 4, 7000], [4, 5, 10000], [4, 9, 11000], [5, 6, 14000],
         [6, 7, 3000], [7, 3, 6000], [7, 8, 15000], [8, 9, 8000], [9, 10, 3000], [10, 11, 14000], [11, 12, 8000],
         [12, 13, 3000], [13, 0, 10000]]

[[hosts]]
name = "N1"
node = 20
nodes = [3, 5, 6, 7, 8, 12, 13]

[[hosts]]
name = "N2"
node = 21
nodes = [0, 1, 2, 4, 9, 10, 11]

[[desks]]
name = "D1"
node = 1

[[robots]]
name = "R1"
node = 31
at = 10

[[robots]]
name = "R2"
node = 32
at = 7

[[robots]]
name = "R3"
node = 33
at = 13

[[robots]]
name = "R4"
node = 34
at = 12
"""
SMALL = """\
[site]
name = "d38"
system = "graph"

[graph]
capacity = 2
speed_mm_s = 2000
load_ms = 5000
edges = [[0, 1, 13000], [1, 2, 15000], [1, 5, 15000], [2, 3, 3000], [3, 4, 3000], [3, 7, 8000], [4, 5, 9000],
         [5, 6, 5000], [6, 2, 15000], [6, 7, 5000], [7, 0, 5000]]

[[hosts]]
name = "N1"
node = 20
nodes = [0, 1, 2, 3, 4, 5, 6, 7]

[[desks]]
name = "D1"
node = 1

[[desks]]
name = "D2"
node = 2

[[robots]]
name = "R1"
node = 31
at = 6

[[robots]]
name = "R2"
node = 32
at = 4
"""


def played(text: str, seed: int, apart_s: float, fault: str) -> TrialReport:
    demand = OrderArrivals(12, apart_s)
    scenario = FaultScenario("drawn", seed, 900.0, demand, (parse_injection(fault),))
    return play(parse_site(text, "drawn.toml"), scenario)


def test_an_edge_that_was_given_back_unheard_is_free_again() -> None:
    """A host did not hear for 14 s who left an edge, and told whoever asked for it to stop, for half an hour."""
    report = played(HALL, 37, 12.5, "partition:at_s=18.560418,members=N1|R1,for_s=14.456,way=out")
    assert (report.served, report.waiting, report.violations) == (12, 0, ())
    assert report.simulated_s < 300


def test_who_loads_while_its_clock_is_set_anew_loads_for_as_long_as_it_takes() -> None:
    """The desk that is the clock of all drifted, and a robot drove off with less aboard than it told."""
    report = played(SMALL, 38, 25.0, "drift:at_s=52.767849,target=D1,ppm=-2000")
    assert (report.served, report.waiting, tuple(report.violations)) == (12, 0, ())
