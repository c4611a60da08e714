"""A vehicle that is started again plans from where its drive says that it stands, not from its home."""

from bus_sim.sites import find_site
from onboard.contract.messages import Reference
from onboard.contract.terminal import Assignment, HandlerMode, MoveMode, PlanStep
from onboard.contract.terminal_device import HandlerState, MoveState
from onboard.core.effects import Send
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.systems.terminal.planner import TURN_US
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import Vehicle

VEHICLE, BOX, NOW_US = 11, 4, 100_000_000


def test_the_first_step_after_a_restart_is_where_it_stands() -> None:
    """It took itself for at home, ordered a way that does not begin where it was, and stood for good (drawn 1044)."""
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    number = {one.name: one.number for one in site.entities.values()}
    machine, here = site.machines[VEHICLE], number["A4"]
    assert here != machine.home.track
    # What it had done was done, so that its journal has no plan.
    one = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=()).behaviour
    assert isinstance(one, Vehicle)
    one.start(NOW_US)
    one.sense(MoveState(VEHICLE, 7, here, 1, MoveMode.STANDING, at_end=True), NOW_US)
    one.sense(HandlerState(VEHICLE, 3, HandlerMode.FREE, 0), NOW_US)
    one.hear(Assignment(site.desk, VEHICLE, Reference(site.desk, 1), BOX, number["S10"]), NOW_US)
    said = [effect for turn in range(20) for effect in one.advance(NOW_US + turn * TURN_US)]
    steps = [one.message for one in said if isinstance(one, Send) and isinstance(one.message, PlanStep)]
    assert steps and steps[0].entity == here
