"""What people do to a car park that nobody asked them to do."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from bus_sim.faults.controllers import machine_named
from bus_sim.faults.injection import Injection
from bus_sim.systems.car_park.plant.customer import Customer, CustomerEvent
from bus_sim.systems.car_park.plant.motion import standing
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import DoorName, DoorPosition
from onboard.systems.car_park.axis import TrackAxis
from onboard.ways.site import way_site

#: Somebody who waits for the right moment looks again after this, us: a person's attention.
LOOK_US = 200_000


def lost_ticket(simulation: Simulation, injection: Injection) -> None:
    """The customer never finds the ticket that was taken: there is nothing to put into the desk."""
    customer = _customer(simulation, injection)
    if customer is not None:
        customer.has_lost_ticket = True


def linger(simulation: Simulation, injection: Injection) -> None:
    """The car stands in the compartment for long before it leaves."""
    customer = _customer(simulation, injection)
    if customer is not None:
        customer.dawdle_us = round(injection.number("for_s") * 1e6)


def oversize(simulation: Simulation, injection: Injection) -> None:
    """The car is of another length than it was."""
    customer = _customer(simulation, injection)
    if customer is not None:
        car = replace(customer.stay.car, length_mm=injection.count("length_mm"))
        customer.stay = replace(customer.stay, car=car)


def cancel(simulation: Simulation, injection: Injection) -> None:
    """Cancel is pressed: a parked car's owner comes back for it."""
    customer = _customer(simulation, injection)
    if customer is not None:
        customer.on(CustomerEvent.CANCEL)


def key_presses(simulation: Simulation, injection: Injection) -> None:
    """The key is pressed so many times, whoever is inside."""
    compartment = simulation.plant.compartments.get(machine_named(simulation, injection.target).node_id)
    if compartment is None:
        return
    now_us = simulation.loop.now_us()
    for number in range(injection.count("times")):
        when_us = now_us + round(number * injection.number("gap_s") * 1e6)
        simulation.plant.timers.call_at(when_us, compartment.press_key)


def door_forced(simulation: Simulation, injection: Injection) -> None:
    """The bolt is broken when both doors are locked and nobody is inside; until then somebody stands and waits."""
    compartment = simulation.plant.compartments.get(machine_named(simulation, injection.target).node_id)
    if compartment is None:
        return
    body = compartment.body
    if body.persons or any(position is not DoorPosition.LOCKED for position in body.doors.values()):
        again = partial(door_forced, simulation, injection)
        simulation.plant.timers.call_at(simulation.loop.now_us() + LOOK_US, again)
        return
    compartment.doors[DoorName.INPUT if injection.text("door") == "input" else DoorName.OUTPUT].force()


def moved(simulation: Simulation, injection: Injection) -> None:
    """Pushed by hand, as soon as it stands with its shuttle home: never into another body or beyond its alley."""
    node_id = machine_named(simulation, injection.target).node_id
    world = simulation.plant.world
    if node_id not in world.robots:
        return
    now_us = simulation.loop.now_us()
    robot = world.robots[node_id]
    track = way_site(simulation.site).tracks[robot.track]
    if (
        not world.stands(node_id)
        or robot.is_out(now_us)
        or world.is_riding(node_id)
        or _on_platform(simulation, node_id)
    ):
        simulation.plant.timers.call_at(now_us + LOOK_US, partial(moved, simulation, injection))
        return
    here_mm = robot.motion.final_mm
    low_mm, high_mm = 0.0, float((track.length - 1) * track.pitch_mm)
    half_mm = way_site(simulation.site).carrier_length_mm / 2
    for from_mm, to_mm in _taken_by_others(simulation, node_id):
        if from_mm + to_mm > 2 * here_mm:
            high_mm = min(high_mm, from_mm - half_mm)
        else:
            low_mm = max(low_mm, to_mm + half_mm)
    if high_mm < low_mm:
        return
    target_mm = min(max(here_mm + injection.number("by_mm"), low_mm), high_mm)
    world.move_carrier(node_id, standing(target_mm, now_us))
    simulation.plant.carriers[node_id].start()


def _taken_by_others(simulation: Simulation, node_id: int) -> Iterator[tuple[float, float]]:
    """From where to where, mm, others' bodies are on a robot's track or drive to; who closes a mouth has all of it."""
    site, world = way_site(simulation.site), simulation.plant.world
    track, half_mm = site.tracks[world.robots[node_id].track], site.carrier_length_mm // 2
    for other, body in world.robots.items():
        if other == node_id:
            continue
        ends_mm = body.motion.at(simulation.loop.now_us())[0], body.motion.final_mm
        from_mm, to_mm = min(ends_mm) - half_mm, max(ends_mm) + half_mm
        if body.track == track.number:
            yield from_mm, to_mm
            continue
        for slot in TrackAxis(site, world.axis_of(other)).overlapped(round(from_mm) + 1, round(to_mm) - 1):
            if slot.track == track.number:
                middle_mm = site.position_mm(slot)
                yield middle_mm - track.pitch_mm / 2, middle_mm + track.pitch_mm / 2


def _on_platform(simulation: Simulation, node_id: int) -> bool:
    world = simulation.plant.world
    return any(world.on_platform(lift) == node_id or world.overhang(lift) == node_id for lift in world.platforms)


def _customer(simulation: Simulation, injection: Injection) -> Customer | None:
    """The n-th customer in the order in which they came into the run; None where there are fewer."""
    customers = simulation.plant.street.customers
    number = injection.count("car")
    return customers[number - 1] if number <= len(customers) else None
