"""``bus-sim run``: one run of a site of any system from its first second to what it came to.

The system brings the stage: its plant, who comes, and how a person sees it. Here are the loop, faults, whoever joins
from outside, the page, processes, a hurried beginning, and the end.
"""

import asyncio
import signal
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager, nullcontext
from dataclasses import replace
from typing import Any

from rich.console import Console

from bus_sim.demand import DemandError
from bus_sim.faults.arm import arm, check_faults
from bus_sim.options import RunOptions
from bus_sim.outside import Outside
from bus_sim.processes.fleet import ProcessFleet
from bus_sim.publish import Publishing
from bus_sim.run import BusRun, run_until
from bus_sim.site_change import roll_out
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stage import EndedRun, PersonAtKeys, RunFigures, Show, SystemStage
from bus_sim.systems.system import SimulatedSystem
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site
from onboard.io.signals import ended_by

#: A run that only a person ends, us: a century.
FOREVER_US = 100 * 366 * 86_400 * 1_000_000


def run_site(site: Site, options: RunOptions) -> RunFigures:
    """Play a site, show it, and answer with what it came to.

    Raises ``DemandError``, ``BusOpenError`` and the like for a person's mistakes, before anything has run.
    """
    return _on_loop(site, options, simulated_of(site))[1]


def play(
    site: Site,
    options: RunOptions,
    prepare: Callable[[Any], None] | None = None,
    system: SimulatedSystem[Any, Any] | None = None,
) -> SystemStage[Any]:
    """The same without a word: the stage as it is when all is over. ``prepare`` gets the run before it is switched on.

    ``system``: None for that of the site.
    """
    quiet = replace(options, quiet=True, prepare=prepare if prepare is not None else options.prepare)
    return _on_loop(site, quiet, system if system is not None else simulated_of(site))[0]


def _on_loop(site: Site, options: RunOptions, system: SimulatedSystem[Any, Any]) -> tuple[SystemStage[Any], RunFigures]:
    _check(site, options)
    loop = VirtualTimeLoop(pace=options.speed)
    try:
        asyncio.set_event_loop(loop)
        session = _Session(site, options, system, loop)
        return session.stage, loop.run_until_complete(_to_its_end(session))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


async def _to_its_end(session: "_Session") -> RunFigures:
    """The run, and nothing of it left behind: what machines have begun by then is not waited for."""
    summary = await session.play()
    begun = asyncio.all_tasks() - {asyncio.current_task()}
    for task in begun:
        task.cancel()
    await asyncio.gather(*begun, return_exceptions=True)
    return summary


def _check(site: Site, options: RunOptions) -> None:
    known = [machine.name for machine in site.machines.values()]
    unknown = options.without - set(known)
    if unknown:
        raise DemandError(f"--without {sorted(unknown)[0]}: no such machine; machines here: {', '.join(known)}")
    check_faults(options.faults, site)


class _Session:
    """One run from its first second to its end."""

    def __init__(
        self, site: Site, options: RunOptions, system: SimulatedSystem[Any, Any], loop: VirtualTimeLoop
    ) -> None:
        self._options = options
        self._loop = loop
        self._console = Console(quiet=options.quiet)
        plan = options.processes
        # Whoever has a process of its own has no controller here.
        all_names = frozenset(machine.name for machine in site.machines.values())
        self.stage = system.stage(site, options if plan is None else replace(options, without=all_names), loop)
        self._run: BusRun[Any] = self.stage.run
        self.stage.listen()
        self._begin_us = 0
        self._begin_s = 0.0
        self._hand: PersonAtKeys | None = None
        self._is_interrupted = False
        #: Whether what a person asked to see has begun; what is measured is of it alone.
        self._is_warm = False
        self._processes = ProcessFleet(self._run, plan, options.without, self._console) if plan is not None else None

    async def play(self) -> RunFigures:
        """The whole run."""
        run, options, stage = self._run, self._options, self.stage
        self._say(*stage.head())
        arm(run, options.faults)
        if options.was is not None:
            roll_out(run, options.was, round(options.change_s * 1_000_000))
        if options.prepare is not None:
            options.prepare(run)
        self._begin_s = time.monotonic()
        outside, show = Outside(run, options, self._console), stage.show(self._console)
        async with AsyncExitStack() as stack:
            # A signal ends a run as its end does: with its figures, a log that is whole, and no process left behind.
            stack.enter_context(ended_by(self._loop, self._interrupt))
            stack.callback(run.close)
            if options.web is not None:
                show.address = await stack.enter_async_context(self._page(options.web))
            if stage.shown_us is None:
                await stack.enter_async_context(outside)
                await stack.enter_async_context(self._publishing(outside))
                run.start()
                stack.enter_context(show)
                hand = stage.hand(self._console)
                if hand is not None:
                    self._hand = stack.enter_context(hand)
                if self._processes is not None:
                    assert outside.served is not None, "the options with processes name an address"
                    stack.push_async_callback(self._processes.stop)
                    await self._processes.start(outside.served)
                await self._to_the_end(show)
            else:
                run.start()
                stack.enter_context(show)
                await self._warm_up(stage.shown_us[0], show)
                if self._is_warm:
                    # Guests come for what is shown: they could not follow a warm-up that is hurried.
                    await stack.enter_async_context(outside)
                    await stack.enter_async_context(self._publishing(outside))
                    await self._until(self._limit_us(stage.shown_us[1]), show)
        failures = tuple(self._processes.failures) if self._processes is not None else ()
        wall_s = time.monotonic() - self._begin_s
        summary = stage.summary(EndedRun(wall_s, self._begin_us, stage.shown_us is None or self._is_warm, failures))
        self._say(*summary.lines(self._console.width if self._console.is_terminal else None))
        return summary

    def _say(self, *lines: str) -> None:
        for line in lines:
            self._console.print(line, highlight=False, markup=False, soft_wrap=True)

    def _publishing(self, outside: Outside) -> AbstractAsyncContextManager[object]:
        options = self._options
        if options.mqtt is None:
            return nullcontext()
        assert outside.served is not None, "the options with a broker name an address"
        return Publishing(self._run.site, options.site_text, options.mqtt, outside.served, self._console)

    @asynccontextmanager
    async def _page(self, where: str) -> AsyncIterator[str]:
        from bus_sim.web.page import Page  # noqa: PLC0415  # its libraries are an extra

        page = Page(self.stage.source(), where, self._options.web_token, self._console)
        async with page:
            yield page.address

    # --- the end -----------------------------------------------------------------------------------------------

    async def _until(self, limit_us: int, show: Show, *, or_over: bool = False) -> bool:
        """Let it run; True where it was over before the limit."""
        return await run_until(
            self._run,
            lambda: self._is_ended() or (or_over and self.stage.is_over),
            limit_us,
            self.stage.step_us,
            lambda: show.update(self._loop.now_us()),
        )

    def _interrupt(self, number: signal.Signals) -> None:
        if number is not signal.SIGINT:
            self._say(f"{number.name}: ending")
        self._is_interrupted = True
        self._loop.resume()

    def _is_ended(self) -> bool:
        """Whether a person, a process that died, or what must never happen has ended the run."""
        ended = [one.is_over for one in (self._hand, self._processes) if one is not None]
        broken = self.stage.is_broken and not self.stage.goes_on_broken
        return self._is_interrupted or any(ended) or broken

    def _limit_us(self, usual_us: int) -> int:
        """What was asked for from where measuring began on; else as usual."""
        limit_s = self._options.limit_s
        return usual_us if limit_s is None else min(usual_us, self._begin_us + round(limit_s * 1_000_000))

    async def _to_the_end(self, show: Show) -> None:
        stage = self.stage
        is_open = self._hand is not None or (self._options.web is not None and stage.goes_on_watched)
        limit_us = self._limit_us(FOREVER_US if is_open or self._options.limit_s is not None else stage.limit_us)
        if await self._until(limit_us, show, or_over=not is_open) and not self._is_ended():
            await self._until(min(limit_us, self._loop.now_us() + stage.tail_us), show)

    async def _warm_up(self, until_us: int, show: Show) -> None:
        """Everything before what is shown, as fast as possible; then measuring begins anew."""
        self._say(self.stage.warming_up(None))
        self._loop.set_pace(None)
        await self._until(until_us, show)
        if self._is_ended():
            return
        self._is_warm = True
        self._begin_us = self._loop.now_us()
        self.stage.measure_from(self._begin_us)
        self._say(self.stage.warming_up(time.monotonic() - self._begin_s))
        self._begin_s = time.monotonic()
        self._loop.set_pace(self._options.speed)
