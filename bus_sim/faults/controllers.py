"""Faults of controllers: power cuts at every kind of moment, journals that suffer, processors and clocks."""

import random
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from bus_sim.faults.attendant import Attendant
from bus_sim.faults.holon import FROZEN_PPM, FaultyHolon
from bus_sim.faults.injection import Injection
from bus_sim.faults.journals import hurt
from bus_sim.run import BusRun
from onboard.core.frame import Frame
from onboard.core.site import Machine


def crash(simulation: BusRun[Any], injection: Injection) -> None:
    """At once, or from now on at the n-th frame that it sends or the n-th entry that it writes."""
    machine = machine_named(simulation, injection.target)
    strike = partial(lose_power, simulation, injection)
    if injection.count("frame"):
        _at_frame(simulation, machine, injection.count("frame"), strike)
    elif injection.count("write"):
        durable = injection.text("durable") == "yes"
        _at_write(simulation, machine, injection.count("write"), durable=durable, strike=strike)
    else:
        strike()


def lose_power(simulation: BusRun[Any], injection: Injection) -> None:
    """Now, and what else this crash brings: the harm to the journal, and the power coming back."""
    machine = machine_named(simulation, injection.target)
    if machine.node_id not in simulation.controllers:
        return
    simulation.crash(machine)
    hurt(simulation.journals[machine.node_id], injection.text("journal"), injection.count("entries"))
    person_us = round(injection.number("person_s") * 1e6)
    if person_us:
        Attendant(simulation, machine, person_us, partial(restart_later, simulation, machine))
    if injection.text("restart") == "yes":
        restart_later(simulation, machine, simulation.loop.now_us() + round(injection.number("restart_s") * 1e6))


def _at_frame(simulation: BusRun[Any], machine: Machine, number: int, strike: Callable[[], None]) -> None:
    """The n-th frame of this machine is queued and never leaves: the power goes while it waits."""
    left = [number]

    def count(_frame: Frame, _time_us: int, sender: str) -> None:
        if sender == machine.name and left[0] > 0:
            left[0] -= 1
            if left[0] == 0:
                strike()

    simulation.fleet.tap_queues(count)
    simulation.devices[machine.node_id].tap_queues(count)


def _at_write(
    simulation: BusRun[Any], machine: Machine, number: int, *, durable: bool, strike: Callable[[], None]
) -> None:
    journal = simulation.journals[machine.node_id]
    left = [number]

    def count(is_durable: bool) -> None:
        if is_durable is durable and left[0] > 0:
            left[0] -= 1
            if left[0] == 0:
                # The journal lives on after the crash, under another controller.
                journal.on_write = None
                strike()

    journal.on_write = count


def restart_later(simulation: BusRun[Any], machine: Machine, when_us: int) -> None:
    """Power comes back at a loop time, us; nothing happens where it is back already."""

    def power_up() -> None:
        if machine.node_id not in simulation.controllers:
            simulation.start_controller(machine)

    simulation.plant.timers.call_at(when_us, power_up)


def power_cut(simulation: BusRun[Any], injection: Injection) -> None:
    """All controllers at once; afterwards each comes back by itself at a moment drawn by chance."""
    chance = random.Random(injection.count("seed"))
    for machine in simulation.site.machines.values():
        if machine.node_id in simulation.controllers:
            simulation.crash(machine)
            when_us = injection.until_us + round(chance.uniform(0, injection.number("spread_s")) * 1e6)
            restart_later(simulation, machine, when_us)


def disk_full(simulation: BusRun[Any], injection: Injection) -> None:
    """No entry can be written; when there is room again the machine is switched off and on by its supervisor."""
    machine = machine_named(simulation, injection.target)
    simulation.journals[machine.node_id].is_full = True

    def room() -> None:
        simulation.journals[machine.node_id].is_full = False
        simulation.crash(machine)
        restart_later(simulation, machine, simulation.loop.now_us() + 1_000_000)

    simulation.plant.timers.call_at(injection.until_us, room)


def pause(simulation: BusRun[Any], injection: Injection) -> None:
    """Stop the process until the fault ends, as SIGSTOP does: it hears and does nothing meanwhile."""
    holon = _holon(simulation, injection)
    if holon is not None:
        holon.pause(injection.until_us)


def drift(simulation: BusRun[Any], injection: Injection) -> None:
    """The clocks are too fast or too slow from now on, until it is over or the controller is restarted."""
    _set_rate(simulation, injection, injection.count("ppm"))


def clock_frozen(simulation: BusRun[Any], injection: Injection) -> None:
    """The clocks stand still: what was due in a moment is not due, and what comes from outside comes at one time."""
    _set_rate(simulation, injection, FROZEN_PPM)


def clock_jump(simulation: BusRun[Any], injection: Injection) -> None:
    """The clocks jump, forwards or backwards."""
    _set_clocks(simulation, injection, jump_us=injection.count("by_ms") * 1000)


def _set_rate(simulation: BusRun[Any], injection: Injection, ppm: int) -> None:
    _set_clocks(simulation, injection, ppm=ppm)
    if injection.number("for_s"):
        # At its rate again, whatever it shows.
        simulation.plant.timers.call_at(injection.until_us, lambda: _set_clocks(simulation, injection, ppm=0))


def _set_clocks(simulation: BusRun[Any], injection: Injection, *, jump_us: int = 0, ppm: int | None = None) -> None:
    for name in injection.target.split("|"):
        controller = simulation.controllers.get(machine_named(simulation, name).node_id)
        if controller is not None:
            assert isinstance(controller.holon, FaultyHolon)
            controller.holon.set_clock(simulation.loop.now_us(), jump_us=jump_us, ppm=ppm)
            controller.look_at_clock()


def slow_node(simulation: BusRun[Any], injection: Injection) -> None:
    """Each frame of the fleet bus costs its processor so much, us."""
    _slow(simulation, injection, None)


def overflow(simulation: BusRun[Any], injection: Injection) -> None:
    """The same behind a queue that is too short."""
    _slow(simulation, injection, injection.count("queue"))


def _slow(simulation: BusRun[Any], injection: Injection, queue: int | None) -> None:
    bus = simulation.fleet_node(injection.target)
    if bus is None:
        return
    before = bus.options
    bus.processing_us = injection.count("processing_us")
    if queue is not None:
        bus.options = replace(before, receive_queue=queue)

    def heal() -> None:
        bus.processing_us = before.processing_us
        bus.options = before

    simulation.plant.timers.call_at(injection.until_us, heal)


def machine_named(simulation: BusRun[Any], name: str) -> Machine:
    """A machine of the site; ``prepare`` has made sure that there is one."""
    return next(machine for machine in simulation.site.machines.values() if machine.name == name)


def _holon(simulation: BusRun[Any], injection: Injection) -> FaultyHolon | None:
    controller = simulation.controllers.get(machine_named(simulation, injection.target).node_id)
    if controller is None:
        return None
    assert isinstance(controller.holon, FaultyHolon)
    return controller.holon
