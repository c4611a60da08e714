"""The device under test as a controller in the simulator's process and time: the scenarios are the simulator's too."""

from collections.abc import Callable
from typing import Any

from bus_sim.can.node import SimulatedBus
from bus_sim.journal import SimulatedJournal
from bus_sim.run import BusRun, NoWatchdog
from hil.cable import Cable
from hil.short_circuit import ShortCircuit
from onboard.config.site import parse_site
from onboard.controller.shell import Controller, Ports
from onboard.core.holon import Holon
from onboard.core.records import next_boot
from onboard.core.site import Machine
from onboard.ports.bus import BusHealth
from onboard.systems.registry import condition_for, factory_for


class SimulatedDevice:
    """See ``hil.device.Device``. ``before_start`` are told each controller before it starts: tests break it there."""

    def __init__(self, simulation: BusRun[Any], machine: Machine) -> None:
        self.before_start: list[Callable[[Controller], None]] = []
        self._simulation = simulation
        self._machine = machine
        self._short = ShortCircuit(simulation.fleet, machine.node_id)
        self._journal = SimulatedJournal()
        self._cables: tuple[Cable, Cable] | None = None
        self._controller: Controller | None = None
        self._former: list[Controller] = []

    async def power_on(self, site_text: str) -> None:
        """See ``Device``."""
        simulation, machine = self._simulation, self._machine
        site = parse_site(site_text, "site.toml")
        entries = self._journal.replay()
        holon = Holon(
            site,
            machine,
            factory_for(site, machine.kind),
            boot=next_boot(entries),
            entries=entries,
            journal=condition_for(site, self._journal.condition, entries, self._journal.name),
        )
        self._cables = (
            Cable(lambda: self._attach(simulation.fleet.attach)),
            Cable(lambda: self._attach(simulation.devices[machine.node_id].attach)),
        )
        ports = Ports(*self._cables, self._journal, simulation.log, NoWatchdog())
        self._controller = Controller(holon, ports, simulation.codecs.fleet, simulation.codecs.device)
        for prepare in self.before_start:
            prepare(self._controller)
        self._controller.start()

    async def power_off(self) -> None:
        """See ``Device``; a journal write under way is lost."""
        controller, self._controller = self._controller, None
        if controller is None or self._cables is None:
            return
        controller.holon.halted = controller.holon.halted or "power cut"
        for cable in self._cables:
            cable.power_off()
        self._former.append(controller)
        self._journal = self._journal.after_power_cut()

    async def unplug(self) -> None:
        """See ``Device``."""
        assert self._cables is not None
        self._cables[0].unplug()

    async def plug(self) -> None:
        """See ``Device``."""
        assert self._cables is not None
        self._cables[0].plug()

    async def force_bus_off(self) -> None:
        """See ``Device``."""
        await self._short.force_bus_off()

    async def console(self) -> str:
        """See ``Device``."""
        name = self._machine.name
        return "\n".join(f"{us / 1e6:.3f} {who}: {text}" for us, who, text in self._simulation.log.lines if who == name)

    async def counters(self) -> BusHealth:
        """See ``Device``."""
        assert self._cables is not None
        return self._cables[0].health()

    async def close(self) -> None:
        """See ``Device``."""
        await self.power_off()
        for controller in self._former:
            await controller.stop()

    def _attach(self, attach: Callable[[str, int], SimulatedBus]) -> SimulatedBus:
        return attach(f"{self._machine.name} under test", self._machine.node_id)
