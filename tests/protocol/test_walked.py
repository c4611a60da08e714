"""What docs/protocol.md draws of states that the code keeps without a table is what the code does."""

import pytest

from tests.protocol.walked import PRESENCE, SYNC, TOKEN, Walk, Walker, spoken

WALKS = [("token", walk) for walk in TOKEN] + [("other", walk) for walk in PRESENCE] + [("sync", walk) for walk in SYNC]


@pytest.mark.parametrize(
    ("which", "walk"), WALKS, ids=lambda one: f"{one.state}: {one.event}" if isinstance(one, Walk) else one
)
def test_an_arrow_of_the_page_is_what_the_code_does(which: str, walk: Walk) -> None:
    walker = Walker()
    for step in walk.before:
        step(walker)
    assert getattr(walker, which) == walk.state
    effects = walk.step(walker)
    assert (getattr(walker, which), spoken(effects)) == (walk.following, walk.said)
