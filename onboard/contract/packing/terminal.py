"""Bytes of the messages in ``onboard.contract.terminal``, and back.

Written by ``make docs`` from ``dbc/terminal.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.terminal import (
    Action,
    Assignment,
    BoxOrder,
    LaneState,
    PlanHead,
    PlanStep,
    PlanTask,
    StepReport,
    StepResult,
    TaskTerms,
)

_new = tuple.__new__
_ACTION = tuple(Action)
_STEP_RESULT = tuple(StepResult)
_PACK_BBBBHBB = struct.Struct("<BBBBHBB").pack
_PACK_BBHBHB = struct.Struct("<BBHBHB").pack
_PACK_BBHHBX = struct.Struct("<BBHHBx").pack
_PACK_BBIH = struct.Struct("<BBIH").pack
_PACK_BBIXX = struct.Struct("<BBIxx").pack
_PACK_BHHBH = struct.Struct("<BHHBH").pack
_PACK_BHIX = struct.Struct("<BHIx").pack
_UNPACK_BBHBHB = struct.Struct("<BBHBHB").unpack_from
_UNPACK_BBHHBX = struct.Struct("<BBHHBx").unpack_from
_UNPACK_BBIBB = struct.Struct("<BBIBB").unpack_from
_UNPACK_BBIBX = struct.Struct("<BBIBx").unpack_from
_UNPACK_BBIXX = struct.Struct("<BBIxx").unpack_from
_UNPACK_BHHBH = struct.Struct("<BHHBH").unpack_from
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_task_terms(message: TaskTerms) -> bytes:
    task = message.task
    try:
        return _PACK_BHIX(task[0], task[1], message.before_ms)
    except struct.error as error:
        raise refusal(
            message,
            ("TaskTerms.task.origin", 0, 255),
            ("TaskTerms.task.number", 0, 65535),
            ("TaskTerms.before_ms", 0, 4294967295),
        ) from error


def unpack_task_terms(sender: int, data: bytes) -> TaskTerms | None:
    task_origin, task_number, before_ms = _UNPACK_BHIX(data)
    return TaskTerms(sender, _new(Reference, (task_origin, task_number)), before_ms)


def pack_box_order(message: BoxOrder) -> bytes:
    desk = message.desk
    if desk < 1 or desk > 250:
        raise OutOfRangeError("BoxOrder.desk", desk, 1, 250)
    box = message.box
    if box < 1:
        raise OutOfRangeError("BoxOrder.box", box, 1, 65535)
    target = message.target
    if target < 1:
        raise OutOfRangeError("BoxOrder.target", target, 1, 255)
    within_s = message.within_s
    if within_s < 0 or within_s > 32767:
        raise OutOfRangeError("BoxOrder.within_s", within_s, 0, 32767)
    if message.urgent:
        within_s += 0x8000
    try:
        return _PACK_BHHBH(desk, message.number, box, target, within_s)
    except struct.error as error:
        raise refusal(
            message, ("BoxOrder.number", 0, 65535), ("BoxOrder.box", 1, 65535), ("BoxOrder.target", 1, 255)
        ) from error


def unpack_box_order(sender: int, data: bytes) -> BoxOrder | None:
    desk, number, box, target, word_6 = _UNPACK_BHHBH(data)
    if desk < 1 or desk > 250:
        return None
    if box < 1:
        return None
    if target < 1:
        return None
    within_s = word_6 & 0x7FFF
    return BoxOrder(sender, desk, number, box, target, within_s, word_6 & 0x8000 != 0)


def pack_assignment(message: Assignment) -> bytes:
    vehicle = message.vehicle
    if vehicle < 1 or vehicle > 250:
        raise OutOfRangeError("Assignment.vehicle", vehicle, 1, 250)
    task = message.task
    box = message.box
    if box < 1:
        raise OutOfRangeError("Assignment.box", box, 1, 65535)
    target = message.target
    if target < 1:
        raise OutOfRangeError("Assignment.target", target, 1, 255)
    try:
        return _PACK_BBHHBX(vehicle, task[0], task[1], box, target)
    except struct.error as error:
        raise refusal(
            message,
            ("Assignment.task.origin", 0, 255),
            ("Assignment.task.number", 0, 65535),
            ("Assignment.box", 1, 65535),
            ("Assignment.target", 1, 255),
        ) from error


def unpack_assignment(sender: int, data: bytes) -> Assignment | None:
    vehicle, task_origin, task_number, box, target = _UNPACK_BBHHBX(data)
    if vehicle < 1 or vehicle > 250:
        return None
    if box < 1:
        return None
    if target < 1:
        return None
    return Assignment(sender, vehicle, _new(Reference, (task_origin, task_number)), box, target)


def pack_plan_head(message: PlanHead) -> bytes:
    version = message.version
    if version < 1:
        raise OutOfRangeError("PlanHead.version", version, 1, 255)
    steps = message.steps
    if steps < 0 or steps > 31:
        raise OutOfRangeError("PlanHead.steps", steps, 0, 31)
    try:
        return _PACK_BBIXX(version, steps + message.tasks * 0x20, message.begin_ms)
    except struct.error as error:
        raise refusal(
            message, ("PlanHead.version", 1, 255), ("PlanHead.tasks", 0, 7), ("PlanHead.begin_ms", 0, 4294967295)
        ) from error


def unpack_plan_head(sender: int, data: bytes) -> PlanHead | None:
    version, word_1, begin_ms = _UNPACK_BBIXX(data)
    if version < 1:
        return None
    steps = word_1 & 0x1F
    tasks = word_1 >> 5
    return PlanHead(sender, version, steps, tasks, begin_ms)


def pack_plan_step(message: PlanStep) -> bytes:
    version = message.version
    if version < 1:
        raise OutOfRangeError("PlanStep.version", version, 1, 255)
    step = message.step
    if step < 0 or step > 30:
        raise OutOfRangeError("PlanStep.step", step, 0, 30)
    entity = message.entity
    if entity < 1:
        raise OutOfRangeError("PlanStep.entity", entity, 1, 255)
    end_ms = message.end_ms
    after_step = message.after_step
    if after_step > 31:
        raise OutOfRangeError("PlanStep.after_step", after_step, 0, 31)
    try:
        return _PACK_BBBBHBB(
            version, step + message.action * 0x20, entity, end_ms & 0xFF, end_ms >> 8, message.after, after_step
        )
    except struct.error as error:
        raise refusal(
            message,
            ("PlanStep.version", 1, 255),
            ("PlanStep.entity", 1, 255),
            ("PlanStep.end_ms", 0, 16777215),
            ("PlanStep.after", 0, 255),
            ("PlanStep.after_step", 0, 31),
        ) from error


def unpack_plan_step(sender: int, data: bytes) -> PlanStep | None:
    version, word_1, word_2, after, after_step = _UNPACK_BBIBB(data)
    if version < 1:
        return None
    step = word_1 & 0x1F
    if step > 30:
        return None
    action = word_1 >> 5
    if action > 4:
        return None
    entity = word_2 & 0xFF
    if entity < 1:
        return None
    end_ms = word_2 >> 8
    after_step = after_step & 0x1F
    return PlanStep(sender, version, step, _ACTION[action], entity, end_ms, after, after_step)


def pack_plan_task(message: PlanTask) -> bytes:
    version = message.version
    if version < 1:
        raise OutOfRangeError("PlanTask.version", version, 1, 255)
    part = message.part
    if part < 0 or part > 6:
        raise OutOfRangeError("PlanTask.part", part, 0, 6)
    put = message.put
    if put > 30:
        raise OutOfRangeError("PlanTask.put", put, 0, 30)
    box = message.box
    if box < 1:
        raise OutOfRangeError("PlanTask.box", box, 1, 65535)
    task = message.task
    try:
        return _PACK_BBHBHB(version, part + message.pick * 0x8, box, task[0], task[1], put)
    except struct.error as error:
        raise refusal(
            message,
            ("PlanTask.version", 1, 255),
            ("PlanTask.pick", 0, 31),
            ("PlanTask.put", 0, 30),
            ("PlanTask.box", 1, 65535),
            ("PlanTask.task.origin", 0, 255),
            ("PlanTask.task.number", 0, 65535),
        ) from error


def unpack_plan_task(sender: int, data: bytes) -> PlanTask | None:
    version, word_1, box, task_origin, task_number, put = _UNPACK_BBHBHB(data)
    if version < 1:
        return None
    part = word_1 & 0x7
    if part > 6:
        return None
    pick = word_1 >> 3
    if box < 1:
        return None
    put = put & 0x1F
    if put > 30:
        return None
    return PlanTask(sender, version, part, pick, put, box, _new(Reference, (task_origin, task_number)))


def pack_step_report(message: StepReport) -> bytes:
    version = message.version
    if version < 1:
        raise OutOfRangeError("StepReport.version", version, 1, 255)
    step = message.step
    if step < 0 or step > 30:
        raise OutOfRangeError("StepReport.step", step, 0, 30)
    entity = message.entity
    if entity < 1:
        raise OutOfRangeError("StepReport.entity", entity, 1, 255)
    try:
        return _PACK_BBIH(version, entity, message.at_ms, step + message.result * 0x20)
    except struct.error as error:
        raise refusal(
            message, ("StepReport.version", 1, 255), ("StepReport.entity", 1, 255), ("StepReport.at_ms", 0, 4294967295)
        ) from error


def unpack_step_report(sender: int, data: bytes) -> StepReport | None:
    version, entity, at_ms, word_6 = _UNPACK_BBIBX(data)
    if version < 1:
        return None
    if entity < 1:
        return None
    step = word_6 & 0x1F
    if step > 30:
        return None
    result = word_6 >> 5 & 0x3
    if result > 2:
        return None
    return StepReport(sender, version, step, _STEP_RESULT[result], entity, at_ms)


def pack_lane_state(message: LaneState) -> bytes:
    lane = message.lane
    if lane < 1 or lane > 255:
        raise OutOfRangeError("LaneState.lane", lane, 1, 255)
    since_ms = message.since_ms
    if since_ms > 4294967295:
        raise OutOfRangeError("LaneState.since_ms", since_ms, 0, 4294967295)
    if message.blocked:
        lane += 0x100
    try:
        return (lane + since_ms * 0x200).to_bytes(8, "little")
    except OverflowError as error:
        raise refusal(message, ("LaneState.since_ms", 0, 4294967295)) from error


def unpack_lane_state(sender: int, data: bytes) -> LaneState | None:
    (word_0,) = _UNPACK_Q(data)
    lane = word_0 & 0xFF
    if lane < 1:
        return None
    since_ms = word_0 >> 9 & 0xFFFFFFFF
    return LaneState(sender, lane, word_0 & 0x100 != 0, since_ms)


#: Every frame of this module.
FRAMES = (
    FrameCode("TaskTerms", 0x06650000, 8, pack_task_terms, unpack_task_terms, TaskTerms, TaskTerms, ("Desk",), False),
    FrameCode("BoxOrder", 0x06690000, 8, pack_box_order, unpack_box_order, BoxOrder, BoxOrder, ("Gateway",), False),
    FrameCode(
        "Assignment", 0x08660000, 8, pack_assignment, unpack_assignment, Assignment, Assignment, ("Desk",), False
    ),
    FrameCode("PlanHead", 0x0C600000, 8, pack_plan_head, unpack_plan_head, PlanHead, PlanHead, ("Vehicle",), False),
    FrameCode("PlanStep", 0x0C610000, 8, pack_plan_step, unpack_plan_step, PlanStep, PlanStep, ("Vehicle",), False),
    FrameCode("PlanTask", 0x0C620000, 8, pack_plan_task, unpack_plan_task, PlanTask, PlanTask, ("Vehicle",), False),
    FrameCode(
        "StepReport", 0x0E630000, 8, pack_step_report, unpack_step_report, StepReport, StepReport, ("Vehicle",), False
    ),
    FrameCode("LaneState", 0x0E640000, 8, pack_lane_state, unpack_lane_state, LaneState, LaneState, ("Desk",), False),
)
#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).
WORDS = 0x13186359
