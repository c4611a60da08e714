"""The car park, for the tests of every system."""

from dataclasses import replace

from bus_sim.sites import find_site
from bus_sim.systems.car_park.planted.registry import BUGS
from onboard.systems.car_park.checks import RULES
from tests.conformance.case import Case

CASE = Case(
    system="car-park",
    site="small",
    options=("--one-car", "60"),
    moving=("--random", "40", "15", "--cars", "2", "--for", "150"),
    busy=lambda: replace(find_site("small")),
    struck_s=lambda _: (12.0, 100.0),
    limit_s=1_200,
    # Its seeds are those of tests/faults/test_campaign.py, where customers may be told why not.
    profiles=(),
    # What it says of calls is judged among rides and places: planted bugs show each rule, two of them.
    parties=None,
    shown_elsewhere=frozenset(bug.finds for bug in BUGS.values()),
    idle=frozenset(RULES),
    words=(
        ["park car IOC1/1", "IOC1 to anywhere"],
        ["takes the car at IOC1"],
        ["tokens p(1,1) to p(1,4)", "car IOC1/1"],
    ),
    drawn=["p(1,5)", "lift ER1", "MR1", "MR2"],
)
