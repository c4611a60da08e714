"""One browser for all tests of a process: starting it takes longer than most of them."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect, sync_playwright

from tests.tools import require_tool
from tests.web.browser import DEADLINE_MS


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    """A page of a headless browser, 1280 pixels wide."""
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
