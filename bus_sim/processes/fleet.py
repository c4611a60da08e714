"""Every machine of a site as an operating-system process that runs the ordinary ``onboard`` program."""

import asyncio
import resource
import signal
import tempfile
from asyncio.subprocess import Process
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from bus_sim.outside import Served
from bus_sim.processes.plan import PowerSpan, ProcessPlan, machine_file, spans_of
from bus_sim.processes.spawn import log_of, start_machine
from bus_sim.run import BusRun
from bus_sim.seals import SimulatedSeals
from onboard.config.keys import key_path, key_text
from onboard.core.site import Site
from onboard.io.kept_secrets import secrets_path
from onboard.systems.registry import factory_for
from onboard.systems.system import WithSecrets

#: How long a process may take to end once it was told to, s: two closings of a connection and a journal write.
GRACE_S = 5.0
#: A process that was told to end says 0, or was told before it could listen.
_ENDED_AS_TOLD = (0, -signal.SIGTERM)
#: When a run's keys were made, as key files tell it: before all lives.
_MADE = 1


class ProcessesError(Exception):
    """The processes cannot be started; ``str`` is one line for a person."""


@dataclass(frozen=True, slots=True)
class _Running:
    process: Process
    ended: asyncio.Task[int]


class ProcessFleet:
    """The controllers of a simulated site in processes of their own, for the time of a run.

    Each has a machine file, a journal and a log in one directory. A process that ends without having been told to is
    told in ``failures`` with its last words, and ends the run: ``is_over``. Entering raises ``ProcessesError``.
    """

    def __init__(self, simulation: BusRun[Any], plan: ProcessPlan, outside: frozenset[str], console: Console) -> None:
        """``outside`` are machines that somebody else runs, or nobody. Raises ``ValueError`` for a bad plan."""
        names = [machine.name for machine in simulation.site.machines.values() if machine.name not in outside]
        self.failures: list[str] = []
        self.is_over = False
        self._simulation = simulation
        self._plan = plan
        self._spans = spans_of(plan.moments, names)
        self._console = console
        self._directory = Path()
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        self._running: dict[str, _Running] = {}
        self._lives: list[asyncio.Task[None]] = []
        self._started = 0
        self._cpu_before_s = _cpu_of_children_s()
        self._begin_s = 0.0

    async def start(self, served: Served) -> None:
        """Write the machine files and start all that are on from the beginning; the others start in their time."""
        self._write_files(served)
        for medium in self._simulation.devices.values():
            # A device bus has several nodes, so that a frame is acknowledged though the controller is off.
            medium.attach("process host", None)
        loop = asyncio.get_running_loop()
        self._begin_s = loop.time()
        self._lives = [loop.create_task(self._live(name, spans)) for name, spans in self._spans.items()]
        self._console.print(f"{len(self._lives)} machines in processes of their own", highlight=False)

    async def stop(self) -> None:
        """End all processes, politely first, and forget their files unless a directory was named."""
        span_s = self._since_s()
        for life in self._lives:
            life.cancel()
        for ended in await asyncio.gather(*self._lives, return_exceptions=True):
            if isinstance(ended, Exception):
                raise ended
        await asyncio.gather(*(self._end(name, signal.SIGTERM) for name in list(self._running)))
        if self._temporary is not None:
            self._temporary.cleanup()
        if self._started and span_s > 0:
            share = (_cpu_of_children_s() - self._cpu_before_s) / span_s
            self._console.print(
                f"{self._started} processes were started; together they took {share:.1%} of one processor, starting "
                f"included; the simulator fell {self._simulation.loop.slipped_s:.1f} s behind the clock",
                highlight=False,
                soft_wrap=True,
            )

    # --- one machine -------------------------------------------------------------------------------------------

    async def _live(self, name: str, spans: list[PowerSpan]) -> None:
        for span in spans:
            await asyncio.sleep(self._left_s(span.begin_s))
            running = await self._start(name)
            await asyncio.wait([running.ended], timeout=self._left_s(span.end.at_s) if span.end is not None else None)
            if running.ended.done():
                del self._running[name]
                self._fail(name, f"ended by itself, {_status(running.ended.result())}")
            elif span.end is not None:
                await self._end(name, span.end.change.signal)
                self._tell(f"{name} {'was killed' if span.end.change.signal is signal.SIGKILL else 'has left'}")

    def _since_s(self) -> float:
        return asyncio.get_running_loop().time() - self._begin_s

    def _left_s(self, at_s: float) -> float:
        return max(0.0, at_s - self._since_s())

    async def _start(self, name: str) -> _Running:
        process = await start_machine(self._directory, name)
        running = _Running(process, asyncio.get_running_loop().create_task(process.wait()))
        self._running[name] = running
        self._started += 1
        self._tell(f"{name} is process {process.pid}")
        return running

    async def _end(self, name: str, how: signal.Signals) -> None:
        running = self._running.pop(name)
        if not running.ended.done():
            running.process.send_signal(how)
        _, late = await asyncio.wait([running.ended], timeout=GRACE_S)
        if late:
            running.process.kill()
            await running.ended
            self._fail(name, f"did not end within {GRACE_S:.0f} s of {how.name} and was killed")
        elif running.ended.result() not in (*_ENDED_AS_TOLD, -how):
            self._fail(name, f"was told to end, {_status(running.ended.result())}")

    def _fail(self, name: str, what: str) -> None:
        words = log_of(self._directory, name).read_text(encoding="utf-8", errors="replace").split("\n")
        last = next((line.removeprefix("onboard: ") for line in reversed(words) if line.strip()), "it said nothing")
        self.failures.append(f"{name}: its process {what}; last words: {last}")
        self.is_over = True

    # --- all of them -------------------------------------------------------------------------------------------

    def _tell(self, what: str) -> None:
        self._console.print(f"{self._since_s():7.1f} s  {what}", highlight=False, soft_wrap=True)

    def _write_files(self, served: Served) -> None:
        try:
            if self._plan.directory is None:
                self._temporary = tempfile.TemporaryDirectory(prefix="bus-sim-")
                self._directory = Path(self._temporary.name)
            else:
                self._directory = self._plan.directory.resolve()
                self._directory.mkdir(parents=True, exist_ok=True)
                if any(self._directory.glob("journal-*")):
                    raise ProcessesError(
                        f"{self._plan.directory}: holds the journals of another run, which tell of another world; "
                        "name an empty directory"
                    )
            (self._directory / "site.toml").write_text(self._plan.site_text, encoding="utf-8")
            for name in self._spans:
                (self._directory / f"{name}.toml").write_text(machine_file(name, served.arguments), encoding="utf-8")
            if self._simulation.seals.are_used:
                write_keys(self._directory, self._simulation.site, self._simulation.seals, self._spans)
            self._write_secrets()
        except OSError as error:
            raise ProcessesError(
                f"{error.filename}: cannot be written ({error.strerror}); name another directory"
            ) from error

    def _write_secrets(self) -> None:
        """One for all desks of the run, as a person would put it there: a ticket is good at each."""
        site = self._simulation.site
        for name in self._spans:
            if isinstance(factory_for(site, site.machine(name).kind), WithSecrets):
                path = secrets_path(self._directory / f"journal-{name}")
                path.touch(mode=0o600)
                path.write_text(f"{self._simulation.secret.hex()}\n", encoding="ascii")


def write_keys(directory: Path, site: Site, seals: SimulatedSeals, names: Collection[str]) -> None:
    """The keys that a run draws from its seed, in the files that ``onboard keys`` would have made; ``OSError``."""
    for node, machine in site.machines.items():
        if machine.name in names:
            file = key_path(directory / f"journal-{machine.name}")
            file.touch(mode=0o600)
            keys = replace(seals.keys(node), made=_MADE)
            file.write_text(key_text(keys, site.name, machine.name, "none: drawn from a seed"), encoding="utf-8")


def _status(code: int) -> str:
    return f"status {code}" if code >= 0 else f"by {signal.Signals(-code).name}"


def _cpu_of_children_s() -> float:
    """Processor time of all children that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
