"""Faults of sensors and actuators, on the connection between a machine's devices and its device bus."""

import random
from dataclasses import replace

from bus_sim.devices.link import MessageFilter
from bus_sim.faults.controllers import machine_named
from bus_sim.faults.injection import Injection
from bus_sim.run import Simulation
from onboard.core.messages import DeskEvent, DriveOrder, DriveState, Message


def sensor_off(simulation: Simulation, injection: Injection) -> None:
    """Nothing that the devices sense is said any more."""
    _filter_outgoing(simulation, injection, lambda _: None)


def sensor_stuck(simulation: Simulation, injection: Injection) -> None:
    """Each kind of state is said as it was said first since the fault began; keys and tickets are no sensors."""
    last: dict[type[Message], Message] = {}

    def stuck(message: Message) -> Message:
        return message if isinstance(message, DeskEvent) else last.setdefault(type(message), message)

    _filter_outgoing(simulation, injection, stuck)


def sensor_flaky(simulation: Simulation, injection: Injection) -> None:
    """Some states are lost by chance."""
    chance = random.Random(injection.count("seed"))
    limit = injection.number("probability")
    _filter_outgoing(simulation, injection, lambda message: None if chance.random() < limit else message)


def sensor_wrong(simulation: Simulation, injection: Injection) -> None:
    """A drive's position is said with a constant error; the mark sensor is another one and tells the truth."""
    by_mm = injection.count("by_mm")

    def wrong(message: Message) -> Message:
        return replace(message, position_mm=message.position_mm + by_mm) if isinstance(message, DriveState) else message

    _filter_outgoing(simulation, injection, wrong)


def actuator_stuck(simulation: Simulation, injection: Injection) -> None:
    """No order reaches the devices; a drive that moves brakes by itself."""
    _filter_incoming(simulation, injection, lambda _: None)


def actuator_slow(simulation: Simulation, injection: Injection) -> None:
    """Drives move with a fraction of the speed that they are told."""
    factor = injection.number("factor")

    def slow(message: Message) -> Message:
        if not isinstance(message, DriveOrder):
            return message
        return replace(message, speed_limit_mm_s=max(1, round(message.speed_limit_mm_s * factor)))

    _filter_incoming(simulation, injection, slow)


def actuator_halfway(simulation: Simulation, injection: Injection) -> None:
    """The first drive order since the fault began is taken up; so long after it no further one is heard."""
    deaf_from_us: list[int] = []

    def halfway(message: Message) -> Message | None:
        if not isinstance(message, DriveOrder):
            return message
        now_us = simulation.loop.now_us()
        if not deaf_from_us:
            deaf_from_us.append(now_us + round(injection.number("after_s") * 1e6))
        return message if now_us < deaf_from_us[0] else None

    _filter_incoming(simulation, injection, halfway)


def _filter_outgoing(simulation: Simulation, injection: Injection, one: MessageFilter) -> None:
    _put_in(simulation, injection, simulation.plant.links[_node(simulation, injection)].outgoing, one)


def _filter_incoming(simulation: Simulation, injection: Injection, one: MessageFilter) -> None:
    _put_in(simulation, injection, simulation.plant.links[_node(simulation, injection)].incoming, one)


def _put_in(simulation: Simulation, injection: Injection, filters: list[MessageFilter], one: MessageFilter) -> None:
    filters.append(one)
    simulation.plant.timers.call_at(injection.until_us, lambda: filters.remove(one))


def _node(simulation: Simulation, injection: Injection) -> int:
    return machine_named(simulation, injection.target).node_id
