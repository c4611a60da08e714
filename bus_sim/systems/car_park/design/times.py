"""What machines take between motions, us, as they do in the plant where nobody is in the way.

Plans count more (``HANDLING_OVERHEAD_US``, ``GATE_US`` and the like are what a machine must not exceed), and whoever is
sooner goes on at once: where a round of ``ring`` took 3.3 s of 144 more than the plant's, drivers waited a fifth longer
in its queue. Medians of the shipped days of ``small``, ``standard`` and ``ring`` (docs/figures.md), of the controllers
and devices and not of a site; ``tests/design/test_model.py`` holds them to the plant by one car on each of two sites.
"""

from onboard.systems.car_park.generation import AWARD_LATENCY_US, HANDLING_OVERHEAD_US
from onboard.ways.lift_uses import GATE_US

#: From a call's end until its winner sets off: award, journal and first rights.
AWARD_US = 30_000
#: From the end of a leg until the next begins, or the work: the end is sensed and told, and the next order given.
LEG_US = 50_000
#: A ride beside the platform's own run: the gate's rights at both ends, and what a leg has not.
RIDE_US = 90_000
#: A shuttle's work beside its motions and the grip: two orders, and the car's word.
WORK_US = 30_000
#: From a bay's door standing open until the shuttle reaches in: it is told, and the right to reach in given.
REACH_US = 200_000
#: From the last sensor's word to the next thing that a compartment does.
STEP_US = 20_000
#: From the end of a desk's call for the bays' bids until the winner does something.
DESK_US = 20_000
#: What plans, and so bids, allow for beyond these: at the award, for a ride, and for a shuttle's work.
BID_AWARD_US = AWARD_LATENCY_US - AWARD_US
BID_RIDE_US = GATE_US - RIDE_US
BID_WORK_US = HANDLING_OVERHEAD_US - WORK_US
