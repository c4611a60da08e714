"""Bytes of the messages in ``onboard.contract.turning``, and back.

Written by ``make docs`` from ``dbc/turning.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError
from onboard.contract.turning import BillBar, BillCutting, BillWaiting, LathePhase, LatheProgress, TurningOrder

_LATHE_PHASE = tuple(LathePhase)
_BHIX = Struct("<BHIx")
_HBIB = Struct("<HBIB")
_Q = Struct("<Q")


def pack_turning_order(message: TurningOrder) -> bytes:
    task = message.task
    if not 0 <= task <= 65535:
        raise OutOfRangeError("TurningOrder.task", task, 0, 65535)
    drawing = message.drawing
    if not 0 <= drawing <= 255:
        raise OutOfRangeError("TurningOrder.drawing", drawing, 0, 255)
    material = message.material
    if not 0 <= material <= 255:
        raise OutOfRangeError("TurningOrder.material", material, 0, 255)
    batch = message.batch
    if not 1 <= batch <= 4095:
        raise OutOfRangeError("TurningOrder.batch", batch, 1, 4095)
    bar_mm = message.bar_mm
    if not 1 <= bar_mm <= 4095:
        raise OutOfRangeError("TurningOrder.bar_mm", bar_mm, 1, 4095)
    face_um = message.face_um
    if not 0 <= face_um <= 25500:
        raise OutOfRangeError("TurningOrder.face_um", face_um, 0, 25500)
    return _HBIB.pack(task, drawing, material + batch * 0x100 + bar_mm * 0x100000, face_um // 100)


def unpack_turning_order(sender: int, data: bytes) -> TurningOrder | None:
    task, drawing, word_3, face_um = _HBIB.unpack_from(data)
    material = word_3 & 0xFF
    batch = word_3 >> 8 & 0xFFF
    if batch < 1:
        return None
    bar_mm = word_3 >> 20
    if bar_mm < 1:
        return None
    face_um = face_um * 100
    return TurningOrder(sender, task, drawing, material, batch, bar_mm, face_um)


def pack_bill_cutting(message: BillCutting) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("BillCutting.manager", manager, 1, 255)
    task = message.task
    if not 0 <= task <= 65535:
        raise OutOfRangeError("BillCutting.task", task, 0, 65535)
    machining_ct = message.machining_ct
    if not 0 <= machining_ct <= 1048575:
        raise OutOfRangeError("BillCutting.machining_ct", machining_ct, 0, 1048575)
    tools_ct = message.tools_ct
    if not 0 <= tools_ct <= 1048575:
        raise OutOfRangeError("BillCutting.tools_ct", tools_ct, 0, 1048575)
    return _Q.pack(manager + task * 0x100 + machining_ct * 0x1000000 + tools_ct * 0x100000000000)


def unpack_bill_cutting(sender: int, data: bytes) -> BillCutting | None:
    (word_0,) = _Q.unpack_from(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    task = word_0 >> 8 & 0xFFFF
    machining_ct = word_0 >> 24 & 0xFFFFF
    tools_ct = word_0 >> 44
    return BillCutting(sender, manager, task, machining_ct, tools_ct)


def pack_bill_waiting(message: BillWaiting) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("BillWaiting.manager", manager, 1, 255)
    task = message.task
    if not 0 <= task <= 65535:
        raise OutOfRangeError("BillWaiting.task", task, 0, 65535)
    setup_ct = message.setup_ct
    if not 0 <= setup_ct <= 1048575:
        raise OutOfRangeError("BillWaiting.setup_ct", setup_ct, 0, 1048575)
    latency_ct = message.latency_ct
    if not 0 <= latency_ct <= 1048575:
        raise OutOfRangeError("BillWaiting.latency_ct", latency_ct, 0, 1048575)
    return _Q.pack(manager + task * 0x100 + setup_ct * 0x1000000 + latency_ct * 0x100000000000)


def unpack_bill_waiting(sender: int, data: bytes) -> BillWaiting | None:
    (word_0,) = _Q.unpack_from(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    task = word_0 >> 8 & 0xFFFF
    setup_ct = word_0 >> 24 & 0xFFFFF
    latency_ct = word_0 >> 44
    return BillWaiting(sender, manager, task, setup_ct, latency_ct)


def pack_bill_bar(message: BillBar) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("BillBar.manager", manager, 1, 255)
    task = message.task
    if not 0 <= task <= 65535:
        raise OutOfRangeError("BillBar.task", task, 0, 65535)
    material_ct = message.material_ct
    if not 0 <= material_ct <= 1048575:
        raise OutOfRangeError("BillBar.material_ct", material_ct, 0, 1048575)
    total_ct = message.total_ct
    if not 0 <= total_ct <= 1048575:
        raise OutOfRangeError("BillBar.total_ct", total_ct, 0, 1048575)
    return _Q.pack(manager + task * 0x100 + material_ct * 0x1000000 + total_ct * 0x100000000000)


def unpack_bill_bar(sender: int, data: bytes) -> BillBar | None:
    (word_0,) = _Q.unpack_from(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    task = word_0 >> 8 & 0xFFFF
    material_ct = word_0 >> 24 & 0xFFFFF
    total_ct = word_0 >> 44
    return BillBar(sender, manager, task, material_ct, total_ct)


def pack_lathe_progress(message: LatheProgress) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("LatheProgress.manager", manager, 1, 255)
    task = message.task
    if not 0 <= task <= 65535:
        raise OutOfRangeError("LatheProgress.task", task, 0, 65535)
    made = message.made
    if not 0 <= made <= 4095:
        raise OutOfRangeError("LatheProgress.made", made, 0, 4095)
    batch = message.batch
    if not 0 <= batch <= 4095:
        raise OutOfRangeError("LatheProgress.batch", batch, 0, 4095)
    return _BHIX.pack(manager, task, made + batch * 0x1000 + message.lathe_phase * 0x1000000)


def unpack_lathe_progress(sender: int, data: bytes) -> LatheProgress | None:
    manager, task, word_3 = _BHIX.unpack_from(data)
    if manager < 1:
        return None
    made = word_3 & 0xFFF
    batch = word_3 >> 12 & 0xFFF
    lathe_phase = word_3 >> 24 & 0xF
    if lathe_phase > 3:
        return None
    return LatheProgress(sender, manager, task, made, batch, _LATHE_PHASE[lathe_phase])


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "TurningOrder",
        0x05B00000,
        8,
        pack_turning_order,
        unpack_turning_order,
        TurningOrder,
        TurningOrder,
        ("Desk",),
        False,
    ),
    FrameCode(
        "BillCutting",
        0x08B10000,
        8,
        pack_bill_cutting,
        unpack_bill_cutting,
        BillCutting,
        BillCutting,
        ("Lathe",),
        False,
    ),
    FrameCode(
        "BillWaiting",
        0x08B20000,
        8,
        pack_bill_waiting,
        unpack_bill_waiting,
        BillWaiting,
        BillWaiting,
        ("Lathe",),
        False,
    ),
    FrameCode("BillBar", 0x08B30000, 8, pack_bill_bar, unpack_bill_bar, BillBar, BillBar, ("Lathe",), False),
    FrameCode(
        "LatheProgress",
        0x0EB40000,
        8,
        pack_lathe_progress,
        unpack_lathe_progress,
        LatheProgress,
        LatheProgress,
        ("Lathe",),
        False,
    ),
)
