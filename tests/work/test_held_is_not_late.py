"""Who was held, by a person or a stop, is not left out of the next calls for having been late."""

from collections.abc import Callable

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from onboard.contract.codes import Criterion, KindCode, ManualMode, Reason
from onboard.contract.messages import Halted, ManualState, Message, Reference
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for

LATE_US = 300_000_000


def held(node: int) -> Message:
    return ManualState(node, 1, ManualMode.HELD, at_rest=True)


def stopped(node: int) -> Message:
    return Halted(node, node, Reason.EMERGENCY_STOP, 251, needs_person=False, boot=1)


def let_go(node: int) -> Message:
    return ManualState(node, 1, ManualMode.AUTOMATIC, at_rest=True)


@pytest.mark.parametrize("system", ["small", "terminal", "graph", "cell", "turning"])
@pytest.mark.parametrize(("says", "is_out"), [(held, False), (stopped, False), (let_go, True)])
def test_what_a_machine_is_late_while_it_is_held_counts_for_nothing(
    system: str, says: Callable[[int], Message], is_out: bool
) -> None:
    """Of two robots one was held for four minutes, and out of all calls for two more (drawn car parks, 5690)."""
    site = find_site(system)
    caller = next(one for one in site.machines.values() if one.kind in (KindCode.DESK, KindCode.COMPARTMENT))
    good, late = [node for node, one in site.machines.items() if one.kind is simulated_of(site).worker][:2]
    desk = Holon(site, caller, factory_for(site, caller.kind))
    desk.start(0)
    trust, tasks = desk.negotiation.trust, [Reference(caller.node_id, number) for number in (1, 2, 3)]
    for task, node in zip(tasks, (good, late, late), strict=True):
        trust.given(task, node, 0, Criterion.FINISH_TIME)
    trust.done(tasks[0], good, 0)
    desk.receive(says(late), 1)
    for after_us, task in enumerate(tasks[1:]):
        trust.done(task, late, LATE_US + after_us)
    assert trust.left_out(Reference(caller.node_id, 9), LATE_US + 9, last_attempt=True) == ({late} if is_out else set())
