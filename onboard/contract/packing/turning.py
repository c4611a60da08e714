"""Bytes of the messages in ``onboard.contract.turning``, and back.

Written by ``make docs`` from ``dbc/turning.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.turning import BillBar, BillCutting, BillWaiting, LathePhase, LatheProgress, TurningOrder

_LATHE_PHASE = tuple(LathePhase)
_PACK_BHBHH = struct.Struct("<BHBHH").pack
_PACK_BHBI = struct.Struct("<BHBI").pack
_PACK_HBBBHB = struct.Struct("<HBBBHB").pack
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from
_UNPACK_HBIB = struct.Struct("<HBIB").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_turning_order(message: TurningOrder) -> bytes:
    batch = message.batch
    if batch < 1 or batch > 4095:
        raise OutOfRangeError("TurningOrder.batch", batch, 1, 4095)
    bar_mm = message.bar_mm
    if bar_mm < 1:
        raise OutOfRangeError("TurningOrder.bar_mm", bar_mm, 1, 4095)
    face_um = message.face_um
    if face_um < 0 or face_um > 25500:
        raise OutOfRangeError("TurningOrder.face_um", face_um, 0, 25500)
    try:
        return _PACK_HBBBHB(
            message.task, message.drawing, message.material, batch & 0xFF, (batch >> 8) + bar_mm * 0x10, face_um // 100
        )
    except struct.error as error:
        raise refusal(
            message,
            ("TurningOrder.task", 0, 65535),
            ("TurningOrder.drawing", 0, 255),
            ("TurningOrder.material", 0, 255),
            ("TurningOrder.bar_mm", 1, 4095),
        ) from error


def unpack_turning_order(sender: int, data: bytes) -> TurningOrder | None:
    task, drawing, word_3, face_um = _UNPACK_HBIB(data)
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
    if manager < 1:
        raise OutOfRangeError("BillCutting.manager", manager, 1, 255)
    machining_ct = message.machining_ct
    if machining_ct < 0 or machining_ct > 1048575:
        raise OutOfRangeError("BillCutting.machining_ct", machining_ct, 0, 1048575)
    try:
        return _PACK_BHBI(manager, message.task, machining_ct & 0xFF, (machining_ct >> 8) + message.tools_ct * 0x1000)
    except struct.error as error:
        raise refusal(
            message,
            ("BillCutting.manager", 1, 255),
            ("BillCutting.task", 0, 65535),
            ("BillCutting.tools_ct", 0, 1048575),
        ) from error


def unpack_bill_cutting(sender: int, data: bytes) -> BillCutting | None:
    (word_0,) = _UNPACK_Q(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    task = word_0 >> 8 & 0xFFFF
    machining_ct = word_0 >> 24 & 0xFFFFF
    tools_ct = word_0 >> 44
    return BillCutting(sender, manager, task, machining_ct, tools_ct)


def pack_bill_waiting(message: BillWaiting) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("BillWaiting.manager", manager, 1, 255)
    setup_ct = message.setup_ct
    if setup_ct < 0 or setup_ct > 1048575:
        raise OutOfRangeError("BillWaiting.setup_ct", setup_ct, 0, 1048575)
    try:
        return _PACK_BHBI(manager, message.task, setup_ct & 0xFF, (setup_ct >> 8) + message.latency_ct * 0x1000)
    except struct.error as error:
        raise refusal(
            message,
            ("BillWaiting.manager", 1, 255),
            ("BillWaiting.task", 0, 65535),
            ("BillWaiting.latency_ct", 0, 1048575),
        ) from error


def unpack_bill_waiting(sender: int, data: bytes) -> BillWaiting | None:
    (word_0,) = _UNPACK_Q(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    task = word_0 >> 8 & 0xFFFF
    setup_ct = word_0 >> 24 & 0xFFFFF
    latency_ct = word_0 >> 44
    return BillWaiting(sender, manager, task, setup_ct, latency_ct)


def pack_bill_bar(message: BillBar) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("BillBar.manager", manager, 1, 255)
    material_ct = message.material_ct
    if material_ct < 0 or material_ct > 1048575:
        raise OutOfRangeError("BillBar.material_ct", material_ct, 0, 1048575)
    try:
        return _PACK_BHBI(manager, message.task, material_ct & 0xFF, (material_ct >> 8) + message.total_ct * 0x1000)
    except struct.error as error:
        raise refusal(
            message, ("BillBar.manager", 1, 255), ("BillBar.task", 0, 65535), ("BillBar.total_ct", 0, 1048575)
        ) from error


def unpack_bill_bar(sender: int, data: bytes) -> BillBar | None:
    (word_0,) = _UNPACK_Q(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    task = word_0 >> 8 & 0xFFFF
    material_ct = word_0 >> 24 & 0xFFFFF
    total_ct = word_0 >> 44
    return BillBar(sender, manager, task, material_ct, total_ct)


def pack_lathe_progress(message: LatheProgress) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("LatheProgress.manager", manager, 1, 255)
    made = message.made
    if made < 0 or made > 4095:
        raise OutOfRangeError("LatheProgress.made", made, 0, 4095)
    try:
        return _PACK_BHBHH(manager, message.task, made & 0xFF, (made >> 8) + message.batch * 0x10, message.lathe_phase)
    except struct.error as error:
        raise refusal(
            message,
            ("LatheProgress.manager", 1, 255),
            ("LatheProgress.task", 0, 65535),
            ("LatheProgress.batch", 0, 4095),
        ) from error


def unpack_lathe_progress(sender: int, data: bytes) -> LatheProgress | None:
    manager, task, word_3 = _UNPACK_BHIX(data)
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
#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).
WORDS = 0xB886FFCA
