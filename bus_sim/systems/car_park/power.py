"""Faults of batteries and chargers, and the person who comes to a robot that stands without power."""

from functools import partial

from bus_sim.faults.controllers import machine_named, restart_later
from bus_sim.faults.injection import Injection
from bus_sim.systems.car_park.plant.battery import RobotBattery
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import MachineState
from onboard.core.site import Machine
from onboard.systems.car_park.site import CarPark, car_park

#: Kinds that strike only where robots have batteries.
OF_BATTERIES = frozenset({"battery_drop", "battery_drain", "chargers_off"})
#: From an empty battery to the person who charges it, us, and what the charged robot's controller is off then.
PERSON_US, OFF_US = 60_000_000, 1_000_000


def strikes(kind: str, site: CarPark) -> bool:
    """Whether a kind of fault strikes anything on this site."""
    return kind not in OF_BATTERIES or site.battery is not None


def battery_drop(simulation: Simulation, injection: Injection) -> None:
    """Cells fail: the charge is no more than so many percent from now on; what is less already stays."""
    battery = _attended(simulation, injection, injection.target)
    if battery is not None:
        left = injection.number("percent") / 100
        battery.set_charge(min(left, battery.charge_ws / battery.capacity_ws))


def battery_drain(simulation: Simulation, injection: Injection) -> None:
    """All that is drawn is so many times as much, until the fault is over."""
    battery = _attended(simulation, injection, injection.target)
    if battery is not None:
        _set_ageing(battery, injection.number("factor"))
        simulation.plant.timers.call_at(injection.until_us, partial(_set_ageing, battery, 1.0))


def chargers_off(simulation: Simulation, injection: Injection) -> None:
    """No charger gives power, until the fault is over."""
    plant, battery = simulation.plant, car_park(simulation.site).battery
    if battery is None:
        return
    for node in plant.batteries:
        _attended(simulation, injection, simulation.site.machines[node].name)
    plant.set_dead(frozenset(battery.chargers))
    plant.timers.call_at(injection.until_us, partial(plant.set_dead, frozenset()))


def _set_ageing(battery: RobotBattery, factor: float) -> None:
    # What was drawn up to now was drawn as before.
    battery.look()
    battery.ageing = factor
    battery.look()


def _attended(simulation: Simulation, injection: Injection, name: str) -> RobotBattery | None:
    """A robot's battery, which a person charges where it has become empty, once the fault is over; None without."""
    machine, timers = machine_named(simulation, name), simulation.plant.timers
    battery = simulation.plant.batteries.get(machine.node_id)
    if battery is not None:

        def is_seen() -> None:
            when_us = max(injection.until_us, timers.now_us() + PERSON_US)
            timers.call_at(when_us, partial(_charge, simulation, machine, battery))

        battery.on_empty = is_seen
    return battery


def _charge(simulation: Simulation, machine: Machine, battery: RobotBattery) -> None:
    """Somebody brings a full battery, and starts the controller again where it has stopped."""
    if not battery.is_empty:
        return
    battery.set_charge(1.0)
    controller = simulation.controllers.get(machine.node_id)
    if controller is not None and controller.holon.behaviour.state is MachineState.STOPPED:
        simulation.crash(machine)
        restart_later(simulation, machine, simulation.loop.now_us() + OFF_US)
