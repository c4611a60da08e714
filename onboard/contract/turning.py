"""What the machines of the system turning say beyond the messages of all.

Written by ``make docs`` from ``dbc/turning.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, message


class LathePhase(IntEnum):
    """How far an order is, as LatheProgress says it."""

    QUEUED = 0
    SETTING_UP = 1
    TURNING = 2
    FINISHED = 3


class LatheAction(IntEnum):
    """Orders to a lathe's numerical control."""

    SET_UP = 0
    MAKE = 1


class NcMode(IntEnum):
    """What a numerical control does; HELD, it heard no order for too long and stands; ALARM needs a person."""

    READY = 0
    SETTING = 1
    RUNNING = 2
    ALARM = 3
    HELD = 4


@message(frozen=True, slots=True)
class TurningOrder(Message):
    """What is to be turned.

    Sent before each call for it.
    """

    #: Serial number of the order at its desk. 0 to 65535.
    task: int
    #: Number of the drawing in the site file. 0 to 255.
    drawing: int
    #: Number of the material in the site file. 0 to 255.
    material: int
    #: How many parts, 1 or more. 1 to 4095.
    batch: int
    #: Diameter of the bar. 1 to 4095 mm.
    bar_mm: int
    #: How much longer than the part the bar is at its face. 0 to 25500 um.
    face_um: int


@message(frozen=True, slots=True)
class BillCutting(Message):
    """Terms of a bid: machining and tools.

    Sent with BillWaiting and BillBar before the bid.
    """

    #: Node-ID of the desk that called. 1 to 255.
    manager: int
    #: Serial number of the order at its desk. 0 to 65535.
    task: int
    #: Machining: hourly cost times duration, cents for one part. 0 to 1048575 ct.
    machining_ct: int
    #: Wear of the tools, cents for one part. 0 to 1048575 ct.
    tools_ct: int


@message(frozen=True, slots=True)
class BillWaiting(Message):
    """Terms of a bid: setup and latencies."""

    #: Node-ID of the desk that called. 1 to 255.
    manager: int
    #: Serial number of the order at its desk. 0 to 65535.
    task: int
    #: Share of the setup, cents for one part. 0 to 1048575 ct.
    setup_ct: int
    #: Loading and unloading, cents for one part. 0 to 1048575 ct.
    latency_ct: int


@message(frozen=True, slots=True)
class BillBar(Message):
    """Terms of a bid: the bar, and the sum of all five."""

    #: Node-ID of the desk that called. 1 to 255.
    manager: int
    #: Serial number of the order at its desk. 0 to 65535.
    task: int
    #: Raw material, cents for one part. 0 to 1048575 ct.
    material_ct: int
    #: Sum of the five terms, cents for one part. 0 to 1048575 ct.
    total_ct: int


@message(frozen=True, slots=True)
class LatheProgress(Message):
    """How far an order is: sent on change and every 10 s while it is worked on."""

    #: Node-ID of the desk. 1 to 255.
    manager: int
    #: Serial number of the order at its desk. 0 to 65535.
    task: int
    #: Parts made. 0 to 4095.
    made: int
    #: Parts wanted. 0 to 4095.
    batch: int
    #: What the lathe does.
    lathe_phase: LathePhase
