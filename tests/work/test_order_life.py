"""The life of an order: every state meets every event, at a desk of each system that has one."""

from collections.abc import Iterable
from itertools import product

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import (
    CONTRACT_VERSION,
    CallResult,
    Criterion,
    KindCode,
    MachineState,
    Operation,
    Reason,
    TaskPhase,
)
from onboard.contract.messages import Award, CallForProposals, Heartbeat, Reference, TaskReport
from onboard.core.effects import Record, Send
from onboard.core.negotiation import Closed
from onboard.holon.holon import Holon
from onboard.systems.cell.contracts import Goal
from onboard.systems.cell.desk import GoalOrder
from onboard.systems.cell.geometry import Point
from onboard.systems.graph.desk import Visits
from onboard.systems.registry import factory_for
from onboard.systems.turning.desk import BatchOrder
from onboard.systems.turning.lathe import TurningJob
from onboard.work.order_desk import CUT_OFF_US, OrderDesk
from onboard.work.order_life import NEXT, OVER, OrderEvent, OrderState, WorkOrder

TASK = Reference(9, 1)
GOAL = Goal(TASK, TASK, Point(10_000, 10_000), Point(40_000, 30_000), (), 0)
ORDERS: dict[str, WorkOrder] = {
    "cell": GoalOrder(TASK, GOAL),
    "graph": Visits(TASK, (4, 6)),
    "turning": BatchOrder(TASK, TurningJob(1, 1, 16)),
}
NOW_US = 5_000_000


def desk_of(system: str, entries: Iterable[Record] = ()) -> OrderDesk[WorkOrder]:
    """The site's desk, as it starts with these records."""
    site = find_site(system)
    machine = next(one for one in site.machines.values() if one.kind is KindCode.DESK)
    holon = Holon(site, machine, factory_for(site, machine.kind), boot=1, entries=[one.entry for one in entries])
    desk = holon.behaviour
    assert isinstance(desk, OrderDesk)
    return desk


@pytest.mark.parametrize("system", ORDERS)
@pytest.mark.parametrize(("state", "event"), list(product(OrderState, OrderEvent)))
def test_every_state_meets_every_event(system: str, state: OrderState, event: OrderEvent) -> None:
    desk, order = desk_of(system), type(ORDERS[system])(**vars(ORDERS[system]))
    written = [one for one in desk.come_in(order, NOW_US) if isinstance(one, Record)]
    order.state, order.answer_at_us, order.due_us = state, None, None
    effects = desk.put(order, event, NOW_US)
    following = NEXT.get((state, event))
    if following is None:
        assert (effects, order.state, order.answer_at_us, order.due_us) == ([], state, None, None)
        return
    assert [order.state, order.answer_at_us] == [following, NOW_US], "the counter is told"
    assert (order.due_us is None) is (following in (*OVER, OrderState.CALLED)), "asked after, or called for again"
    # What is written says the same after a restart; only a call is made anew, and somebody may have won it.
    again = desk_of(system, [*written, *(one for one in effects if isinstance(one, Record))]).orders[TASK]
    kept = OrderState.HEARD if following is OrderState.CALLED else following
    assert (again.state, again.may_be_won) == (kept, kept is OrderState.HEARD)


@pytest.mark.parametrize("system", ORDERS)
@pytest.mark.parametrize("state", OVER)
def test_who_missed_that_an_order_was_taken_back_hears_so_when_it_claims_it(system: str, state: OrderState) -> None:
    """A desk was cut off for minutes, and its customers were refused: the lathe made the parts all the same."""
    desk, order = desk_of(system), type(ORDERS[system])(**vars(ORDERS[system]))
    desk.come_in(order, NOW_US)
    mine, other = sorted(one.node_id for one in desk.fleet.site.machines.values() if one.kind is desk.takers)[:2]
    order.state, order.winner = state, mine
    for node in (mine, other):
        said = desk.hear(TaskReport(node, TASK, TaskPhase.AWARDED, 0, Reason.NONE), NOW_US)
        is_its = state is OrderState.DONE and node == mine
        awards = [one.message for one in said if isinstance(one, Send) and isinstance(one.message, Award)]
        assert [one.result for one in awards] == ([] if is_its else [CallResult.REJECTED])
        assert desk.hear(TaskReport(node, TASK, TaskPhase.STARTED, 0, Reason.NONE), NOW_US) == [], "it is begun"


def test_nothing_follows_what_is_over_and_all_else_comes_to_an_end() -> None:
    assert not [state for state, _ in NEXT if state in OVER]
    for state in OrderState:
        reached = {state}
        while more := {to for (from_, _), to in NEXT.items() if from_ in reached} - reached:
            reached |= more
        assert OrderState.DONE in reached or state is OrderState.REFUSED


@pytest.mark.parametrize("system", ["cell", "turning"])
@pytest.mark.parametrize("is_heard", [True, False])
def test_who_hears_nobody_at_all_refuses_nobody(system: str, is_heard: bool) -> None:
    """A desk's cable was cut for two minutes, and its customers were sent away: no machine had refused anything."""
    desk, order = desk_of(system), type(ORDERS[system])(**vars(ORDERS[system]))
    desk.come_in(order, NOW_US)
    machine = next(one for one in desk.fleet.site.machines.values() if one.kind is desk.takers)
    if is_heard:
        desk.fleet.mirror.on_heartbeat(
            Heartbeat(machine.node_id, CONTRACT_VERSION, 0, 0, 1, machine.kind, MachineState.IDLE), NOW_US
        )
    order.state, order.calls = OrderState.CALLED, desk.max_calls or 0
    call = CallForProposals(
        desk.fleet.node_id, 7, TASK, Operation.MACHINE, machine.kind, Criterion.MONEY, 5, 0, 0, 0, 0, Reference(0, 0), 0
    )
    desk.negotiated(Closed(call, 0, CallResult.REFUSED, Reason.NO_BID, 5), NOW_US)
    assert order.state is (OrderState.REFUSED if is_heard else OrderState.HEARD)
    assert is_heard or order.due_us == NOW_US + CUT_OFF_US


@pytest.mark.parametrize("system", ORDERS)
@pytest.mark.parametrize("is_heard", [True, False])
def test_who_is_alone_on_the_bus_calls_for_nothing(system: str, is_heard: bool) -> None:
    """Its calls waited in the interface for ten minutes, some of their awards found no room, and all came at once."""
    desk, order = desk_of(system), type(ORDERS[system])(**vars(ORDERS[system]))
    desk.come_in(order, NOW_US)
    machine = next(one for one in desk.fleet.site.machines.values() if one.kind is desk.takers)
    beat = Heartbeat(machine.node_id, CONTRACT_VERSION, 0, 0, 1, machine.kind, MachineState.IDLE)
    if is_heard:
        desk.fleet.mirror.on_heartbeat(beat, NOW_US)
    desk.advance(NOW_US)
    assert order.state is (OrderState.CALLED if is_heard else OrderState.HEARD)
    if not is_heard:
        assert order.due_us is not None and NOW_US < order.due_us <= NOW_US + 3_000_000
        desk.fleet.mirror.on_heartbeat(beat, order.due_us)
        desk.advance(order.due_us)
        assert order.state is OrderState.CALLED, "and for what waits as soon as somebody has come"
