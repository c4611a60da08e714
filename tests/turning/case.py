"""The turning cell, for the tests of every system."""

from dataclasses import replace

from bus_sim.sites import find_site
from bus_sim.systems.orders import OrderArrivals
from onboard.contract.codes import Reason, TaskPhase
from onboard.contract.messages import Bid, Message, Reference, TaskReport
from onboard.contract.turning import BillBar, BillCutting, BillWaiting, LathePhase, LatheProgress
from onboard.systems.turning.lathe import TurningJob
from onboard.systems.turning.site import BatchDemand, Turning
from tests.conformance.case import Case

TASK = Reference(9, 1)


def shipped(*orders: BatchDemand) -> Turning:
    """The shipped site, with other orders."""
    site = find_site("turning")
    assert isinstance(site, Turning)
    return replace(site, orders=orders or site.orders)


def _bill(node: int, initiator: int, call: int, task: Reference, cost: int) -> list[Message]:
    """A bid is the sum of its bill."""
    return [
        BillCutting(node, task.origin, task.number, cost, 0),
        BillWaiting(node, task.origin, task.number, 0, 0),
        BillBar(node, task.origin, task.number, 0, cost),
        Bid(node, initiator, call, cost, 0),
    ]


def _has(node: int) -> TaskReport:
    return TaskReport(node, TASK, TaskPhase.AWARDED, 0, Reason.NONE)


def _made(made: int, batch: int = 4) -> LatheProgress:
    return LatheProgress(1, TASK.origin, TASK.number, made, batch, LathePhase.TURNING)


CASE = Case(
    system="turning",
    site="turning",
    options=("--for", "900"),
    busy=lambda: shipped(
        BatchDemand(0, TurningJob(1, 2, 14, 2)),
        BatchDemand(5_000, TurningJob(2, 1, 45, 1)),
        BatchDemand(20_000, TurningJob(1, 1, 16, 2)),
    ),
    # Half of them strike while calls are open, half over the whole of the work.
    struck_s=lambda seed: (10.0, 36.4) if seed % 4 < 2 else (10.0, 714.0),
    limit_s=20_000,
    orders=OrderArrivals(2, 30.0),
    parties=(9, 1, 2),
    bidding=_bill,
    broken={
        "bills-add-up": [[BillCutting(1, 9, 1, 100, 0), BillWaiting(1, 9, 1, 10, 10), BillBar(1, 9, 1, 50, 900)]],
        "one-lathe": [[_has(1), _has(2)], [_made(3), _made(2)], [_made(5)]],
    },
    words=(
        ["machine order 1, 6 x pin"],
        ["turns order 1"],
        ["drawing pin", "material brass", "total 226 ct"],
    ),
    drawn=["L1", "L3", "order 1, 6 x pin"],
)
