"""What the machines of the system turning say beyond the messages of all, on their device buses.

Written by ``make docs`` from ``dbc/turning.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, message
from onboard.contract.codes import OrderResult
from onboard.contract.turning import LatheAction, NcMode


@message(frozen=True, slots=True)
class ProgramText(Message):
    """Five characters of an ISO program (7-bit ASCII, the first in the lowest byte, zeros behind the end)."""

    #: Number of the program in this upload. 0 to 255.
    program: int
    #: Which five characters, from 0. 0 to 65535.
    index: int
    #: The characters. 0 to 1099511627775.
    text: int


@message(frozen=True, slots=True)
class ProgramEnd(Message):
    """The program is whole: how long it is and its check sum.

    Sent until NcState names the program.
    """

    #: Number of the program. 0 to 255.
    program: int
    #: Characters. 0 to 16777215.
    length: int
    #: CRC-16/CCITT-FALSE over the characters. 0 to 65535.
    crc: int


@message(frozen=True, slots=True)
class LatheOrder(Message):
    """One action.

    A new sequence starts it. Repeated every second while the control works; a control that hears none for
    DriveTimeOutMs stands in the middle of its work, and goes on when its order is said again.
    """

    #: Grows by one with every new action. 0 to 255.
    sequence: int
    #: What to do.
    lathe_action: LatheAction
    #: Jaws to mount, by their rank in the site file. 0 to 15.
    chuck: int
    #: Tools whose edges are to be changed before: bit 0 is tool 1. 0 to 65535.
    edges: int


@message(frozen=True, slots=True)
class JobAnswer(Message):
    """What becomes of an order: sent on change and every 2 s until it is over."""

    #: Serial number of the order. 0 to 65535.
    number: int
    #: What became of it.
    job_result: OrderResult
    #: Node-ID of the lathe, 0 for none. 0 to 255.
    winner: int
    #: Price of one part, cents; 0 before it is known. 0 to 1048575 ct.
    total_ct: int


@message(frozen=True, slots=True)
class NcState(Message):
    """The control: sent on change and every 2 s."""

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: What it does.
    nc_mode: NcMode
    #: Program that is loaded whole, 0 for none. 0 to 255.
    program: int
    #: Parts made since it was set up, modulo 65536. 0 to 65535.
    parts: int


@message(frozen=True, slots=True)
class ToolState(Message):
    """How long the edge of one tool has cut: sent on change and every 10 s."""

    #: Number in the turret. 1 to 255.
    tool: int
    #: Time under feed. 0 to 4294967295 ms.
    used_ms: int


@message(frozen=True, slots=True)
class JobEntry(Message):
    """A person orders turned parts.

    Sent again until JobAnswer names the order.
    """

    #: Serial number of the order. 0 to 65535.
    number: int
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
