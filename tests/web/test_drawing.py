"""The picture in a real browser: one name for one thing, who has failed, plans along the ways, local time."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.thinned import some
from tests.web.browser import drawn, row_of, rows, served
from tests.web.logs import log_of

#: Moments of a log, in the slider's thousandths.
MOMENTS = some(range(80, 1000, 80), 6)


def at(page: Page, moment: int) -> None:
    """Move the slider of a log that is paused, and wait until the page shows that moment."""
    before = page.locator("#clock").get_attribute("data-us")
    page.locator("#slider input").evaluate(
        "(slider, to) => { slider.value = to; slider.dispatchEvent(new Event('input')); }", moment
    )
    expect(page.locator("#clock")).not_to_have_attribute("data-us", str(before))


def paused(page: Page, address: str) -> None:
    page.goto(address)
    expect(page.locator("#machines tbody tr")).not_to_have_count(0)
    page.get_by_role("button", name="pause").click()
    expect(page.locator("#pace")).to_have_text("paused")


def test_names_are_unique_at_every_size_and_times_are_the_sites_own(
    browser: Page, errors: list[str], tmp_path: Path
) -> None:
    """Three compartments number their cars from 1 on; the run began at midnight UTC, which is afternoon at the site."""
    words = ["onboard", "web", str(log_of("standard")), "--site", "standard", "--web", "0"]
    shown = 0
    with served(words, tmp_path) as address:
        paused(browser, address)
        at(browser, 1000)
        expect(browser.locator("#clock")).to_have_text("16:07:08")
        for width in (1600, 1280, 900, 600, 390):
            browser.set_viewport_size({"width": width, "height": 800})
            names = [box["name"] for what in ("place", "machine") for box in drawn(browser, what).values()]
            counts = Counter(name for name in names if name is not None)
            assert [name for name, count in counts.items() if count > 1] == [], width
            shown += len(counts)
    assert shown > 40, "names are there where there is room for them"
    assert not errors


def test_plans_go_along_the_ways(browser: Page, errors: list[str], tmp_path: Path) -> None:
    words = ["onboard", "web", str(log_of("standard")), "--site", "standard", "--web", "0"]
    corners = 0
    with served(words, tmp_path) as address:
        browser.set_viewport_size({"width": 1280, "height": 800})
        paused(browser, address)
        for moment in MOMENTS:
            at(browser, moment)
            drawn(browser, "machine")
            ways: list[dict[str, Any]] = browser.evaluate("document.querySelector('#picture').ways")
            for way in ways:
                corners += len(way["points"]) - 2
                for (x0, y0), (x1, y1) in zip(way["points"], way["points"][1:], strict=False):
                    assert x0 == pytest.approx(x1) or y0 == pytest.approx(y1), f"across at {moment}: {way}"
    assert corners > 0, "somebody rides"
    assert not errors


def test_every_machine_of_a_building_has_its_name_and_every_lift_its_doors(
    browser: Page, errors: list[str], tmp_path: Path
) -> None:
    """Where there is no room within a machine its name is beside it, on no machine and on no other name."""
    words = ["onboard", "web", str(log_of("twin")), "--site", "twin", "--web", "0"]
    with served(words, tmp_path) as address:
        paused(browser, address)
        at(browser, 1000)
        is_beside = []
        for width in (1600, 700):
            browser.set_viewport_size({"width": width, "height": 800})
            drawn(browser, "machine")
            boxes: list[dict[str, Any]] = browser.evaluate("document.querySelector('#picture').drawn")
            machines = [box for box in boxes if box["what"] == "machine"]
            assert sorted(box["name"] for box in machines) == ["ER1", "ER2", "In", "MR1", "MR2", "Out"]
            beside = [box["beside"] for box in machines if box.get("beside") is not None]
            for number, one in enumerate(beside):
                assert not any(meet(one, other) for other in [*beside[number + 1 :], *machines])
            is_beside.append(len(beside))
            assert sum(box["what"] == "door" for box in boxes) == 3 * 2 * 2
            assert {box["id"]: box["use"] for box in machines if "use" in box} == {1: "entry", 2: "exit"}
        assert is_beside[0] < is_beside[1]
        inner = browser.evaluate(
            """async () => (await import("./paint.js"))
                .load({ fillRect() {} }, { x: 0, y: 0, w: 40, h: 20 })"""
        )
        assert 0 < inner["x"] < inner["x"] + inner["w"] < 40, "what is written on a load is within it"
        marks = browser.evaluate(
            """async () => [...(await import("./draw.js")).marksOf(
                { classes: { 1: "small", 2: "short", 3: "plug" }, charging: [3] })]"""
        )
        assert dict(marks) == {"small": "sm", "short": "sh", "plug": "\u26a1"}
    assert not errors


def meet(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(one[a] < other[a] + other[b] and other[a] < one[a] + one[b] for a, b in ("xw", "yh"))


@pytest.mark.parametrize(
    ("site", "machines", "boxes"), [("small", ["IOC1", "ER1", "MR1"], ["1", "5", "11"]), ("turning", ["L1"], None)]
)
def test_who_has_failed_is_crossed_out(
    site: str, machines: list[str], boxes: list[str] | None, browser: Page, errors: list[str], tmp_path: Path
) -> None:
    words = ["bus_sim.cli", "run", site, "--speed", "10", "--web", "0", "--trace", "t.log"]
    with served(words, tmp_path) as address:
        browser.set_viewport_size({"width": 1280, "height": 800})
        browser.goto(address)
        expect(browser.locator("#machines tbody tr")).not_to_have_count(0)
        for machine in machines:
            expect(row_of(browser, machine)).not_to_contain_text("silent")
        assert not any(box.get("isCrossed") for box in drawn(browser, "machine").values())
        for machine in machines:
            browser.select_option("#trouble select", machine)
            browser.get_by_role("button", name="break").click()
            expect(row_of(browser, machine)).to_contain_text("silent")
        crossed = {name for name, box in drawn(browser, "machine").items() if box.get("isCrossed")}
        silent = {row[0] for row in rows(browser, "machines") if row[1] in ("silent", "stopped")}
        assert len(crossed) == len(silent) >= len(machines)
        assert boxes is None or crossed >= set(boxes)
        if boxes is not None:
            # A cross lies on no name: the robot's and the compartment's are beside them, the lift's over its shaft.
            found = drawn(browser, "machine")
            assert [found[box]["name"] for box in boxes] == machines
            assert all(found[box].get("beside") for box in ("1", "11"))
    assert not errors
