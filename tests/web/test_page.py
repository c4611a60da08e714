"""The page in a real browser: what it is told happens, and what it says of its line is true (Debian's Chromium)."""

import signal
from pathlib import Path

from playwright.sync_api import Page, expect

from onboard.contract.codes import TaskPhase
from onboard.contract.messages import Blocked, CallForProposals, Clear, Message, TaskReport
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.web.browser import drawn, end, row_of, rows, served, start
from tests.web.logs import SITE_FILES, log_of


def test_a_simulated_site_is_shown_and_obeys(browser: Page, errors: list[str], tmp_path: Path) -> None:
    words = ["bus_sim.cli", "run", "small", "--by-hand", "--speed", "20", "--web", "0", "--trace", "trace.log"]
    process, address = start(words, tmp_path)
    try:
        browser.goto(address)
        expect(browser.locator("#link")).to_have_text("connected")
        expect(browser.locator("#machines tbody tr")).to_have_count(5)
        browser.get_by_role("button", name="car in", exact=True).click()
        expect(browser.locator("#answer")).to_have_text("by hand 1 comes in")
        expect(browser.locator("[data-figure=parked]")).to_have_text("1")
        browser.get_by_role("button", name="pause").click()
        expect(browser.locator("#pace")).to_have_text("paused")
        before = browser.locator("#clock").inner_text()
        row_of(browser, "MR1").click()
        expect(browser.locator("#details")).to_contain_text("MR1: robot, node 11")
        browser.set_viewport_size({"width": 360, "height": 740})
        assert browser.evaluate("document.documentElement.scrollWidth") <= 360
        browser.set_viewport_size({"width": 1280, "height": 800})
        assert browser.locator("#clock").inner_text() == before, "nothing moves while it is paused"
        browser.keyboard.press("Space")
        expect(browser.locator("#pace")).to_have_text("20 x")
        _break_and_block(browser)
        shown = browser.locator("[data-figure=parked]").inner_text(), browser.locator("#calls .call").count()
    finally:
        end(process)
    expect(browser.locator("#link")).to_have_text("connection lost, trying again")
    told = _said(tmp_path / "trace.log")
    reports = [one for one in told if isinstance(one, TaskReport) and one.sender in (11, 12)]
    assert shown[0] == str(len({one.task for one in reports if one.phase is TaskPhase.DONE}))
    assert shown[1] <= len({(one.sender, one.call) for one in told if isinstance(one, CallForProposals)})
    people = [one for one in told if isinstance(one, Blocked | Clear) and one.sender == 251]
    assert [(type(one), one.track, one.index) for one in people] == [(Blocked, 3, 4), (Clear, 3, 4)]
    assert not errors


def _break_and_block(page: Page) -> None:
    """Trouble that a person makes: a machine loses its power and starts again, a segment cannot be passed."""
    answer, place = page.locator("#answer"), page.locator("#trouble [name=place]")
    page.select_option("#trouble select", "MR2")
    page.get_by_role("button", name="break").click()
    expect(answer).to_have_text("MR2's controller has lost its power")
    expect(row_of(page, "MR2")).to_contain_text("silent")
    page.get_by_role("button", name="repair").click()
    expect(answer).to_have_text("MR2 starts again with its journal")
    spot = drawn(page, "segment")["p(3,4)"]
    page.locator("#picture").click(position={"x": spot["x"] + spot["w"] / 2, "y": spot["y"] + spot["h"] / 2})
    expect(place).to_have_value("p(3,4)")
    page.get_by_role("button", name="block", exact=True).click()
    expect(page.locator("#details")).to_contain_text("segment p(3,4): blocked")
    page.get_by_role("button", name="clear").click()
    expect(page.locator("#details")).to_contain_text("segment p(3,4): free")
    place.fill("p(9,9)")
    place.press("Enter")
    expect(answer).to_have_text("p(9,9): no segment of this site; write one such as p(1,3), or click on it")


def _said(trace: Path) -> list[Message]:
    decoder = Decoder(fleet_codec())
    with trace.open("rb") as lines:
        found = [decoder.feed(record.frame, record.time_us) for record in CandumpReader(lines)]
    return [one for one in found if one is not None]


def test_a_customer_reads_when_the_car_will_be_there_until_it_is(
    browser: Page, errors: list[str], tmp_path: Path
) -> None:
    text = (SITE_FILES / "level1.toml").read_text(encoding="utf-8")
    (tmp_path / "promising.toml").write_text(f"{text}\n[negotiation]\npromises = true\n", encoding="utf-8")
    words = ["bus_sim.cli", "run", "promising.toml", "--by-hand", "--speed", "50", "--web", "0"]
    process, address = start(words, tmp_path)
    try:
        browser.goto(address)
        expect(browser.locator("#link")).to_have_text("connected")
        browser.get_by_role("button", name="car in", exact=True).click()
        expect(browser.locator("[data-figure=parked]")).to_have_text("1")
        expect(browser.locator("#promised")).to_be_visible()
        browser.get_by_role("button", name="car out", exact=True).click()
        line = browser.locator("#promises tbody tr")
        expect(line).to_contain_text("IOC1")
        expect(line).to_contain_text("3.0 s")
        expect(browser.locator("[data-figure=fetched]")).to_have_text("1")
        expect(line).to_have_count(0)
    finally:
        end(process)
    assert not errors


def test_another_system_is_simulated_and_obeys(browser: Page, errors: list[str], tmp_path: Path) -> None:
    words = ["bus_sim.cli", "run", "terminal", "--speed", "40", "--web", "0", "--trace", "terminal.log"]
    with served(words, tmp_path) as address:
        browser.goto(address)
        expect(browser.get_by_role("img", name="plan of the site")).to_be_visible()
        expect(browser.get_by_role("button", name="car in")).to_be_hidden()
        browser.locator("#trouble [name=place]").fill("L2")
        browser.get_by_role("button", name="block", exact=True).click()
        expect(browser.locator("#events")).to_contain_text("L2 is blocked")
        assert set(drawn(browser, "machine")) == {"11", "12", "13", "14"}
    words = ["bus_sim.cli", "run", "graph", "--speed", "100", "--web", "0", "--trace", "graph.log"]
    with served(words, tmp_path) as address:
        browser.goto(address)
        expect(browser.locator("[data-figure=done]")).to_have_text("8")
        browser.get_by_role("button", name="order", exact=True).click()
        expect(browser.locator("#answer")).to_have_text("order 9 comes to OD")
        expect(browser.locator("[data-figure=done]")).to_have_text("9")
    assert not errors


def test_a_lost_line_says_so_and_comes_back_by_itself(browser: Page, errors: list[str], tmp_path: Path) -> None:
    words = ["onboard", "web", str(log_of("graph")), "--site", str(SITE_FILES / "graph.toml"), "--web"]
    kept = ["--web-token", "token"]
    process, address = start([*words, "0", *kept], tmp_path)
    try:
        browser.goto(address)
        expect(browser.locator("#link")).to_have_text("connected")
    finally:
        end(process, signal.SIGKILL)
    expect(browser.locator("#link")).to_have_text("connection lost, trying again")
    assert "is-lost" in (browser.locator("body").get_attribute("class") or "")
    process, again = start([*words, address.partition("/?")[0].rpartition(":")[2], *kept], tmp_path)
    assert again == address
    try:
        expect(browser.locator("#link")).to_have_text("connected")
        expect(browser.locator("body")).not_to_have_class("is-lost")
        # A program that hangs closes nothing: silence is told as well.
        process.send_signal(signal.SIGSTOP)
        expect(browser.locator("#link")).to_have_text("connection lost, trying again")
        process.send_signal(signal.SIGCONT)
        expect(browser.locator("#link")).to_have_text("connected")
    finally:
        assert end(process, signal.SIGTERM) == 0
    assert not errors


def test_calls_and_machines_can_be_chosen_by_keys(browser: Page, errors: list[str], tmp_path: Path) -> None:
    words = ["onboard", "web", str(log_of("small")), "--site", str(SITE_FILES / "small.toml"), "--web", "0"]
    with served(words, tmp_path) as address:
        browser.goto(address)
        expect(browser.locator("#mode")).to_have_text("log")
        for name in ("car in", "break", "block", "do it"):
            expect(browser.get_by_role("button", name=name, exact=True)).to_be_hidden()
        expect(browser.locator("#calls .call")).not_to_have_count(0)
        browser.keyboard.press("Space")
        expect(browser.locator("#pace")).to_have_text("paused")
        call = browser.locator("#calls .call").last
        call.focus()
        browser.keyboard.press("Enter")
        expect(browser.locator("#details")).to_contain_text("IOC1: park car IOC1/1, from IOC1 to anywhere")
        expect(call).to_be_focused()
        browser.keyboard.press("Escape")
        expect(browser.locator("#details")).to_be_hidden()
        browser.keyboard.press("ArrowDown")
        expect(browser.locator("#details")).to_contain_text("IOC1: compartment, node 1")
        browser.keyboard.press("ArrowDown")
        expect(browser.locator("#machines tr.chosen")).to_contain_text("ER1")
        assert len(rows(browser, "machines")) == 5
    assert not errors
