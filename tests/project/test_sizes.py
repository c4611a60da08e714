"""Each system has tests of its own, or shared ones that play it, of at least half its size."""

from tests.sizes import LEAST, sizes


def test_each_system_has_tests_of_at_least_half_its_size() -> None:
    found = sizes()
    assert len(found) == 6
    assert [f"{one.system}: {one.share:.3f}" for one in found if one.share < LEAST] == []
