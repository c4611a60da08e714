"""The device under test as a process of this computer: ``onboard`` on the served buses of the simulated site."""

import asyncio
import contextlib
from asyncio.subprocess import Process
from pathlib import Path
from typing import Any

from bus_sim.processes.fleet import GRACE_S
from bus_sim.processes.plan import machine_file
from bus_sim.processes.spawn import log_of, start_machine
from bus_sim.run import FLEET, BusRun
from bus_sim.serve.socketcand import SocketcandServer
from hil.cable import Cable
from hil.short_circuit import ShortCircuit
from onboard.core.site import Machine
from onboard.ports.bus import Bus, BusHealth

_HOST = "127.0.0.1"


class ProcessDevice:
    """See ``hil.device.Device``; ``directory`` keeps machine file, site file, journal and console."""

    def __init__(self, simulation: BusRun[Any], machine: Machine, directory: Path) -> None:
        self._simulation = simulation
        self._machine = machine
        self._directory = directory
        self._short = ShortCircuit(simulation.fleet, machine.node_id)
        self._cables: list[Cable] = []
        self._nodes = 0
        self._server = SocketcandServer(self._join, lambda time_us: simulation.options.epoch_us + time_us, _HOST, 0)
        self._port = 0
        self._process: Process | None = None

    async def open(self) -> None:
        """Serve the simulated buses on a free port of this computer; the process joins them in ``power_on``."""
        self._port = await self._server.start()

    async def power_on(self, site_text: str) -> None:
        """Write both files and start ``onboard``; the journal in the directory is that of its former life."""
        name = self._machine.name
        (self._directory / "site.toml").write_text(site_text, encoding="utf-8")
        (self._directory / f"{name}.toml").write_text(
            machine_file(name, {"host": _HOST, "port": self._port}), encoding="utf-8"
        )
        self._process = await start_machine(self._directory, name)

    async def power_off(self) -> None:
        """Kill the process (SIGKILL), which leaves the journal as a power cut would."""
        process, self._process = self._process, None
        if process is not None and process.returncode is None:
            process.kill()
            await process.wait()

    async def unplug(self) -> None:
        """Take the process's node off the simulated bus; its connection to the server stays."""
        self._cable.unplug()

    async def plug(self) -> None:
        """Attach a new node for the process's connection, and send what waited."""
        self._cable.plug()

    async def force_bus_off(self) -> None:
        """Short the simulated bus in each of its frames until it is bus-off."""
        await self._short.force_bus_off()

    async def console(self) -> str:
        """Its standard output and error, of all its lives."""
        return log_of(self._directory, self._machine.name).read_text(encoding="utf-8", errors="replace")

    async def counters(self) -> BusHealth:
        """Those of its simulated node: the process itself sees only TCP."""
        return self._cable.health()

    async def close(self) -> None:
        """End the process in order within ``GRACE_S``, else by SIGKILL, then the server."""
        process = self._process
        if process is not None and process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            # The loop's clock follows the wall clock here, so this deadline is one of real time.
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), GRACE_S)
        await self.power_off()
        await self._server.close()

    @property
    def _cable(self) -> Cable:
        assert self._cables, f"{self._machine.name} has never joined the fleet bus"
        return self._cables[-1]

    def _join(self, channel: str, client: str) -> Bus | None:
        if channel != FLEET:
            return self._simulation.join(channel, client)
        cable = Cable(lambda: self._simulation.fleet.attach(self._next_name(), self._machine.node_id))
        self._cables.append(cable)
        return cable

    def _next_name(self) -> str:
        """Unique: the node of a connection that has just ended may still be leaving."""
        self._nodes += 1
        return f"{self._machine.name} under test {self._nodes}"
