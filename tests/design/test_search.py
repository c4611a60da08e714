"""The search for the fewest machines, its table and its picture, with a plant that is the model, only slower."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import pytest

from bus_sim.sites import site_text
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.design.days import DayPlan, Days
from bus_sim.systems.car_park.design.measure import Outcome, modelled
from bus_sim.systems.car_park.design.options import Size
from bus_sim.systems.car_park.design.picture import draw
from bus_sim.systems.car_park.design.search import Design, DesignTarget, Search
from bus_sim.systems.car_park.design.table import lines, to_json
from onboard.trace.durations import Durations

SVG = "{http://www.w3.org/2000/svg}"


def longer(waits: Durations, times: float) -> Durations:
    return replace(waits, mean_s=waits.mean_s * times, p95_s=waits.p95_s * times)


class SlowPlant:
    """Plays everything in the model; what is asked of the plant waits so many times as long, faults included."""

    def __init__(self, times: float = 1.0, faults: tuple[str, ...] = ()) -> None:
        self._times, self._faults = times, faults
        self.played: list[tuple[Size, str]] = []

    def __call__(self, what: str, function: Callable[[Any], Any], items: Sequence[Any], /) -> Iterator[Any]:
        if what != "plant":
            yield from map(function, items)
            return
        for item in items:
            found: Outcome = modelled(item)
            self.played.append((item.size, item.day.label))
            waits = longer(found.wait_in, self._times), longer(found.wait_out, self._times)
            yield found._replace(wait_in=waits[0], wait_out=waits[1], faults=self._faults)


def day(number: int) -> DayPlan:
    return DayPlan(f"2024-05-0{number}", Demand.by_mean(90, 30, number, count=8), number)


def search(engine: SlowPlant, target: DesignTarget, *, unseen: int = 0) -> Search:
    days = Days([day(1), day(2), day(3)], [day(number) for number in range(4, 4 + unseen)], [])
    ranges = (range(1, 3), range(1, 2), range(1, 4))
    # Where any bay may have to be fetched for, waits and machines differ most.
    text = site_text("small") + '\n[negotiation]\ndesk = "any"\n'
    return Search(text, "small.toml", ranges, (1.0, 1.0, 1.0), target, days, engine)


def found_by(engine: SlowPlant, p95_s: float, *, unseen: int = 0) -> Design:
    return search(engine, DesignTarget(p95_s), unseen=unseen).run()


@pytest.fixture(scope="module")
def design() -> Design:
    """The search where the plant is as the model."""
    return found_by(SlowPlant(), 240.0, unseen=2)


def winner(found: Design) -> Size:
    assert found.winner is not None
    return found.winner.size


def test_the_fewest_machines_that_keep_the_target_win(design: Design) -> None:
    """Whoever is cheaper does not keep it, by the same model."""
    size = winner(design)
    for one in design.judged:
        if sum(one.size) < sum(size):
            assert not one.keeps(design.target, 1.0), one.size
    assert design.winner is not None and design.winner.keeps(design.target, 1.0)
    assert [sum(one.size) for one in design.judged] == sorted(sum(one.size) for one in design.judged)


def test_a_tighter_target_takes_more_machines(design: Design) -> None:
    tight = search(SlowPlant(), DesignTarget(165.0)).run(has_plant=False)
    assert sum(winner(tight)) > sum(winner(design))


def test_a_machine_that_costs_little_is_taken_first() -> None:
    asked = search(SlowPlant(), DesignTarget(170.0, fill_h=1.35))
    asked.prices = (1.0, 1.0, 10.0)
    assert winner(asked.run(has_plant=False)) == Size(2, 1, 2)
    asked.prices = (10.0, 1.0, 1.0)
    assert winner(asked.run(has_plant=False)) == Size(1, 1, 3)


def test_where_the_plant_waits_longer_the_search_goes_on(design: Design) -> None:
    plant = SlowPlant(times=1.45)
    slower = found_by(plant, 240.0)
    assert slower.factor == pytest.approx(1.45)
    assert plant.played[0][0] == winner(design), "first the winner of the model alone"
    assert sum(winner(slower)) > sum(winner(design))
    assert any("1.45 times" in line for line in lines(slower))


def test_a_site_that_breaks_an_invariant_in_the_plant_wins_nothing() -> None:
    found = found_by(SlowPlant(faults=("two cars at one place",)), 300.0)
    assert found.winner is None
    assert any("FAULT two cars at one place" in line for line in lines(found))
    assert lines(found)[-1].startswith("none keeps")


def test_neighbours_and_days_that_were_kept_back_are_played(design: Design) -> None:
    size = winner(design)
    beside = {one.size for one in design.judged if sum(abs(a - b) for a, b in zip(one.size, size, strict=True)) == 1}
    assert beside and {one.size for one in design.judged if one.in_plant} == {size, *beside}
    assert [one.label for one in design.unseen] == ["2024-05-04", "2024-05-05"]
    assert design.plant_overload is not None and design.plant_fill is None


def test_filling_and_emptying_is_part_of_the_target(design: Design) -> None:
    quick = search(SlowPlant(), DesignTarget(240.0, fill_h=1.0)).run()
    assert quick.winner is not None and quick.winner.filled.fill_h <= 1.0
    assert sum(winner(quick)) > sum(winner(design))
    assert quick.plant_fill is not None
    assert any(line.startswith("plant: filled in") for line in lines(quick))


def test_the_bottleneck_is_what_brings_most(design: Design) -> None:
    found = design.bottleneck
    assert found is not None
    assert found.gains[found.kind] == max(gain for gain in found.gains.values() if gain is not None)
    assert set(found.gains) == set(found.busy) == {"robots", "lifts", "compartments"}
    assert all(0 <= share <= 1.2 for share in found.busy.values())


def test_the_table_has_a_row_for_each_option_and_marks_the_winner(design: Design) -> None:
    text = lines(design)
    rows = text[1 : 1 + len(design.judged)]
    marked = [row for row in rows if row.endswith("<- fewest")]
    assert len(marked) == 1 and marked[0].split()[:3] == [str(count) for count in winner(design)]
    assert all("+-" in row and " of 3" in row for row in rows)
    (bottleneck,) = (line for line in text if line.startswith("bottleneck: "))
    assert design.bottleneck is not None and design.bottleneck.kind in bottleneck
    assert any("kept on 2 of 2" in line for line in text)
    told = json.loads(json.dumps(to_json(design)))
    assert told["winner"] == winner(design)._asdict() and told["unseen_kept"] == 2
    assert len(told["options"]) == len(design.judged) == 6


def test_the_picture_has_each_value_and_names_the_winner(design: Design) -> None:
    root = ElementTree.fromstring(str(draw(design, "small")))  # drawn by ourselves
    words = [one.text or "" for one in root.iter(f"{SVG}text")]
    assert any(str(winner(design)) in text for text in words)
    assert {"robots", "lifts", "compartments", "95 % wait of a day, s", "cars an hour under overload"} <= set(words)
    size = winner(design)
    along = [
        one
        for column in range(3)
        for one in design.judged
        if all(one.size[other] == size[other] for other in range(3) if other != column)
    ]
    rings = [one for one in root.iter(f"{SVG}circle") if one.get("r") == "4.0"]
    waits = sum(len(one.in_plant) for one in along)
    assert len(rings) == 1 + waits + 3, "the legend's, each wait, and the winner's overload in three panels"
    dots = [one for one in root.iter(f"{SVG}circle") if one.get("r") == "1.5"]
    assert len(dots) == 2 * len(along)


def test_nothing_is_drawn_without_a_winner() -> None:
    found = search(SlowPlant(), DesignTarget(1.0)).run(has_plant=False)
    with pytest.raises(ValueError, match="without a winner"):
        draw(found, "small")
