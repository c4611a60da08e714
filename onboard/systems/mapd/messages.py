"""For imports that are not rewritten yet: ``onboard.contract.mapd``."""

from onboard.contract.codes import OrderResult
from onboard.contract.mapd import (
    CartAction,
    PathHead,
    PathMoves,
    StepRound,
    StepState,
    StepTurn,
    TurnRequest,
)
from onboard.contract.mapd_device import CartOrder, CartState, TransportAnswer, TransportKey
from onboard.systems.mapd.fields import LAST_STEP, MOST_MOVES, MOST_WAYS, MOVE_BITS, MOVES_A_FRAME, NO_TASK

__all__ = [
    "LAST_STEP",
    "MOST_MOVES",
    "MOST_WAYS",
    "MOVES_A_FRAME",
    "MOVE_BITS",
    "NO_TASK",
    "CartAction",
    "CartOrder",
    "CartState",
    "OrderResult",
    "PathHead",
    "PathMoves",
    "StepRound",
    "StepState",
    "StepTurn",
    "TransportAnswer",
    "TransportKey",
    "TurnRequest",
]
