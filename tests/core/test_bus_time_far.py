"""A clock that is far off is lost, not slewed for hours; the next message that says the same sets it."""

from bus_sim.sites import find_site
from onboard.contract.codes import Reason
from onboard.contract.messages import BusTime, Heartbeat, SyncRequest
from onboard.core.bus_time import BUS_TIME_MODULUS, FAR_US, MAX_SLEW_US, BusClock
from onboard.core.effects import Effect, Report, Send
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for

SITE = find_site("small")
BAY, LIFT = 1, 5


def in_sync() -> BusClock:
    clock = BusClock(5_000_000)
    clock.heard(1_000_000, 0)
    return clock


def test_a_small_error_is_slewed() -> None:
    clock = in_sync()
    clock.heard(1_000_000 + 50_000, 0)
    assert clock.bus_us(0) == 1_000_000 + MAX_SLEW_US
    assert not clock.is_lost(0)


def test_a_jump_loses_the_clock_until_a_second_message_confirms_it() -> None:
    clock = in_sync()
    clock.heard(6_000_000, 0)
    assert clock.is_lost(0)
    assert clock.bus_us(0) == 1_000_000
    clock.heard(11_000_500, 5_000_000)
    assert not clock.is_lost(5_000_000)
    assert clock.bus_us(5_000_000) == 11_000_500


def test_one_message_that_is_far_off_changes_nothing() -> None:
    clock = in_sync()
    clock.heard(1_000_000 + 2 * FAR_US, 0)
    clock.heard(1_000_000, 0)
    assert not clock.is_lost(0)
    assert clock.bus_us(0) == 1_000_000


def test_two_errors_that_differ_confirm_nothing() -> None:
    clock = in_sync()
    clock.heard(9_000_000, 0)
    clock.heard(-9_000_000, 0)
    assert clock.is_lost(0)
    assert clock.bus_us(0) == 1_000_000


HOURS_US = 36_000_000_000


def fixed(node: int) -> Holon:
    return Holon(SITE, SITE.machines[node], factory_for(SITE, SITE.machines[node].kind))


def times(effects: list[Effect]) -> list[int]:
    said = [effect.message for effect in effects if isinstance(effect, Send)]
    return [message.bus_time_us for message in said if isinstance(message, BusTime)]


def test_a_source_whose_board_was_off_takes_up_the_time_of_the_bus() -> None:
    """Its own clock begins at zero again; if all others followed it, nothing would be due for hours."""
    lift, bay = fixed(LIFT), fixed(BAY)
    lift.start(HOURS_US)
    (began,) = times(bay.start(0))
    (answer,) = times(lift.receive(BusTime(BAY, began), HOURS_US + 1_000))
    assert answer == HOURS_US + 1_000
    bay.receive(BusTime(LIFT, answer), 2_000)
    (now,) = times(bay.wake(2_000))
    assert now == HOURS_US + 1_000
    lift.receive(BusTime(BAY, now), HOURS_US + 1_500)
    assert not lift.clock.is_lost(HOURS_US + 1_500)
    assert abs(lift.clock.bus_us(HOURS_US + 1_500) - now) < FAR_US


def test_a_source_that_says_again_that_it_is_behind_is_believed() -> None:
    lift = fixed(LIFT)
    lift.start(HOURS_US)
    assert times(lift.receive(BusTime(BAY, 0), HOURS_US))
    assert times(lift.receive(BusTime(BAY, 5_000_000), HOURS_US + 5_000_000)) == []
    now_us = lift.clock.bus_us(HOURS_US + 5_000_000)
    assert now_us % BUS_TIME_MODULUS == 5_000_000
    assert now_us > HOURS_US, "its own time goes forward only: what was due is due now"


def test_a_source_that_has_led_for_long_goes_by_its_own_time() -> None:
    bay = fixed(BAY)
    bay.start(0)
    bay.receive(BusTime(LIFT, HOURS_US), 60_000_000)
    assert bay.clock.bus_us(60_000_000) == 60_000_000


#: What the board's own clock does to each of these is a fault; bus time takes no notice of more than it must.
TEN_YEARS_US = 315_576_000_000_000


def test_a_clock_that_goes_back_stands_still_for_a_moment_and_goes_on() -> None:
    lift = fixed(LIFT)
    lift.start(HOURS_US)
    due_us = lift.next_wake()
    assert due_us is not None
    lift.wake(due_us)
    before_us = lift.bus_us(due_us)
    again_us = lift.next_wake()
    assert again_us is not None
    lift.wake(due_us - HOURS_US)
    assert lift.bus_us(due_us - HOURS_US) == before_us
    assert lift.next_wake() == again_us - HOURS_US, "what was due in a second is due in a second"


def test_a_clock_that_is_ten_years_ahead_is_set_by_the_second_message_and_nothing_is_due_in_ten_years() -> None:
    lift = fixed(LIFT)
    lift.start(0)
    lift.receive(BusTime(BAY, 5_000_000), 5_000_000)
    lift.wake(5_500_000)
    ahead_us = TEN_YEARS_US + 6_000_000
    lift.wake(ahead_us)
    for number in (1, 2):
        lift.receive(BusTime(BAY, 5_000_000 + number * 5_000_000), ahead_us + number * 5_000_000)
    now_us = ahead_us + 10_000_000
    assert not lift.clock.is_lost(now_us)
    assert lift.clock.said_us(now_us) == 15_000_000
    due_us = lift.next_wake()
    assert due_us is not None and due_us < now_us + 2_000_000
    assert lift.presence.is_held, "it has slept, for all that the others know"


def test_bus_time_that_no_clock_shows_is_dropped() -> None:
    lift = fixed(LIFT)
    lift.start(0)
    lift.receive(BusTime(BAY, BUS_TIME_MODULUS), 10)
    assert not lift.clock.heard_at_us
    assert lift.drops[Reason.VALUE_OUT_OF_RANGE] == 1


def test_an_old_time_of_who_is_the_source_no_longer_sets_no_clock() -> None:
    """At power-up a word of a higher node may have waited behind hundreds of its own: it says so twice."""
    robot = fixed(11)
    robot.start(0)
    robot.receive(BusTime(BAY, 1_000_000), 0)
    before_us = robot.clock.bus_us(0)
    for late_us in (200_000, 201_000):
        robot.receive(BusTime(LIFT, 1_000_000), late_us)
    assert robot.clock.bus_us(0) == before_us and not robot.clock.is_lost(201_000)
    assert robot.drops[Reason.LATE] == 2
    quiet_us = 201_000 + SITE.timing.heartbeat_us
    for later_us in (quiet_us, quiet_us + 1_000):
        robot.receive(BusTime(LIFT, later_us + HOURS_US), later_us)
    assert robot.clock.bus_us(0) == HOURS_US, "it is the source once the lower one was silent for a heartbeat"


def test_times_that_waited_behind_an_answer_set_no_clock() -> None:
    """Three ask the source at once: it tells each the time, and before the second and third time its long answer."""
    robot = fixed(11)
    robot.start(0)
    robot.receive(BusTime(BAY, 1_000_000), 0)
    before_us = robot.clock.bus_us(0)
    robot.receive(BusTime(BAY, 6_009_000), 5_009_300)
    for said_us in (6_009_500, 6_009_800):
        effects = robot.receive(BusTime(BAY, said_us), said_us - 1_000_000 + 277_000)
        assert effects == []
    now_us = 10_000_000
    assert abs(robot.clock.bus_us(0) - before_us) <= MAX_SLEW_US and not robot.clock.is_lost(now_us)
    assert robot.drops[Reason.LATE] == 2


def asked_alone(effects: list[Effect]) -> list[int]:
    words = [effect.message for effect in effects if isinstance(effect, Send)]
    return [word.whom for word in words if isinstance(word, SyncRequest) and word.whom]


def beat(node: int) -> Heartbeat:
    """Its first sign of life."""
    words = [effect.message for effect in fixed(node).start(0) if isinstance(effect, Send)]
    return next(word for word in words if isinstance(word, Heartbeat))


def test_a_clock_that_is_set_while_all_answer_a_start_asks_nobody_alone() -> None:
    """Where fifty start together the first times wait behind their words: each asked all the others one by one."""
    robot = fixed(11)
    effects = robot.start(0)
    for node in (BAY, LIFT):
        effects += robot.receive(beat(node), 1_000)
    effects += robot.receive(BusTime(BAY, 5_000), 6_000)
    for late_us in (200_000, 201_000 + FAR_US):
        effects += robot.receive(BusTime(BAY, late_us - 200_000), late_us)
    for due_us in range(310_000, 380_000, 10_000):
        effects += robot.wake(due_us)
    assert Report("woke after a sleep") in effects, "its clock was set anew"
    assert not asked_alone(effects)
    for due_us in range(1_000_000, 5_000_000, 500_000):
        for node in (BAY, LIFT):
            effects += robot.receive(beat(node), due_us)
        effects += robot.wake(due_us)
    assert {BAY, LIFT} <= set(asked_alone(effects)), "who does not answer is asked again"
