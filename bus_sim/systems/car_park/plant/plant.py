"""The whole plant of a site: devices on their machines' device buses, the world, the street and the oracle."""

from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import Timers
from bus_sim.systems.car_park.plant.battery import RobotBattery
from bus_sim.systems.car_park.plant.carrier import Carrier
from bus_sim.systems.car_park.plant.compartment import CompartmentPlant
from bus_sim.systems.car_park.plant.customer import Customer, CustomerState
from bus_sim.systems.car_park.plant.lift import LiftDrive
from bus_sim.systems.car_park.plant.oracle import Oracle
from bus_sim.systems.car_park.plant.rules import PlantRule
from bus_sim.systems.car_park.plant.shuttle import Shuttle
from bus_sim.systems.car_park.plant.street import Street
from bus_sim.systems.car_park.plant.world import CarParkWorld
from onboard.contract.codes import DeskText, KindCode
from onboard.core.site import Segment
from onboard.systems.car_park.site import car_park
from onboard.ways.site import WaySite


class Plant:
    """Everything that is not a controller. ``links`` has the end of each machine's device bus, by node-ID."""

    def __init__(self, site: WaySite, timers: Timers, links: dict[int, BusDeviceLink], seed: int) -> None:
        self.timers = timers
        self.world = CarParkWorld(site, self.timers)
        self.oracle = Oracle(self.world)
        self.carriers: dict[int, Carrier] = {}
        self.shuttles: dict[int, Shuttle] = {}
        self.compartments: dict[int, CompartmentPlant] = {}
        self.lifts: dict[int, LiftDrive] = {}
        self.batteries: dict[int, RobotBattery] = {}
        #: Chargers that give no power.
        self.dead_chargers: frozenset[Segment] = frozenset()
        #: Whether nothing strikes that can empty a battery: an empty one is the robot's own doing then.
        self.judges_batteries = True
        for machine in site.machines.values():
            node_id, link = machine.node_id, links[machine.node_id]
            if machine.kind is KindCode.ROBOT:
                shuttle = Shuttle(node_id, site, self.world, self.timers, link)
                self.shuttles[node_id] = shuttle
                self.carriers[node_id] = Carrier(node_id, site, self.world, self.timers, link, shuttle.is_home)
                self._add_battery(node_id, site, link)
            elif machine.kind is KindCode.LIFT:
                self.lifts[node_id] = LiftDrive(node_id, site, self.world, self.timers, link)
            elif machine.kind is KindCode.COMPARTMENT:
                self.compartments[node_id] = CompartmentPlant(node_id, site, self.world, self.timers, link)
        self.street = Street(self.compartments, self.world, self.oracle, self.timers, seed)

    def start(self) -> None:
        """Power on: every device tells how it stands."""
        for devices in (self.shuttles, self.carriers, self.lifts, self.compartments, self.batteries):
            for device in devices.values():
                device.start()

    def set_dead(self, chargers: frozenset[Segment]) -> None:
        """From now on these chargers give no power, and all others do."""
        self.dead_chargers = chargers
        for battery in self.batteries.values():
            battery.look()

    def _add_battery(self, node_id: int, site: WaySite, link: BusDeviceLink) -> None:
        battery = car_park(site).battery
        if battery is None:
            return
        made = RobotBattery(node_id, battery, self.world, self.timers, link, lambda: self.dead_chargers)
        made.on_empty = lambda: self._on_empty(node_id)
        self.batteries[node_id] = made

    def _on_empty(self, node_id: int) -> None:
        if self.judges_batteries:
            self.oracle.report(PlantRule.POWER, f"robot {node_id}")

    @property
    def violations(self) -> list[str]:
        """What the oracle has found so far."""
        return [str(one) for one in self.oracle.violations]

    @property
    def is_over(self) -> bool:
        """Whether nobody waits for anything; whoever has lost the ticket is not waited for, as no machine can help."""
        return all(
            customer.state is CustomerState.GONE
            or (customer.state is CustomerState.PARKED and customer.stay.departure_us is None)
            or looks_for_ticket(customer)
            for customer in self.street.customers
        )


def is_told_off(customer: Customer) -> bool:
    """Whether somebody waits and reads why: for the car at a desk, or before a bay whose desk is out of order."""
    if customer.state is CustomerState.QUEUEING:
        return customer.compartment is not None and customer.compartment.text is DeskText.OUT_OF_ORDER
    return customer.state is CustomerState.AT_DESK and customer.is_told_off


def looks_for_ticket(customer: Customer) -> bool:
    """Whether somebody stands at the desk without the ticket."""
    return customer.state is CustomerState.AT_DESK and customer.has_lost_ticket
