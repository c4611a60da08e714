"""Faults of sensors and actuators, on the connection between a machine's devices and its device bus."""

import random
from typing import Any

from bus_sim.devices.link import MessageFilter
from bus_sim.faults.controllers import machine_named
from bus_sim.faults.injection import Injection
from bus_sim.run import BusRun


def sensor_off(simulation: BusRun[Any], injection: Injection) -> None:
    """Nothing that the devices sense is said any more."""
    filter_outgoing(simulation, injection, lambda _: None)


def sensor_flaky(simulation: BusRun[Any], injection: Injection) -> None:
    """Some states are lost by chance."""
    chance = random.Random(injection.count("seed"))
    limit = injection.number("probability")
    filter_outgoing(simulation, injection, lambda message: None if chance.random() < limit else message)


def actuator_stuck(simulation: BusRun[Any], injection: Injection) -> None:
    """No order reaches the devices; a drive that moves brakes by itself."""
    filter_incoming(simulation, injection, lambda _: None)


def filter_outgoing(simulation: BusRun[Any], injection: Injection, one: MessageFilter) -> None:
    """From now until the fault is over all that the target's devices say goes through this filter."""
    _put_in(simulation, injection, simulation.links[_node(simulation, injection)].outgoing, one)


def filter_incoming(simulation: BusRun[Any], injection: Injection, one: MessageFilter) -> None:
    """The same of all that its devices are told."""
    _put_in(simulation, injection, simulation.links[_node(simulation, injection)].incoming, one)


def _put_in(simulation: BusRun[Any], injection: Injection, filters: list[MessageFilter], one: MessageFilter) -> None:
    filters.append(one)
    simulation.plant.timers.call_at(injection.until_us, lambda: filters.remove(one))


def _node(simulation: BusRun[Any], injection: Injection) -> int:
    return machine_named(simulation, injection.target).node_id
