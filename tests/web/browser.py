"""A headless browser and the programs whose page it opens."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Locator, Page

from tests.tools import DEADLINE_S
from tests.web.logs import environment

DEADLINE_MS = 1_000 * DEADLINE_S


def start(words: list[str], folder: Path) -> tuple[subprocess.Popen[str], str]:
    """A program that serves the page, and the page's address."""
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", *words],
        cwd=folder,
        env=environment(),
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


def live_of(address: str) -> str:
    """The socket of a page's address."""
    where, _, asked = address.removeprefix("http").partition("?")
    return f"ws{where}live?{asked}"


def end(process: subprocess.Popen[str], how: signal.Signals = signal.SIGINT) -> int:
    """End the program that serves; its exit status."""
    process.send_signal(how)
    process.communicate(timeout=DEADLINE_S)
    return process.returncode


@contextmanager
def served(words: list[str], folder: Path) -> Iterator[str]:
    """The page's address, as long as its program runs."""
    process, address = start(words, folder)
    try:
        yield address
    finally:
        end(process)


def drawn(page: Page, what: str) -> dict[str, dict[str, Any]]:
    """What stands in the picture now, of one sort: boxes by their names or numbers."""
    page.wait_for_function("() => document.querySelector('#picture').drawn !== undefined")
    # The tables are newer than the picture by one frame of the browser: the second one from now has drawn all of it.
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")
    boxes: list[dict[str, Any]] = page.evaluate("document.querySelector('#picture').drawn")
    return {str(box["id"]): box for box in boxes if box["what"] == what}


def row_of(page: Page, machine: str) -> Locator:
    """A machine's row of its table: who carries it, or is where it is, names it in another cell."""
    return page.locator("#machines tbody tr").filter(has=page.locator(f'td:first-child:text-is("{machine}")'))


def rows(page: Page, table: str) -> list[list[str]]:
    """Cells of a table, row by row, at one moment."""
    cells = (
        "[...document.querySelectorAll(`#${name} tbody tr`)].map(row => [...row.cells].map(cell => cell.textContent))"
    )
    found: list[list[str]] = page.evaluate(f"name => {cells}", table)
    return found
