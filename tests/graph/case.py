"""The factory graph, for the tests of every system."""

from bus_sim.systems.orders import OrderArrivals
from onboard.contract.graph import EdgeNotice, EdgeState, NodeAnswer, NodeVerdict, RobotAt, RobotMode, TurnSignal
from tests.conformance.case import Case
from tests.graph.sites import busy_orders, hall, made


def _at(robot: int, behind: int, node: int) -> RobotAt:
    return RobotAt(robot, behind, node, True, RobotMode.DRIVING, 255, 255, 255, node)


CASE = Case(
    system="graph",
    site="graph",
    options=("--for", "150"),
    busy=lambda: made(hall(), (0, 4, 8), busy_orders(hall(), 5, 7)),
    struck_s=lambda _: (12.0, 100.0),
    limit_s=900,
    orders=OrderArrivals(3, 20.0),
    parties=(9, 21, 22),
    broken={
        "one-an-edge": [[_at(21, 0, 1), _at(22, 1, 0)], [_at(21, 0, 8)]],
        "no-turning-back": [[_at(21, 0, 1), _at(21, 1, 0)]],
        "agents-of-nodes": [[EdgeNotice(2, 0, 1, EdgeState.FREE, 0)]],
        "grants-are-told": [
            [NodeAnswer(1, 21, 0, NodeVerdict.STOP, 1, 0)],
            [TurnSignal(21, 0, 255, 1), NodeAnswer(1, 21, 0, NodeVerdict.GO, 1, 1), *(_at(22, 4, 5),) * 4],
        ],
    },
    words=(
        ["transport order 4", "N1 to N7"],
        ["drives from N"],
        ["token slot 1 of N5", "stop1 N4", "order 4"],
    ),
    drawn=["N0", "N7", "R1", "R3"],
)
