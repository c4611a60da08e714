"""What a person can do on the page of a system to whose desks orders come: one more of the site's own."""

from collections.abc import Mapping, Sequence
from typing import Any

from bus_sim.web.run_source import Arguments, RunSource


def let_order(source: RunSource, counters: Mapping[int, Any], wanted: Sequence[object]) -> RunSource:
    """Give the page the command ``order``: one of ``wanted`` once more, drawn by chance, at a counter drawn so.

    A counter has ``add`` for an order and ``entries``, those that came to it.
    """

    def order(_: Arguments) -> str:
        desk = source.chance.choice(sorted(counters))
        counters[desk].add(source.chance.choice(wanted))
        return f"order {len(counters[desk].entries)} comes to {source.picture.view.name(desk)}"

    if wanted:
        source.acts["order"] = order
    return source
