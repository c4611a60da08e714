"""A clock that is far off is lost, not slewed for hours; the next message that says the same sets it."""

from onboard.core.bus_time import FAR_US, MAX_SLEW_US, BusClock


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
