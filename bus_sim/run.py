"""One run of a site in one process: bus, plant, customers and all controllers on one loop, in virtual time or paced.

Same seed, same options: the same candump log, byte for byte.
"""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from hashlib import blake2s
from itertools import count
from typing import Any, Generic, Protocol, TypeVar

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.faults import InjectedFault
from bus_sim.can.medium import Medium, Tap
from bus_sim.can.node import SimulatedBus
from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import Timers
from bus_sim.journal import SimulatedJournal
from bus_sim.options import RunOptions
from bus_sim.seals import SimulatedSeals, begin, cut_off, plain_bus
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import KindCode
from onboard.contract.messages import Message
from onboard.contract.runs import singles
from onboard.controller.shell import Controller, Ports
from onboard.core.behaviour import BehaviourFactory
from onboard.core.frame import Frame
from onboard.core.records import next_boot
from onboard.core.site import Machine, Site, journal_owner
from onboard.holon.holon import Holon
from onboard.ports.bus import Bus
from onboard.systems.contract import codecs_for
from onboard.systems.registry import compaction_for, condition_for, factory_for, with_secrets
from onboard.trace.candump import CandumpWriter
from onboard.wire.decoder import Decoder
from onboard.wire.untold import untold

#: The fleet bus in a log and on the served socket.
FLEET = "fleet"


class EventLog:
    """Telemetry of all machines: kept for people, never read by a machine."""

    def __init__(self, limit: int = 10_000) -> None:
        self.lines: list[tuple[int, str, str]] = []
        self._limit = limit

    def event(self, time_us: int, source: str, text: str) -> None:
        """Keep one line; the oldest goes when there are too many."""
        self.lines.append((time_us, source, text))
        if len(self.lines) > self._limit:
            del self.lines[0]


class NoWatchdog:
    """A supervisor that looks away."""

    def ready(self) -> None:
        """Nobody is told that start-up is over."""

    def alive(self) -> None:
        """Nobody is told of progress, and nobody restarts the controller."""

    def status(self, text: str) -> None:
        """The line goes to nobody."""


class PlantPort(Protocol):
    """What a run asks of the plant of any system: everything that is not a controller."""

    @property
    def timers(self) -> Timers:
        """The loop's time and calls at chosen times, for whatever happens to the run from outside."""

    def start(self) -> None:
        """Power on: every device tells how it stands."""


PlantT = TypeVar("PlantT", bound=PlantPort)


@dataclass
class BusRun(Generic[PlantT]):
    """A site of any system that can be run: buses, plant and controllers, connected but not switched on.

    ``links`` are the plant's ends of the device buses, by node-ID: faults of sensors and actuators act there.
    """

    site: Site
    options: RunOptions
    loop: VirtualTimeLoop
    fleet: Medium
    devices: dict[int, Medium]
    plant: PlantT
    links: dict[int, BusDeviceLink] = field(default_factory=dict)
    log: EventLog = field(default_factory=EventLog)
    controllers: dict[int, Controller] = field(default_factory=dict)
    journals: dict[int, SimulatedJournal] = field(default_factory=dict)
    writer: CandumpWriter | None = None
    #: Which behaviour drives which kind; baselines put their own in before ``start``.
    factories: Callable[[Site, KindCode], BehaviourFactory] = factory_for
    #: What the controllers are made of; faults put in one whose clock and processor may fail.
    holon_class: type[Holon] = Holon
    #: Told every message of the fleet bus with its time, in this order.
    observers: list[Callable[[Message, int], None]] = field(default_factory=list)
    #: Given every controller when it is powered up, before it starts: planted bugs come in here, and nothing else.
    before_start: list[Callable[[Controller], None]] = field(default_factory=list)
    #: Told every machine whose controller lost its power.
    after_crash: list[Callable[[Machine], None]] = field(default_factory=list)
    #: Told when a person has had a machine's rights made anew.
    after_repair: list[Callable[[], None]] = field(default_factory=list)
    #: Numbers for people with a tool: several may come to the bus at one moment, each under a name of its own.
    visitors: Iterator[int] = field(default_factory=lambda: count(1))
    #: The one computer that has the keys of a station, where a site has seals: whoever comes meanwhile waits.
    station: asyncio.Lock = field(default_factory=asyncio.Lock)

    def __post_init__(self) -> None:
        #: By node-ID the site file that a machine has; who is not among them has no controller yet.
        self.in_force = dict.fromkeys(self.site.machines, self.site)
        self.codecs = codecs_for(self.site)
        #: What machines of a kind share; drawn from the seed.
        self.secret = blake2s(f"secret:{self.options.seed}".encode()).digest()
        self.seals = SimulatedSeals(self.site, self.options.seed, self.codecs.fleet.decode_part)

    def start(self, after_us: Callable[[], int] | None = None) -> None:
        """Switch on the plant, then every controller, in the order of their node-IDs. On the running loop.

        With ``after_us`` each controller is there so many us of the loop later, as computers that boot.
        """
        self._tap()
        self.plant.start()
        for machine in self.site.machines.values():
            if machine.name in self.options.without or machine.node_id not in self.in_force:
                continue
            if after_us is None:
                self.start_controller(machine)
            else:
                due_us = self.loop.now_us() + after_us()
                self.plant.timers.call_at(due_us, partial(self.start_controller, machine))

    def start_controller(self, machine: Machine) -> None:
        """Power up one machine's controller; a second time means a restart, with the same journal.

        Nothing where it has no site file yet.
        """
        site = self.in_force.get(machine.node_id)
        if site is None:
            return
        journal = self.journals.setdefault(machine.node_id, SimulatedJournal(journal_owner(self.site, machine)))
        entries = journal.replay()
        holon = self.holon_class(
            site,
            machine,
            with_secrets(self.factories(site, machine.kind), (self.secret,)),
            boot=next_boot(entries),
            entries=entries,
            journal=condition_for(site, journal.condition, entries, journal.name),
        )
        ports = Ports(
            self.seals.behind_gate(self.fleet.attach(machine.name, machine.node_id), machine.node_id),
            self.devices[machine.node_id].attach(machine.name, machine.node_id),
            journal,
            self.log,
            NoWatchdog(),
            compaction_for(site),
        )
        controller = Controller(holon, ports, self.codecs.fleet, self.codecs.device)
        self.controllers[machine.node_id] = controller
        for prepare in self.before_start:
            prepare(controller)
        begin(ports.fleet_bus, controller.start)

    def crash(self, machine: Machine) -> None:
        """Cut one controller's power at once; its devices go on by themselves. Harmless where it is off already.

        What the journal holds at this moment is what a later ``start_controller`` finds: a write under way is lost.
        """
        controller = self.controllers.pop(machine.node_id, None)
        if controller is None:
            return
        controller.holon.halted = "power cut"
        controller.power_off()
        for bus in (controller.ports.fleet_bus, controller.ports.device_bus):
            cut_off(bus)
        self.journals[machine.node_id] = self.journals[machine.node_id].after_power_cut()
        for tell in self.after_crash:
            tell(machine)

    def body_slots(self, machine: Machine) -> tuple[str, ...]:
        """Where a person sees a machine's body, in the words of ``onboard operate``; nothing for one that is fixed."""
        return ()

    def fleet_node(self, name: str) -> SimulatedBus | None:
        """A running controller's node on the fleet bus, by its machine's name; None while it is off."""
        for controller in self.controllers.values():
            if controller.holon.machine.name == name:
                return plain_bus(controller.ports.fleet_bus)
        return None

    def tool_bus(self, name: str, node_id: int) -> Bus:
        """The bus of a person's tool that speaks under ``node_id``, ready to be spoken on."""
        bus = self.seals.behind_gate(self.fleet.attach(name, node_id), node_id)
        begin(bus, lambda: None)
        return bus

    def join(self, channel: str, name: str) -> Bus | None:
        """A further node on a bus, for a client from outside: the fleet bus, or a machine's device bus by its name."""
        if channel == FLEET:
            return self.fleet.attach(name, None)
        for machine in self.site.machines.values():
            if machine.name == channel:
                return self.devices[machine.node_id].attach(name, None)
        return None

    @property
    def restless(self) -> list[str]:
        """Names of machines whose wakes did not come to rest: without a bound time would stand still with them."""
        return [one.holon.machine.name for one in self.controllers.values() if one.rest.is_broken]

    def close(self) -> None:
        """Finish the log, where one is written."""
        if self.writer is not None:
            self.writer.close()

    def _tap(self) -> None:
        if self.options.trace is not None:
            self.writer = CandumpWriter(self.options.trace)
        decoder = Decoder(self.codecs.fleet)

        def write(frame: Frame, time_us: int, _: str) -> None:
            assert self.writer is not None
            self.writer.write(self.options.epoch_us + time_us, FLEET, frame)

        def on_fleet(frame: Frame, time_us: int, _: str) -> None:
            message: Message | None = decoder.feed(frame, time_us)
            for word in singles(message) if message is not None else ():
                for observer in self.observers:
                    observer(word, time_us)

        if self.writer is not None:
            self.fleet.tap(write)
        self.fleet.tap(self.seals.proved(on_fleet), errors=ErrorsHeard.NONE)
        if self.writer is not None and self.options.devices:
            for node_id, medium in self.devices.items():
                medium.tap(self._device_tap(self.site.machines[node_id].name))

    def _device_tap(self, name: str) -> Tap:
        def on_device(frame: Frame, time_us: int, _: str) -> None:
            assert self.writer is not None
            self.writer.write(self.options.epoch_us + time_us, name, untold(frame))

        return on_device


def buses_of(site: Site, faults: tuple[InjectedFault, ...], loop: VirtualTimeLoop) -> tuple[Medium, dict[int, Medium]]:
    """The fleet bus with its faults of single frames, and each machine's device bus by its node-ID."""
    fleet = Medium(loop, bit_rate=site.bitrate, faults=faults)
    return fleet, {node_id: Medium(loop, bit_rate=site.bitrate) for node_id in site.machines}


def links_of(site: Site, devices: dict[int, Medium]) -> dict[int, BusDeviceLink]:
    """The plant's end of each machine's device bus, by node-ID."""
    codec = codecs_for(site).device
    return {
        node: BusDeviceLink(medium.attach("plant", node), codec, Decoder(codec), node)
        for node, medium in devices.items()
    }


async def run_until(
    run: BusRun[Any],
    done: Callable[[], bool],
    limit_us: int,
    step_us: int,
    show: Callable[[], None] | None = None,
) -> bool:
    """Let time pass in steps of ``step_us`` until ``done`` or ``limit_us``; True where it was done.

    A machine whose wakes do not come to rest ends the run: it is among those that are halted, by name.
    ``show`` is called after each step.
    """
    while not done():
        if run.loop.now_us() >= limit_us or run.restless:
            return False
        await asyncio.sleep(step_us / 1_000_000)
        if show is not None:
            show()
    return True
