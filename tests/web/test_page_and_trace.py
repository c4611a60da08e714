"""What the page shows of a recorded log, moment by moment, is what the log says: read here by a decoder of its own."""

from dataclasses import dataclass, field
from math import floor
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from bus_sim.sites import find_site
from onboard.contract.codes import TaskPhase
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import Award, Bid, CallForProposals, CarAt, Progress, Reference, TaskReport
from onboard.core.site import Segment
from onboard.systems.car_park.site import car_park
from onboard.ways.lifts import lift_at
from tests.web.browser import drawn, rows, served
from tests.web.logs import SITE_FILES, film_of, log_of, said_in

SITE = car_park(find_site("small"))
#: Shares of the log's length, in thousandths: a car comes, is parked, asked for, fetched; and back to an earlier one.
MOMENTS = (120, 300, 480, 620, 800, 990, 300)
ROBOTS = {11: "MR1", 12: "MR2"}


@dataclass
class Told:
    """What the fleet bus had said by a moment."""

    places: dict[int, Progress] = field(default_factory=dict)
    cars: dict[Reference, CarAt] = field(default_factory=dict)
    calls: dict[tuple[int, int], CallForProposals] = field(default_factory=dict)
    bids: int = 0
    won: set[tuple[int, int]] = field(default_factory=set)
    phases: dict[Reference, TaskPhase] = field(default_factory=dict)


def told_by(time_us: int) -> Told:
    """Everything up to a moment."""
    told = Told()
    for at_us, is_fleet, one in said_in("small"):
        if not is_fleet or at_us > time_us:
            continue
        match one:
            case Progress():
                told.places[one.sender] = one
            case CarAt():
                told.cars[one.car] = one
            case CallForProposals():
                told.calls[one.sender, one.call] = one
                told.phases.setdefault(one.task, TaskPhase.OPEN)
            case Bid():
                told.bids += 1
            case Award():
                told.won.add((one.sender, one.call))
            case TaskReport():
                told.phases[one.task] = one.phase
    return told


def test_positions_cars_calls_and_customers_are_those_of_the_log(
    browser: Page, errors: list[str], tmp_path: Path
) -> None:
    with film_of("small") as film:
        first_us, last_us = film.first_us, film.last_us
    words = ["onboard", "web", str(log_of("small")), "--site", str(SITE_FILES / "small.toml"), "--web", "0"]
    with served(words, tmp_path) as address:
        browser.goto(address)
        expect(browser.locator("#mode")).to_have_text("log")
        browser.keyboard.press("Space")
        expect(browser.locator("#pace")).to_have_text("paused")
        slider = browser.locator("#slider input")
        for share in MOMENTS:
            slider.evaluate("(one, share) => { one.value = share; one.dispatchEvent(new Event('input')); }", share)
            # As the page rounds: a half goes up.
            time_us = floor(first_us + (last_us - first_us) * share / 1000 + 0.5)
            expect(browser.locator("#clock")).to_have_attribute("data-us", str(time_us))
            _compare(browser, told_by(time_us))
    assert not errors


def _compare(page: Page, told: Told) -> None:
    shown = {row[0]: row for row in rows(page, "machines")}
    for node, name in ROBOTS.items():
        at = told.places.get(node)
        where = Segment(at.track, at.index) if at is not None else SITE.machines[node].home
        lift = lift_at(SITE, where)
        assert shown[name][2] == (str(where) if lift is None else f"in {SITE.machines[SITE.stewards[lift]].name}")
        aboard = [one.car for one in told.cars.values() if one.station == ANY_STATION and one.sender == node]
        assert shown[name][3] == "".join(_name(car) for car in aboard)
    standing = {one.station: one.car for one in told.cars.values() if one.station not in (ANY_STATION, OUTSIDE)}
    bays = {station.number: node for node, station in SITE.compartments.items()}
    boxes = {int(number): box for number, box in drawn(page, "place").items()}
    drawn_cars = {number: box["car"] for number, box in boxes.items() if box.get("car")}
    assert drawn_cars == {n: _name(car) for n, car in standing.items() if n not in bays}
    waiting = {_name(task) for task, phase in told.phases.items() if phase is not TaskPhase.DONE}
    assert {row[0] for row in rows(page, "tasks")} == waiting
    assert page.locator("#calls .call").count() == len(told.calls)
    assert page.locator("#calls .call:not(.won):not(.over)").count() == len(told.calls.keys() - told.won)
    assert page.locator("#calls .bid").count() == told.bids
    _robots_stand_where_they_say(page, told)


def _name(reference: Reference) -> str:
    return f"{SITE.machines[reference.origin].name}/{reference.number}"


def _robots_stand_where_they_say(page: Page, told: Told) -> None:
    """A robot's box covers its segment's middle, as far as it has not moved on since its last word."""
    segments, machines = drawn(page, "segment"), drawn(page, "machine")
    for node, progress in told.places.items():
        name = str(Segment(progress.track, progress.index))
        if node not in ROBOTS or name not in segments or progress.speed_mm_s:
            continue
        segment, robot = segments[name], machines[str(node)]
        pitch_mm = SITE.tracks[progress.track].pitch_mm
        middle = segment["x"] + segment["w"] * (0.5 + progress.offset_mm / pitch_mm)
        assert robot["x"] + robot["w"] / 2 == pytest.approx(middle, abs=1)
        assert segment["y"] - 1 <= robot["y"] + robot["h"] / 2 <= segment["y"] + segment["h"] + 1
