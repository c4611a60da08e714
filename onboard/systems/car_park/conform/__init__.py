"""What the kit of conformity (onboard/conform) plays and judges of a car park's nodes."""

from onboard.systems.car_park.conform import (
    aboard,
    anew,
    asking,
    awards,
    blocked,
    calls,
    company,
    lives,
    meanwhile,
    plans,
    platforms,
    rides,
    rights,
    traffic,
    work,
    yielding,
)
from onboard.systems.car_park.conform.constants import unlike

SCENES = (
    *calls.SCENES,
    *awards.SCENES,
    *blocked.SCENES,
    *rights.SCENES,
    *work.SCENES,
    lives.CUT,
    *meanwhile.SCENES,
    lives.STOP,
    *company.SCENES,
    *yielding.SCENES,
    *traffic.SCENES,
    *asking.SCENES,
    *rides.SCENES,
    *aboard.SCENES,
)
WATCHERS = ((plans.PLANS, plans.watch), ((), platforms.watch))
#: Behind all others: rights that are made anew, and a node that has lost its own.
LAST = anew.LAST
#: Which constants of a site the play was not written for.
UNLIKE = unlike
