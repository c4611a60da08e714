"""What the oracle says of a lobby of one segment: its mouth at one end, a lift's platform at the other."""

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.plant.motion import standing
from bus_sim.systems.car_park.plant.mouth_rules import MouthRules
from bus_sim.systems.car_park.plant.rules import MotionSpan
from onboard.core.site import Segment
from onboard.systems.car_park.site import car_park

SITE = car_park(find_site("changi"))
LOBBY = 11
MOUTH, INSIDE, ABOARD = (Segment(LOBBY, index) for index in (0, 1, 2))


@pytest.mark.parametrize(("where", "found"), [(INSIDE, ["BODIES_APART"]), (MOUTH, ["BODIES_APART"]), (ABOARD, [])])
def test_who_turns_into_a_lobby_is_in_the_way_of_who_is_in_it_not_of_who_comes_by_its_lift(
    where: Segment, found: list[str]
) -> None:
    assert SITE.tracks[LOBBY].length == 1 and ABOARD in SITE.platforms
    turns = MotionSpan(LOBBY, standing(SITE.position_mm(MOUTH), 0), 0, SITE.tracks[LOBBY].joins[0].track)
    stands = MotionSpan(LOBBY, standing(SITE.position_mm(where), 0), 0)
    broken = MouthRules(SITE).judge_pair((11, 12), turns, stands, 1_000_000)
    assert [one.rule.name for one in broken][: len(found) or None] == found
