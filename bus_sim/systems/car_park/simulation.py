"""A car park as a run: its plant on the buses of any run, and what somebody who only listens knows."""

from dataclasses import dataclass, field

from bus_sim.devices.timers import LoopTimers
from bus_sim.faults.bus import frame_faults
from bus_sim.options import RunOptions
from bus_sim.run import BusRun, buses_of, links_of
from bus_sim.systems.car_park.plant.plant import Plant
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import KindCode
from onboard.core.site import Machine, Site
from onboard.trace.view import SiteView
from onboard.ways.site import way_site


@dataclass
class Simulation(BusRun[Plant]):
    """A car park that can be run. Build it on its own loop with ``build``; then ``run_until``."""

    view: SiteView = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.view = SiteView(self.site)
        self.observers.append(self.view.feed)

    def body_slots(self, machine: Machine) -> tuple[str, ...]:
        """A carrier's slots, all that it is in; a lift by its name, whose platform it is on."""
        if machine.node_id not in self.plant.world.robots:
            return ()
        lifts = {one.home.track: one.name for one in self.site.machines.values() if one.kind is KindCode.LIFT}
        slots = self.plant.world.slots_of(machine.node_id)
        return tuple(dict.fromkeys(lifts.get(slot.track, str(slot)) for slot in slots))


def build(site: Site, options: RunOptions, loop: VirtualTimeLoop) -> Simulation:
    """All parts of a run of a car park, connected but not switched on."""
    fleet, devices = buses_of(site, frame_faults(options.faults, site), loop)
    links = links_of(site, devices)
    plant = Plant(way_site(site), LoopTimers(loop), links, options.seed)
    plant.judges_batteries = not options.faults
    return Simulation(site, options, loop, fleet, devices, plant, links)
