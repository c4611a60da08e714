"""The whole plant of a site: devices on their machines' device buses, the world, the street and the oracle."""

import asyncio
from collections.abc import Mapping

from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import LoopTimers
from bus_sim.systems.car_park.plant.carrier import Carrier
from bus_sim.systems.car_park.plant.compartment import Compartment
from bus_sim.systems.car_park.plant.lift import LiftDrive
from bus_sim.systems.car_park.plant.oracle import Oracle
from bus_sim.systems.car_park.plant.shuttle import Shuttle
from bus_sim.systems.car_park.plant.street import Street
from bus_sim.systems.car_park.plant.world import World
from onboard.core.codes import KindCode
from onboard.ports.bus import Bus
from onboard.ways.site import WaySite
from onboard.wire.codec import device_codec
from onboard.wire.decoder import Decoder


class Plant:
    """Everything that is not a controller. ``buses`` has one connection to each machine's device bus, by node-ID."""

    def __init__(self, site: WaySite, loop: asyncio.AbstractEventLoop, buses: Mapping[int, Bus], seed: int) -> None:
        self.timers = LoopTimers(loop)
        self.world = World(site, self.timers)
        self.oracle = Oracle(self.world)
        self.carriers: dict[int, Carrier] = {}
        self.shuttles: dict[int, Shuttle] = {}
        self.compartments: dict[int, Compartment] = {}
        self.lifts: dict[int, LiftDrive] = {}
        #: Each machine's devices' connection to its device bus; faults of sensors and actuators act there.
        self.links: dict[int, BusDeviceLink] = {}
        for machine in site.machines.values():
            node_id = machine.node_id
            link = BusDeviceLink(buses[node_id], device_codec(), Decoder(device_codec()), node_id)
            self.links[node_id] = link
            if machine.kind is KindCode.ROBOT:
                shuttle = Shuttle(node_id, site, self.world, self.timers, link)
                self.shuttles[node_id] = shuttle
                self.carriers[node_id] = Carrier(node_id, site, self.world, self.timers, link, shuttle.is_home)
            elif machine.kind is KindCode.LIFT:
                self.lifts[node_id] = LiftDrive(node_id, site, self.world, self.timers, link)
            elif machine.kind is KindCode.COMPARTMENT:
                self.compartments[node_id] = Compartment(node_id, site, self.world, self.timers, link)
        self.street = Street(self.compartments, self.world, self.oracle, self.timers, seed)

    def start(self) -> None:
        """Power on: every device tells how it stands."""
        for devices in (self.shuttles, self.carriers, self.lifts, self.compartments):
            for device in devices.values():
                device.start()
