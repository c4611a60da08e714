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
RING = """\
[site]
name = "d592"
system = "graph"

[graph]
rules = "edge-and-node"
capacity = 5
speed_mm_s = 500
load_ms = 0
edges = [[0, 1, 9000], [1, 2, 8000], [2, 3, 13000], [3, 4, 8000], [4, 5, 4000], [5, 6, 5000], [6, 7, 10000],
         [7, 0, 6000]]

[[hosts]]
name = "N1"
node = 20
nodes = [0, 2, 4, 6]

[[hosts]]
name = "N2"
node = 21
nodes = [1, 3, 5, 7]

[[desks]]
name = "D1"
node = 1
"""
RING += "".join(
    f'\n[[robots]]\nname = "R{number}"\nnode = {30 + number}\nat = {home}\n'
    for number, home in enumerate((5, 7, 3, 1, 4), start=1)
)


def played(text: str, seed: int, apart_s: float, *faults: str) -> TrialReport:
    demand = OrderArrivals(12, apart_s)
    scenario = FaultScenario("drawn", seed, 900.0, demand, tuple(parse_injection(one) for one in faults))
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


def test_a_slot_that_was_taken_unheard_is_not_given_to_others_for_ever() -> None:
    """A host did not hear who got a slot of another host's node, and let three robots have it, who asked in vain."""
    unheard = "lossy:at_s=229.607891,receivers=N1|N2|R1|R5,probability=0.2,seed=369497"
    report = played(RING, 592, 15.0, "drift:at_s=143.957692,target=R1,ppm=200", unheard)
    assert (report.served, report.waiting, tuple(report.violations)) == (12, 0, ())
