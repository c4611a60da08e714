"""The manufacturing cell, for the tests of every system."""

from bus_sim.systems.orders import OrderArrivals
from onboard.contract.cell import ArmPhase, ArmProgress, GoalPath, OfferHigh, OfferLow, PartAt
from onboard.contract.messages import Bid, CallForProposals, Message, Reference
from onboard.systems.cell.fields import halves
from tests.cell.playing import cell, goal_demand
from tests.conformance.case import Case

PART = Reference(9, 1)


def _offer(node: int, initiator: int, call: int, task: Reference, cost: int) -> list[Message]:
    """A bid is thousandths of what its offer says."""
    high, low = halves(cost / 1000)
    offer = [OfferHigh(node, task.origin, task.number, high), OfferLow(node, task.origin, task.number, low)]
    return [*offer, Bid(node, initiator, call, cost, 0)]


def _by_predecessor(messages: list[tuple[int, Message]]) -> list[tuple[int, Message]]:
    """Who works on a goal bids for what it has called for itself."""
    path = next(one for _, one in messages if isinstance(one, GoalPath) and one.node1)
    at, call = next(
        (number, one)
        for number, (_, one) in enumerate(messages)
        if isinstance(one, CallForProposals) and one.task == (path.sender, path.goal)
    )
    return [*messages[: at + 1], (messages[at][0], Bid(path.node1, call.sender, call.call, 1, 0))]


CASE = Case(
    system="cell",
    site="cell",
    busy=lambda: cell(goal_demand((10, 10), (40, 30)), goal_demand((40, 30), (30, 5), at_s=20, within_s=600)),
    struck_s=lambda _: (14.0, 102.0),
    limit_s=1_200,
    orders=OrderArrivals(3, 20.0),
    parties=(9, 1, 2),
    bidding=_offer,
    broken={
        "inside-area": [[ArmProgress(1, 23_000, 10_000, ArmPhase.CARRYING, 1)]],
        "part-passed-on": [[PartAt(node, PART, 22_000, True, 10_000) for node in (1, 2, 1)]],
    },
    broken_in={"predecessors": _by_predecessor},
    words=(
        ["reach part 1", "(10.0, 10.0) m to (40.0, 30.0) m"],
        ["carries the part"],
        ["token part 1", "part 1"],
    ),
    drawn=["GM", "R1", "R5", "part 1"],
)
