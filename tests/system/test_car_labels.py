"""Cars in the terminal's picture can be told apart, whichever compartment gave them their number."""

import io
import re
from collections import Counter
from datetime import UTC, datetime

import pytest
from rich.console import Console

from bus_sim.sites import find_site
from bus_sim.systems.car_park.car_labels import UNNAMED, bay_letters, car_labels
from bus_sim.systems.car_park.show import DayClock, draw
from onboard.contract.base import Reference
from onboard.contract.messages import CarAt
from onboard.systems.car_park.site import car_park
from onboard.trace.view import SiteView


def drawn(name: str, width: int, numbers: tuple[int, ...]) -> tuple[list[str], list[str]]:
    """Legend and marks of cars in the picture, where each compartment has given these numbers out."""
    site = car_park(find_site(name))
    view = SiteView(site)
    places = iter(place.number for place in sorted(site.places))
    for bay in site.compartments:
        for number in numbers:
            view.feed(CarAt(bay, Reference(bay, number), next(places), 1, 2500), 1_000_000)
    console = Console(width=width, file=io.StringIO())
    with console.capture() as printed:
        console.print(draw(site, view, DayClock(datetime.fromtimestamp(0, UTC)), "", width))
    head, *rows = printed.get().split("-- on the bus")[0].splitlines()
    floors = " ".join(row[4:] for row in rows if row[3:4] in ("F", "N"))
    return head.split(), re.findall(r"[a-z]?\d+", floors)


@pytest.mark.parametrize("name", ["small", "standard", "large"])
@pytest.mark.parametrize("width", [80, 120, 160])
def test_no_two_cars_have_the_same_name(name: str, width: int) -> None:
    _, marks = drawn(name, width, (1, 2, 13))
    assert marks and [mark for mark, times in Counter(marks).items() if times > 1] == []


def test_the_head_says_whose_letter_it_is() -> None:
    head, marks = drawn("standard", 80, (1, 2))
    assert head[3:9] == ["a", "IOC1", "b", "IOC2", "c", "IOC3"]
    assert sorted(marks) == ["a1", "a2", "b1", "b2", "c1", "c2"]


def test_names_that_do_not_fit_are_left_out_together() -> None:
    letters = bay_letters([7, 3])
    assert letters == {3: "a", 7: "b"}
    one, other, third = Reference(3, 15), Reference(3, 115), Reference(7, 15)
    assert car_labels([one, other, third], letters, 3) == {one: UNNAMED, other: UNNAMED, third: "b15"}
    assert set(car_labels([one, third], letters, 1).values()) == {UNNAMED}
    assert bay_letters([3]) == {} and car_labels([one, other], {}, 3) == {one: "15", other: "115"}
