"""Who says that it goes somewhere, and stands."""

from onboard.core.codes import Grade, LegAction, Side
from onboard.core.messages import Itinerary, Leg, Progress, Stamp
from onboard.core.mirror import Mirror
from onboard.core.standing import STANDS_AFTER_US, Standing
from tests.sites import one_floor

SITE = one_floor(2)
STEWARD, ROBOT = 1, 11
#: Where the robot works, from 10 s to 40 s of its plan, after it has driven there and before it drives on.
LEGS = (
    Leg(LegAction.TRAVEL, 1, 2, 5, Side.NEAR, 10_000),
    Leg(LegAction.WORK, 1, 5, 5, Side.NEAR, 40_000),
    Leg(LegAction.TRAVEL, 1, 5, 9, Side.NEAR, 50_000),
)


def watched() -> Standing:
    mirror = Mirror(SITE, STEWARD)
    mirror.on_itinerary(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(0, STEWARD, 1), LEGS), 0)
    standing = Standing(SITE, mirror)
    standing.hear(Progress(ROBOT, 1, 0, 1, 5, 0, 0), 10_000_000)
    return standing


def test_who_works_where_its_plan_has_it_work_does_not_stand_in_the_way() -> None:
    standing = watched()
    assert not any(standing.stands(ROBOT, second * 1_000_000) for second in range(10, 50))


def test_who_does_not_go_on_as_its_plan_says_stands_in_the_way() -> None:
    standing = watched()
    assert standing.stands(ROBOT, 50_000_000 + STANDS_AFTER_US)


def test_only_motion_ends_it() -> None:
    standing = watched()
    assert standing.stands(ROBOT, 50_000_000 + STANDS_AFTER_US)
    standing.hear(Progress(ROBOT, 1, 2, 1, 6, 0, 500), 71_000_000)
    assert not standing.stands(ROBOT, 72_000_000)
