"""Intervals that are learned: nine of ten are in them, whatever is drawn, and as narrow as what is drawn allows."""

import random
from collections.abc import Callable
from statistics import median

import pytest

from onboard.systems.car_park.calibration import Calibration, WaitInterval

BEFORE = WaitInterval(0, 100_000_000)
DRAWS: dict[str, Callable[[random.Random, int], float]] = {
    "even": lambda chance, _: chance.uniform(0, 20),
    "normal": lambda chance, _: chance.gauss(60, 5),
    "two kinds": lambda chance, _: chance.choice((2.5, 2.5, 2.5, 9.0)) + chance.uniform(0, 0.1),
    "one value": lambda chance, _: 2.5,
    "ever slower": lambda chance, number: chance.gauss(60, 5) + number / 20,
    "of a sudden slower": lambda chance, number: chance.gauss(60 if number < 1_000 else 90, 5),
}


def drawn(name: str, seed: int = 1, count: int = 2_000) -> tuple[list[bool], list[int]]:
    """Which of a stream were in the interval that was said before, and the widths, us."""
    calibration, chance = Calibration(), random.Random(f"{name}:{seed}")
    kept, widths = [], []
    for number in range(count):
        said, came_us = calibration.interval(BEFORE), round(1e6 * DRAWS[name](chance, number))
        kept.append(said.low_us <= came_us <= said.high_us)
        widths.append(said.high_us - said.low_us)
        calibration.learn(came_us, is_kept=kept[-1])
    return kept, widths


@pytest.mark.parametrize("name", [name for name in DRAWS if name != "one value"])
def test_nine_of_ten_are_in_it_whatever_comes(name: str) -> None:
    kept, _ = drawn(name)
    assert 0.89 <= sum(kept) / len(kept) <= 0.91


def test_it_is_as_wide_as_what_is_drawn() -> None:
    _, widths = drawn("normal")
    # The central 90 % of a normal law are 3.29 deviations.
    assert median(widths[200:]) == pytest.approx(3.29 * 5e6, rel=0.15)


def test_a_change_is_made_good_within_the_next_hundred() -> None:
    kept, _ = drawn("of a sudden slower")
    assert sum(kept[1_100:1_300]) >= 170


def test_before_anything_is_known_it_is_what_was_said_to_be_possible() -> None:
    calibration = Calibration()
    assert calibration.interval(BEFORE) == BEFORE
    calibration.learn(120_000_000, is_kept=False)
    assert calibration.interval(BEFORE) == (0, 120_000_000)


def test_what_is_always_the_same_leaves_no_width() -> None:
    kept, widths = drawn("one value")
    assert all(kept) and widths[-1] == 0


def test_where_nothing_is_left_out_it_is_all_that_was_seen_and_not_what_was_said_before() -> None:
    """Misses bring the level down to nothing; what was possible before anything was known says no more then."""
    calibration = Calibration()
    for number in range(40):
        calibration.learn(10_000_000 + number, is_kept=False)
    assert calibration.interval(BEFORE) == (10_000_000, 10_000_039)
