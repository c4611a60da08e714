"""What is to last for a while is not over because a clock has jumped."""

from bus_sim.sites import find_site
from onboard.contract.codes import KindCode, Reason
from onboard.contract.messages import BusTime, EmergencyStop
from onboard.holon.holding import STOP_LASTS_US, HoldState
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for

SITE = find_site("small")
BAY, LIFT, OPERATOR = 1, 5, 252
DAY_US = 86_400_000_000


def started() -> Holon:
    holon = Holon(
        SITE, SITE.machines[LIFT], factory_for(SITE, KindCode.LIFT), boot=2, entries=[{"record": "boot", "boot": 1}]
    )
    holon.start(0)
    holon.receive(BusTime(BAY, 1_000_000), 1_000_000)
    return holon


def test_an_emergency_stop_is_not_old_because_a_clock_has_jumped() -> None:
    holon = started()
    holon.receive(EmergencyStop(OPERATOR, Reason.OPERATOR), 2_000_000)
    holds = [holon.holding.hold]
    for now_us in (DAY_US, *range(DAY_US, DAY_US + STOP_LASTS_US + 1, 1_000_000)):
        holon.wake(now_us)
        holds.append(holon.holding.hold)
    assert holds == [HoldState.STOPPED] * (len(holds) - 1) + [HoldState.ACTING]


def test_a_machine_that_was_started_again_has_not_heard_everybody_because_its_clock_has_jumped() -> None:
    holon = started()
    assert not holon.tokens.is_synced
    holon.wake(DAY_US)
    assert not holon.tokens.is_synced, "nobody had the time to answer"
    holon.wake(DAY_US + 1_000_000)
    holon.wake(DAY_US + SITE.timing.heartbeat_us)
    assert holon.tokens.is_synced, "nobody lives"
