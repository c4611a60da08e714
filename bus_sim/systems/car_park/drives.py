"""Faults of a car park's sensors and drives, which its own messages tell of."""

from dataclasses import replace

from bus_sim.faults.devices import filter_incoming, filter_outgoing
from bus_sim.faults.injection import Injection
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.messages import DeskEvent, DriveOrder, DriveState, Message


def sensor_stuck(simulation: Simulation, injection: Injection) -> None:
    """Each kind of state is said as it was said first since the fault began; keys and tickets are no sensors."""
    last: dict[type[Message], Message] = {}

    def stuck(message: Message) -> Message:
        return message if isinstance(message, DeskEvent) else last.setdefault(type(message), message)

    filter_outgoing(simulation, injection, stuck)


def sensor_wrong(simulation: Simulation, injection: Injection) -> None:
    """A drive's position is said with a constant error; the mark sensor is another one and tells the truth."""
    by_mm = injection.count("by_mm")

    def wrong(message: Message) -> Message:
        return replace(message, position_mm=message.position_mm + by_mm) if isinstance(message, DriveState) else message

    filter_outgoing(simulation, injection, wrong)


def actuator_slow(simulation: Simulation, injection: Injection) -> None:
    """Drives move with a fraction of the speed that they are told."""
    factor = injection.number("factor")

    def slow(message: Message) -> Message:
        if not isinstance(message, DriveOrder):
            return message
        return replace(message, speed_limit_mm_s=max(1, round(message.speed_limit_mm_s * factor)))

    filter_incoming(simulation, injection, slow)


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

    filter_incoming(simulation, injection, halfway)
