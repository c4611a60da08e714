"""What can be reached from the compartments, and what is cut off."""

import pytest

from onboard.config.site import parse_site
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.reach import hidden_by, passages, reached, stranded_by
from onboard.ways.site import WaySite

LIFT = '[[lifts]]\nname = "L{node}"\nnode = {node}\nend = "{end}"\nfloors = {floors}\n'


def tower(*lifts: tuple[str, list[int]], floors: int, at: str = "p(1,3)", home: str = "p(2,3)") -> CarPark:
    """Alleys of five positions with lifts on nodes 5.., one compartment and one robot."""
    text = f'[site]\nname = "tower"\n[floors]\ncount = {floors}\npositions = 5\n'
    for node, (end, served) in enumerate(lifts, start=5):
        text += LIFT.format(node=node, end=end, floors=served)
    text += f'[[compartments]]\nname = "IOC1"\nnode = 1\nat = "{at}"\n'
    return car_park(parse_site(text + f'[[robots]]\nname = "MR1"\nnode = 11\nhome = "{home}"\n', "tower.toml"))


def places(site: WaySite, *floors: int) -> tuple[str, ...]:
    """All places of some floors, in the site's order."""
    return tuple(str(place) for place in site.places if place.track in floors)


BOTH = (("left", [1, 2, 3]), ("right", [1, 2, 3]))


def test_the_only_lift_strands_every_place_upstairs() -> None:
    site = tower(("left", [1, 2, 3]), floors=3)
    assert tuple(map(str, stranded_by(site, 128))) == places(site, 2, 3)


def test_with_a_lift_at_each_end_the_loss_of_either_strands_nothing() -> None:
    site = tower(*BOTH, floors=3)
    assert stranded_by(site, 128) == stranded_by(site, 129) == ()


def test_what_only_one_shaft_serves_is_stranded_by_that_one_alone() -> None:
    site = tower(("left", [1, 2, 3, 4]), ("right", [1, 2]), floors=4)
    assert tuple(map(str, stranded_by(site, 128))) == places(site, 3, 4)
    assert stranded_by(site, 129) == ()


def test_shafts_one_above_the_other_strand_all_that_lies_behind() -> None:
    site = tower(("left", [1, 2, 3]), ("right", [3, 4]), floors=4)
    assert tuple(map(str, stranded_by(site, 128))) == places(site, 2, 3, 4)
    assert tuple(map(str, stranded_by(site, 129))) == places(site, 4)


def test_a_compartment_on_each_side_of_a_lost_lift_keeps_both_sides() -> None:
    site = tower(("left", [1, 2]), floors=2, at="p(1,3)")
    text_site = car_park(
        parse_site(
            """
        site = {name = "s"}
        floors = {count = 2, positions = 5}
        lifts = [{name = "L", node = 5, end = "left"}]
        compartments = [{name = "A", node = 1, at = "p(1,3)"}, {name = "B", node = 2, at = "p(2,3)"}]
        robots = [{name = "R", node = 11, home = "p(2,2)"}]
        """,
            "s.toml",
        )
    )
    assert stranded_by(site, 128)
    assert not stranded_by(text_site, 128)


def test_a_spur_is_no_way_to_a_place_and_a_platform_no_segment() -> None:
    site = tower(*BOTH, floors=3)
    assert reached(site) == {Segment(floor, index) for floor in (1, 2, 3) for index in range(1, 6)}


def test_a_standing_machine_hides_what_is_behind_it_only_where_there_is_no_other_way_round() -> None:
    site, at = tower(*BOTH, floors=3), Segment(2, 3)
    assert [str(place) for place in hidden_by(site, [at])] == ["p(2,3)N", "p(2,3)F"]
    hidden = [str(place) for place in hidden_by(site, [at], lost=[129])]
    assert hidden == ["p(2,3)N", "p(2,4)N", "p(2,5)N", "p(2,3)F", "p(2,4)F", "p(2,5)F"]


def test_what_is_stranded_is_not_told_again_as_hidden() -> None:
    site = tower(("left", [1, 2, 3]), floors=3)
    assert hidden_by(site, [Segment(3, 2)], lost=[128]) == ()


@pytest.mark.parametrize(
    ("lifts", "floors", "found"),
    [
        (BOTH, 3, {1}),
        ((("left", [1, 2, 3]),), 3, {1}),
        ((("left", [1, 2, 3]), ("right", [3, 4])), 4, {1, 3}),
        ((("left", [1, 2, 3, 4]), ("right", [3, 4])), 4, {1}),
    ],
    ids=["two shafts", "one shaft", "one above the other", "one beside the other"],
)
def test_an_alley_is_a_passage_where_another_floor_cannot_be_reached_without_it(
    lifts: tuple[tuple[str, list[int]], ...], floors: int, found: set[int]
) -> None:
    assert passages(tower(*lifts, floors=floors)) == found
