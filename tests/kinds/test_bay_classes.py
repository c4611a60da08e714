"""A compartment lets a car in under its class: what the driver is told, for whom it calls, and what a restart knows."""

from collections.abc import Iterable
from dataclasses import replace

import pytest

from onboard.contract.codes import DeskInput, DeskText, DoorPosition, LightColour, OperatorAction
from onboard.contract.messages import (
    BayState,
    CallForProposals,
    CarAt,
    DeskEvent,
    DeskOrder,
    DoorState,
    Message,
    OperatorOrder,
    Reference,
)
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.journal_records import Entry
from onboard.holon.holon import Holon
from onboard.systems.car_park.site import CarPark, SizeClass, open_end
from onboard.systems.registry import factory_for
from tests.sites import one_floor

BAY = 1
SMALL = SizeClass("small", 4_300, 1_550, 2_000, max_width_mm=1_700)
NORMAL = SizeClass("normal", 5_000, 1_800, 2_500, max_width_mm=1_900)
PLUG = SizeClass("plug", 5_000, 1_800, 2_500, charging=True, max_width_mm=1_900)


def park() -> CarPark:
    """Two places for small cars, one for normal ones, one to charge; no place takes more."""
    site = one_floor(positions=5)
    numbers = [1, 1, 2, 3]
    places = site.places[:4]
    of_place = {place.number: number for place, number in zip(places, numbers, strict=True)}
    return replace(site, classes=(SMALL, NORMAL, PLUG), places=places, place_class=of_place)


SITE = park()
SMALL_CAR = (1_200, 4_000, 1_500, 2_500, 1_650)
NORMAL_CAR = (1_500, 4_500, 1_500, 2_700, 1_800)


def bay_with(car: tuple[int, int, int, int, int], entries: Iterable[Entry] = ()) -> Holon:
    """A compartment with a car in it: weight in kg, length, height, wheelbase and width in mm."""
    past: list[Entry] = [{"record": "boot", "boot": 1}, *entries] if entries else []
    made = Holon(
        SITE, SITE.machines[BAY], factory_for(SITE, SITE.machines[BAY].kind), boot=len(past[:1]) + 1, entries=past
    )
    made.start(0)
    made.tokens.trust()
    made.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), 10)
    made.sense(sensed(car), 20)
    return made


def sensed(car: tuple[int, int, int, int, int]) -> BayState:
    load_kg, length_mm, height_mm, wheelbase_mm, width_mm = car
    return BayState(BAY, load_kg, length_mm, height_mm, wheelbase_mm, False, False, width_mm)


def press(bay: Holon, key: DeskInput) -> list[Effect]:
    return bay.sense(DeskEvent(BAY, 1, key, Reference(0, 0)), 30)


def told(effects: list[Effect]) -> list[DeskText]:
    orders = [one.message for one in effects if isinstance(one, Tell)]
    return [one.text for one in orders if isinstance(one, DeskOrder)]


def called(effects: list[Effect]) -> list[int]:
    said: list[Message] = [one.message for one in effects if isinstance(one, Send)]
    return [one.to_station for one in said if isinstance(one, CallForProposals)]


def fill(bay: Holon, *places: int) -> None:
    """Other cars stand in these places, by their number in the site's order."""
    for number in places:
        car = Reference(200, number + 1)
        bay.receive(CarAt(11, car, SITE.places[number].number, 1, 2_600), 25)


@pytest.mark.parametrize(
    ("car", "key", "end"),
    [
        (SMALL_CAR, DeskInput.KEY, open_end(1)),
        (NORMAL_CAR, DeskInput.KEY, open_end(2)),
        ((1_200, 4_000, 1_500, 2_500, 1_750), DeskInput.KEY, open_end(2)),
        (NORMAL_CAR, DeskInput.CHARGING_KEY, open_end(3)),
        (SMALL_CAR, DeskInput.CHARGING_KEY, open_end(3)),
    ],
    ids=["small", "normal", "too wide for small", "normal, to charge", "small, to charge"],
)
def test_a_car_is_called_for_under_its_class(car: tuple[int, int, int, int, int], key: DeskInput, end: int) -> None:
    effects = press(bay_with(car), key)
    assert told(effects) == [DeskText.TAKE_TICKET]
    assert called(effects) == [end]


@pytest.mark.parametrize(
    "car",
    [
        (1_500, 5_100, 1_500, 2_700, 1_800),
        (1_500, 4_500, 1_900, 2_700, 1_800),
        (2_600, 4_500, 1_500, 2_700, 1_800),
        (1_500, 4_500, 1_500, 2_700, 1_950),
    ],
    ids=["long", "high", "heavy", "wide"],
)
@pytest.mark.parametrize("key", [DeskInput.KEY, DeskInput.CHARGING_KEY], ids=["plain", "to charge"])
def test_a_car_that_the_park_takes_and_no_place_does_is_too_large(
    car: tuple[int, int, int, int, int], key: DeskInput
) -> None:
    effects = press(bay_with(car), key)
    assert told(effects) == [DeskText.CAR_TOO_LARGE]
    assert called(effects) == []


def test_full_is_full_for_the_class_and_who_charges_is_told_that_it_is_that() -> None:
    bay = bay_with(NORMAL_CAR)
    # The place to charge takes others at last.
    fill(bay, 2)
    assert told(press(bay, DeskInput.KEY)) == [DeskText.TAKE_TICKET]
    bay = bay_with(NORMAL_CAR)
    fill(bay, 2, 3)
    assert told(press(bay, DeskInput.KEY)) == [DeskText.FULL]
    small = bay_with(SMALL_CAR)
    fill(small, 2, 3)
    assert told(press(small, DeskInput.KEY)) == [DeskText.TAKE_TICKET]
    for car in (SMALL_CAR, NORMAL_CAR):
        bay = bay_with(car)
        fill(bay, 3)
        assert told(press(bay, DeskInput.CHARGING_KEY)) == [DeskText.NO_CHARGING]


@pytest.mark.parametrize(
    ("actions", "end"),
    [
        ([OperatorAction.PRESS_KEY], open_end(2)),
        ([OperatorAction.CHARGING_KEY], open_end(3)),
        ([OperatorAction.PRESS_KEY, OperatorAction.CHARGING_KEY], open_end(3)),
        ([OperatorAction.CHARGING_KEY, OperatorAction.PRESS_KEY], open_end(2)),
    ],
    ids=["plain", "to charge", "to charge after all", "not to charge after all"],
)
def test_both_keys_can_be_pressed_from_afar_and_the_last_one_counts(actions: list[OperatorAction], end: int) -> None:
    bay, effects = bay_with(NORMAL_CAR), list[Effect]()
    bay.sense(DoorState(BAY, DoorPosition.CLOSING, DoorPosition.LOCKED, LightColour.GREEN), 22)
    for action in actions:
        effects += bay.receive(OperatorOrder(251, BAY, action, Reference(0, 0)), 25)
    effects += bay.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), 30)
    assert told(effects) == [DeskText.TAKE_TICKET]
    assert called(effects) == [end]


def test_who_charges_where_one_cannot_is_told_so() -> None:
    site = replace(SITE, classes=(SMALL, NORMAL, NORMAL))
    made = Holon(site, site.machines[BAY], factory_for(site, site.machines[BAY].kind), boot=1)
    made.start(0)
    made.tokens.trust()
    made.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), 10)
    made.sense(sensed(NORMAL_CAR), 20)
    assert told(press(made, DeskInput.CHARGING_KEY)) == [DeskText.NO_CHARGING]


def test_after_a_restart_it_is_called_for_under_the_class_that_it_came_in_with() -> None:
    first = press(bay_with(NORMAL_CAR), DeskInput.CHARGING_KEY)
    written = [dict(one.entry) for one in first if isinstance(one, Record)]
    again = bay_with(NORMAL_CAR, written)
    found: list[int] = []
    for now_us in range(100_000, 10_000_000, 100_000):
        again.sense(DoorState(BAY, DoorPosition.LOCKED, DoorPosition.LOCKED, LightColour.RED), now_us)
        found += called(again.sense(sensed(NORMAL_CAR), now_us)) + called(again.wake(now_us))
    assert set(found) == {open_end(3)}
