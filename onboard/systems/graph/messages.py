"""For imports that are not rewritten yet: ``onboard.contract.graph``."""

from onboard.contract.codes import OrderResult
from onboard.contract.graph import (
    BodyPlace,
    EdgeNotice,
    EdgeState,
    NodeAnswer,
    NodeVerdict,
    RobotAt,
    RobotMode,
    RouteAction,
    TurnSignal,
    VisitList,
)
from onboard.contract.graph_device import ApproachSensor, BodyState, RouteOrder, VisitAnswer, VisitKey
from onboard.systems.graph.fields import NO_NODE, five, stops_of

__all__ = [
    "NO_NODE",
    "ApproachSensor",
    "BodyPlace",
    "BodyState",
    "EdgeNotice",
    "EdgeState",
    "NodeAnswer",
    "NodeVerdict",
    "OrderResult",
    "RobotAt",
    "RobotMode",
    "RouteAction",
    "RouteOrder",
    "TurnSignal",
    "VisitAnswer",
    "VisitKey",
    "VisitList",
    "five",
    "stops_of",
]
