"""For imports that are not rewritten yet: ``onboard.contract.turning``."""

from onboard.contract.codes import OrderResult
from onboard.contract.turning import (
    BillBar,
    BillCutting,
    BillWaiting,
    LatheAction,
    LathePhase,
    LatheProgress,
    NcMode,
    TurningOrder,
)
from onboard.contract.turning_device import JobAnswer, JobEntry, LatheOrder, NcState, ProgramEnd, ProgramText, ToolState
from onboard.systems.turning.fields import CHUNK, crc16, text_frames

__all__ = [
    "CHUNK",
    "BillBar",
    "BillCutting",
    "BillWaiting",
    "JobAnswer",
    "JobEntry",
    "LatheAction",
    "LatheOrder",
    "LathePhase",
    "LatheProgress",
    "NcMode",
    "NcState",
    "OrderResult",
    "ProgramEnd",
    "ProgramText",
    "ToolState",
    "TurningOrder",
    "crc16",
    "text_frames",
]
