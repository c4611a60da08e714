"""Where a machine may stand for ever."""

from onboard.config.site import parse_site
from onboard.core.refuges import refuges
from onboard.core.site import Segment
from tests.config.support import TWO_FLOORS
from tests.sites import one_floor


def test_on_one_floor_everywhere_but_before_the_compartment() -> None:
    assert refuges(one_floor()) == {Segment(1, index) for index in range(1, 13) if index != 4}


def test_neither_sills_nor_platforms_nor_the_mouth_of_a_spur_but_the_spur() -> None:
    first = {Segment(1, index) for index in (2, 3, 5, 6, 7)}
    second = {Segment(2, index) for index in (2, 3, 4, 6, 7)}
    assert refuges(parse_site(TWO_FLOORS, "two.toml")) == first | second | {Segment(192, 1)}
