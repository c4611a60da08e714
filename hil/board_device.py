"""A board behind real interfaces: the simulated fleet bus reaches it over one, its device bus over another."""

import asyncio
import json
import tempfile
import time
from asyncio.subprocess import DEVNULL, PIPE
from pathlib import Path
from typing import Any

from bus_sim.run import BusRun
from bus_sim.serve.bridge import Bridge, open_bridge
from hil.bench import Capability, Command, Resources
from hil.device import BenchError
from onboard.config.machine_text import machine_text
from onboard.core.site import Machine
from onboard.io.settings import BusSettings
from onboard.ports.bus import BusHealth, ErrorState

#: How long a command of the bench may take, s.
COMMAND_S = 30.0
#: States of a CAN interface in the words of ``ip link``, as far as they are not error-active.
_STATES = {"ERROR-PASSIVE": ErrorState.ERROR_PASSIVE, "BUS-OFF": ErrorState.BUS_OFF, "STOPPED": ErrorState.BUS_OFF}


class BoardDevice:
    """See ``hil.device.Device``. Raises ``BenchError`` where a command fails, ``BusOpenError`` from ``open``."""

    def __init__(self, simulation: BusRun[Any], machine: Machine, resources: Resources) -> None:
        self._simulation = simulation
        self._machine = machine
        self._resources = resources
        self._bridges: list[Bridge] = []
        #: Of this test alone: what a journal tells of another test's world is not so in this one.
        self._journal = f"journal-{time.time_ns()}"

    async def open(self) -> None:
        """Join the simulated buses with the interfaces of this computer."""
        node_id = self._machine.node_id
        inside = {
            Capability.FLEET_BUS: self._simulation.fleet,
            Capability.DEVICE_BUS: self._simulation.devices[node_id],
        }
        for capability, interface in self._resources.buses.items():
            # A node beside the bridge, so that frames are acknowledged while the board is off.
            inside[capability].attach("bench acknowledges")
            bridge, _ = await open_bridge(inside[capability].attach("board"), BusSettings.of(interface))
            self._bridges.append(bridge)

    async def power_on(self, site_text: str) -> None:
        """See ``Device``."""
        files = self._resources.files
        if files is not None:
            text = machine_text(
                self._machine.name, "site.toml", files.fleet_bus, files.device_bus, journal=self._journal
            )
            with tempfile.TemporaryDirectory(prefix="hil-") as name:
                for file, content in (("machine.toml", text), ("site.toml", site_text)):
                    await asyncio.to_thread((Path(name) / file).write_text, content, encoding="utf-8")
                await _run(tuple(word.replace("{directory}", name) for word in files.install))
        await self._switch(Capability.POWER, on=True)

    async def power_off(self) -> None:
        """See ``Device``."""
        await self._switch(Capability.POWER, on=False)

    async def unplug(self) -> None:
        """See ``Device``."""
        await self._switch(Capability.CABLE, on=False)

    async def plug(self) -> None:
        """See ``Device``."""
        await self._switch(Capability.CABLE, on=True)

    async def force_bus_off(self) -> None:
        """See ``Device``."""
        await self._switch(Capability.BUS_OFF, on=True)
        await self._switch(Capability.BUS_OFF, on=False)

    async def console(self) -> str:
        """See ``Device``."""
        return await _run(self._resources.readers[Capability.CONSOLE])

    async def counters(self) -> BusHealth:
        """See ``Device``."""
        return read_counters(await _run(self._resources.readers[Capability.COUNTERS]))

    async def close(self) -> None:
        """See ``Device``."""
        for bridge in self._bridges:
            await bridge.close()
        if Capability.POWER in self._resources.switches:
            await self.power_off()

    async def _switch(self, capability: Capability, *, on: bool) -> None:
        switch = self._resources.switches.get(capability)
        if switch is not None:
            await _run(switch.on if on else switch.off)


async def _run(command: Command) -> str:
    """What a command prints. Raises ``BenchError`` where it fails, with its last words."""
    shown = " ".join(command)
    try:
        process = await asyncio.create_subprocess_exec(*command, stdin=DEVNULL, stdout=PIPE, stderr=PIPE)
    except OSError as error:
        raise BenchError(f"{shown}: {error.strerror or error}; install it, or mend the bench file") from error
    try:
        said, complaint = await asyncio.wait_for(process.communicate(), COMMAND_S)
    except TimeoutError:
        process.kill()
        await process.wait()
        raise BenchError(f"{shown}: not done after {COMMAND_S:.0f} s") from None
    if process.returncode:
        last = complaint.decode(errors="replace").strip().split("\n")[-1]
        raise BenchError(f"{shown}: status {process.returncode}: {last or 'it said nothing'}")
    return said.decode(errors="replace")


def read_counters(text: str) -> BusHealth:
    """The JSON of ``ip -details -statistics -json link show``. Raises ``BenchError`` where it is not that."""
    try:
        link: dict[str, Any] = json.loads(text)[0]
        can: dict[str, Any] = link["linkinfo"]["info_data"]
    except (ValueError, LookupError, TypeError) as error:
        raise BenchError(
            "counters: not what `ip -details -statistics -json link show` prints of a CAN interface; mend the command"
        ) from error
    errors, moved = can.get("berr_counter", {}), link.get("stats64", {})
    received, sent = moved.get("rx", {}), moved.get("tx", {})
    return BusHealth(
        _STATES.get(str(can.get("state")), ErrorState.ERROR_ACTIVE),
        int(errors.get("tx", 0)),
        int(errors.get("rx", 0)),
        int(sent.get("packets", 0)),
        int(received.get("packets", 0)),
        int(sent.get("dropped", 0)),
        int(received.get("over_errors", 0)) + int(received.get("dropped", 0)),
    )
