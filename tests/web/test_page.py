"""The page in a real browser: what it shows is what the buses say, and what it is told happens (Debian's Chromium)."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect, sync_playwright

from onboard.core.codes import TaskPhase
from onboard.core.messages import TaskReport
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.tools import require_tool

ROOT = Path(__file__).parents[2]
DEADLINE_MS = 60_000


def start(words: list[str], folder: Path) -> tuple[subprocess.Popen[str], str]:
    """A program that serves the page, and the page's address."""
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for line in process.stdout:
        found = re.search(r"picture at (http\S+)", line)
        if found:
            return process, found[1]
    raise AssertionError("the page's address was not printed")


def end(process: subprocess.Popen[str], how: signal.Signals) -> int:
    """End the program that serves; its exit status."""
    process.send_signal(how)
    process.communicate(timeout=30)
    return process.returncode


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    """A page of a headless browser; an error in its console fails the test."""
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=require_tool("chromium"), args=["--no-sandbox"])
        page = found.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(DEADLINE_MS)
        expect.set_options(timeout=DEADLINE_MS)
        yield page
        found.close()


@pytest.fixture
def errors(browser: Page) -> list[str]:
    """What the page's own script complains about."""
    found: list[str] = []
    browser.on("pageerror", lambda error: found.append(str(error)))
    return found


def cells(page: Page, name: str) -> list[str]:
    """One machine's row."""
    return page.locator("#machines tbody tr", has_text=name).first.locator("td").all_inner_texts()


def test_a_simulated_site_is_shown_and_obeys(browser: Page, errors: list[str], tmp_path: Path) -> None:
    words = ["bus_sim.cli", "run", "small", "--by-hand", "--speed", "20", "--web", "0", "--trace", "trace.log"]
    process, address = start(words, tmp_path)
    try:
        browser.goto(address)
        expect(browser.locator("#link")).to_have_text("connected")
        expect(browser.locator("#machines tbody tr")).to_have_count(5)
        browser.get_by_role("button", name="car in").click()
        expect(browser.locator("#answer")).to_have_text("by hand 1 comes in")
        expect(browser.locator("[data-figure=parked]")).to_have_text("1")
        browser.get_by_role("button", name="pause").click()
        expect(browser.locator("#pace")).to_have_text("paused")
        before = browser.locator("#clock").inner_text()
        assert cells(browser, "IOC1")[:1] == ["IOC1"]
        browser.locator("#machines tbody tr", has_text="MR1").first.click()
        expect(browser.locator("#details")).to_contain_text("MR1: robot, node 11")
        browser.set_viewport_size({"width": 360, "height": 740})
        assert browser.evaluate("document.documentElement.scrollWidth") <= 360
        browser.set_viewport_size({"width": 1280, "height": 800})
        assert browser.locator("#clock").inner_text() == before, "nothing moves while it is paused"
        browser.keyboard.press("Space")
        expect(browser.locator("#pace")).to_have_text("20 x")
        browser.select_option("#trouble select", "MR2")
        browser.get_by_role("button", name="break").click()
        expect(browser.locator("#answer")).to_have_text("MR2's controller has lost its power")
        browser.get_by_role("button", name="repair").click()
        expect(browser.locator("#answer")).to_have_text("MR2 starts again with its journal")
        shown = browser.locator("[data-figure=parked]").inner_text(), browser.locator("#calls .call").count()
    finally:
        end(process, signal.SIGINT)
    expect(browser.locator("#link")).to_have_text("connection lost, trying again")
    done, calls = told_by(tmp_path / "trace.log")
    assert shown[0] == str(done)
    assert shown[1] <= calls
    assert not errors


def told_by(trace: Path) -> tuple[int, int]:
    """Cars parked, and calls opened, by the trace."""
    decoder, done, calls = Decoder(fleet_codec()), set(), set()
    with trace.open("rb") as lines:
        for record in CandumpReader(lines):
            message = decoder.feed(record.frame, record.time_us)
            if isinstance(message, TaskReport) and message.phase is TaskPhase.DONE and message.sender in (11, 12):
                done.add(message.task)
            if type(message).__name__ == "CallForProposals":
                calls.add((message.sender, message.call))  # type: ignore[union-attr]  # what its name says
    return len(done), len(calls)


def test_a_recorded_log_has_a_slider_and_takes_no_orders(browser: Page, errors: list[str], tmp_path: Path) -> None:
    trace, site = tmp_path / "trace.log", ROOT / "bus_sim" / "sites" / "level1.toml"
    # In a process of its own: the browser's loop runs in this one.
    words = [sys.executable, "-m", "bus_sim.cli", "run", "level1", "--one-car", "60", "--trace", str(trace)]
    subprocess.run(words, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True, capture_output=True)
    process, address = start(["onboard", "web", str(trace), "--site", str(site), "--web", "0"], tmp_path)
    try:
        browser.goto(address)
        expect(browser.locator("#mode")).to_have_text("log")
        expect(browser.get_by_role("button", name="car in")).to_be_hidden()
        slider = browser.locator("#slider input")
        slider.evaluate("(one) => { one.value = 999; one.dispatchEvent(new Event('input')); }")
        expect(browser.locator("[data-figure=fetched]")).to_have_text("1")
        slider.evaluate("(one) => { one.value = 1; one.dispatchEvent(new Event('input')); }")
        expect(browser.locator("[data-figure=fetched]")).to_have_text("0")
    finally:
        status = end(process, signal.SIGTERM)
    assert status == 0
    assert not errors
