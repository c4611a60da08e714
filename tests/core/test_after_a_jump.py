"""What is to last for a while is not over because a clock has jumped."""

from bus_sim.sites import find_site
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import BusTime, EmergencyStop, Heartbeat, SyncDone, SyncRequest
from onboard.core.effects import Send
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


def test_who_has_just_come_was_not_known_before_because_its_time_is_taken_up() -> None:
    """A fixed machine's clock may be far ahead of a young site's: its time counts, and it has no earlier life."""
    bay = Holon(SITE, SITE.machines[BAY], factory_for(SITE, KindCode.COMPARTMENT))
    bay.start(0)
    for now_us in range(100_000, 1_000_001, 100_000):
        bay.wake(now_us)
    starting = MachineState.STARTING
    bay.receive(Heartbeat(LIFT, CONTRACT_VERSION, SITE.digest, 0, 1, KindCode.LIFT, starting, 0), 1_000_000)
    bay.receive(BusTime(LIFT, DAY_US), 1_001_000)
    assert bay.bus_us(1_001_000) == DAY_US
    effects = bay.receive(SyncRequest(LIFT, NOBODY, 0), 1_002_000)
    said = [one.message for one in effects if isinstance(one, Send)]
    assert any(isinstance(one, SyncDone) for one in said)
    assert [one for one in said if isinstance(one, SyncRequest) and one.boot_before] == []
