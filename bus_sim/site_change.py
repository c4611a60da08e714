"""A new site file is rolled out in a run: an operator announces it, and one machine after the other is given it."""

from functools import partial
from typing import Any

from bus_sim.faults.operators import give
from bus_sim.run import BusRun
from onboard.core.site import Machine, Site
from onboard.operate.commands import CommandRequest

#: From one machine to the next, and for how long each is off, us: it answers all that it is asked before the next goes.
APART_US, OFF_US = 6_000_000, 1_000_000
#: The station listens before it announces anything, us, and all are to have heard of it.
HEARD_US = 8_000_000


def roll_out(run: BusRun[Any], old: Site, at_us: int) -> None:
    """Machines begin with the file ``old``; from ``at_us`` on that of the run comes. To be called before the start.

    Machines that only the new file has are off until all others have it.
    """
    run.in_force = dict.fromkeys(old.machines, old)
    asked = CommandRequest("change-site", replaces=old.digest)
    timers = run.plant.timers
    timers.call_at(at_us, lambda: give(run, asked))
    known = [machine for node, machine in run.site.machines.items() if node in old.machines]
    added = [machine for node, machine in run.site.machines.items() if node not in old.machines]
    due_us = at_us + HEARD_US
    for machine in known:
        timers.call_at(due_us, partial(run.crash, machine))
        timers.call_at(due_us + OFF_US, partial(_start, run, machine))
        due_us += APART_US
    for machine in added:
        timers.call_at(due_us, partial(_start, run, machine))
        due_us += APART_US


def _start(run: BusRun[Any], machine: Machine) -> None:
    run.in_force[machine.node_id] = run.site
    if machine.name not in run.options.without and machine.node_id not in run.controllers:
        run.start_controller(machine)
