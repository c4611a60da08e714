"""A run that somebody watches on the page: it goes on after its orders are done, until it is ended by a person."""

import asyncio
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from rich.console import Console

from bus_sim.run import BusRun

#: A watched run has no end of its own, us of loop time.
FOREVER_US = 10**15


@dataclass
class Viewer:
    """Whether somebody watches, and whether Ctrl-C has ended the run."""

    is_there: bool = False
    is_gone: bool = False


@asynccontextmanager
async def watched(run: BusRun, web: str | None) -> AsyncIterator[Viewer]:
    """Serve the page at ``web`` as long as the run lasts; without one nobody watches. Raises ``WebError``.

    Ctrl-C ends a watched run as its end does: with its figures, and a log that is whole.
    """
    if web is None:
        yield Viewer()
        return
    from bus_sim.web.page import Page  # noqa: PLC0415  # its libraries are an extra
    from bus_sim.web.systems import source_of  # noqa: PLC0415  # as above

    viewer, loop = Viewer(is_there=True), asyncio.get_running_loop()

    def end() -> None:
        viewer.is_gone = True
        run.loop.resume()

    async with Page(source_of(run), web, Console()):
        loop.add_signal_handler(signal.SIGINT, end)
        try:
            yield viewer
        finally:
            loop.remove_signal_handler(signal.SIGINT)
    # While the server came to its end, the machines went on: what they began is not waited for.
    begun = asyncio.all_tasks() - {asyncio.current_task()}
    for task in begun:
        task.cancel()
    await asyncio.gather(*begun, return_exceptions=True)
