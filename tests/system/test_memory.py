"""Who runs for years keeps no more after the hundredth car than after the tenth."""

import asyncio
import gc
from collections import Counter, deque
from typing import Any

import pytest

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay

#: When all that is bounded has reached its bound, and how long it goes on then; cars come every so often.
FULL_S, GOES_ON_S, CAR_S = 2_000, 2_400, 150
#: Entries by which a container may differ between two moments, whatever is just going on.
SLACK = 10
#: What a run of the simulator keeps of every car for its own figures, some bytes each; of events the last 10,000.
FIGURES = {
    "CarParkWorld.cars",
    "CarParkWorld.where",
    "CompartmentPlant.tickets_printed",
    "EventLog.lines",
    "NegotiationCounts.fetched_us",
    "NegotiationCounts.parked_us",
    "NegotiationCounts.slack_ms",
    "Oracle._where",
    "Street._by_ticket",
    "VisitLog._carried_us",
    "VisitLog._seen",
}


def _sizes() -> Counter[str]:
    """How much the containers of all objects of the program hold, by class and attribute."""
    gc.collect()
    found: Counter[str] = Counter()
    for one in gc.get_objects():
        kind = type(one)
        # Other people's classes may call anything their module.
        if isinstance(one, type) or not str(kind.__module__).startswith(("onboard.", "bus_sim.")):
            continue
        for name, value in _attributes(one):
            is_bounded = isinstance(value, deque) and value.maxlen is not None
            if isinstance(value, dict | list | set | deque) and not is_bounded:
                found[f"{kind.__name__}.{name}"] += len(value)
    return found


def _attributes(one: object) -> list[tuple[str, Any]]:
    slots = (name for kind in type(one).__mro__ for name in vars(kind).get("__slots__", ()))
    found = [(name, getattr(one, name, None)) for name in slots if name != "__dict__"]
    return found + list(getattr(one, "__dict__", {}).items())


def test_nobody_keeps_more_with_every_car(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("onboard.ways.cars.MAX_GONE_CARS", 2)
    monkeypatch.setattr("onboard.history.history.CALL_LIMIT", 8)
    monkeypatch.setattr("onboard.history.history.TASK_LIMIT", 8)
    sizes: list[Counter[str]] = []

    def watched(run: object) -> None:
        for moment_s in (FULL_S, FULL_S + GOES_ON_S):
            asyncio.get_event_loop().call_later(moment_s, lambda: sizes.append(_sizes()))

    end_s = FULL_S + GOES_ON_S + 1
    demand = ParkingDay(random_s=(CAR_S, 10), cars=end_s // CAR_S + 10)
    play(find_site("level1"), RunOptions(demand=demand, limit_s=end_s), watched)
    before, after = sizes
    grown = {name: (before[name], after[name]) for name in after if after[name] - before[name] > SLACK}
    assert grown.keys() <= FIGURES, grown
    assert after["TokenBook.gifts"] > 0, "rights were given, and remembered while they mattered"
