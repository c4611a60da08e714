"""A run that somebody watches on the page: it goes on after its orders are done, until it is ended by a person."""

import asyncio
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from rich.console import Console

from bus_sim.run import BusRun
from onboard.io.signals import ended_by

#: A watched run has no end of its own, us of loop time.
FOREVER_US = 10**15


@dataclass
class Viewer:
    """Whether somebody watches, and whether a person or a supervisor has ended the run by a signal."""

    is_there: bool = False
    is_gone: bool = False


@asynccontextmanager
async def watched(run: BusRun, web: str | None) -> AsyncIterator[Viewer]:
    """Serve the page at ``web`` as long as the run lasts; without one nobody watches. Raises ``WebError``.

    A signal ends a run as its end does: with its figures, and a log that is whole.
    """
    viewer, loop = Viewer(is_there=web is not None), asyncio.get_running_loop()

    def end(_: signal.Signals) -> None:
        viewer.is_gone = True
        run.loop.resume()

    if web is None:
        with ended_by(loop, end):
            yield viewer
        return
    from bus_sim.web.page import Page  # noqa: PLC0415  # its libraries are an extra
    from bus_sim.web.systems import source_of  # noqa: PLC0415  # as above

    with ended_by(loop, end):
        async with Page(source_of(run), web, Console()):
            yield viewer
    # While the server came to its end, the machines went on: what they began is not waited for.
    begun = asyncio.all_tasks() - {asyncio.current_task()}
    for task in begun:
        task.cancel()
    await asyncio.gather(*begun, return_exceptions=True)
