"""Bytes of the messages in ``onboard.contract.terminal``, and back.

Written by ``make docs`` from ``dbc/terminal.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference
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
_BBHHBX = Struct("<BBHHBx")
_BBIBB = Struct("<BBIBB")
_BBIXX = Struct("<BBIxx")
_BHHBH = Struct("<BHHBH")
_BHIX = Struct("<BHIx")
_Q = Struct("<Q")


def pack_task_terms(message: TaskTerms) -> bytes:
    task_origin = message.task.origin
    if not 0 <= task_origin <= 255:
        raise OutOfRangeError("TaskTerms.task_origin", task_origin, 0, 255)
    task_number = message.task.number
    if not 0 <= task_number <= 65535:
        raise OutOfRangeError("TaskTerms.task_number", task_number, 0, 65535)
    before_ms = message.before_ms
    if not 0 <= before_ms <= 4294967295:
        raise OutOfRangeError("TaskTerms.before_ms", before_ms, 0, 4294967295)
    return _BHIX.pack(task_origin, task_number, before_ms)


def unpack_task_terms(sender: int, data: bytes) -> TaskTerms | None:
    task_origin, task_number, before_ms = _BHIX.unpack_from(data)
    return TaskTerms(sender, _new(Reference, (task_origin, task_number)), before_ms)


def pack_box_order(message: BoxOrder) -> bytes:
    desk = message.desk
    if not 1 <= desk <= 250:
        raise OutOfRangeError("BoxOrder.desk", desk, 1, 250)
    number = message.number
    if not 0 <= number <= 65535:
        raise OutOfRangeError("BoxOrder.number", number, 0, 65535)
    box = message.box
    if not 1 <= box <= 65535:
        raise OutOfRangeError("BoxOrder.box", box, 1, 65535)
    target = message.target
    if not 1 <= target <= 255:
        raise OutOfRangeError("BoxOrder.target", target, 1, 255)
    within_s = message.within_s
    if not 0 <= within_s <= 32767:
        raise OutOfRangeError("BoxOrder.within_s", within_s, 0, 32767)
    return _BHHBH.pack(desk, number, box, target, within_s + message.urgent * 0x8000)


def unpack_box_order(sender: int, data: bytes) -> BoxOrder | None:
    desk, number, box, target, word_6 = _BHHBH.unpack_from(data)
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
    if not 1 <= vehicle <= 250:
        raise OutOfRangeError("Assignment.vehicle", vehicle, 1, 250)
    task_origin = message.task.origin
    if not 0 <= task_origin <= 255:
        raise OutOfRangeError("Assignment.task_origin", task_origin, 0, 255)
    task_number = message.task.number
    if not 0 <= task_number <= 65535:
        raise OutOfRangeError("Assignment.task_number", task_number, 0, 65535)
    box = message.box
    if not 1 <= box <= 65535:
        raise OutOfRangeError("Assignment.box", box, 1, 65535)
    target = message.target
    if not 1 <= target <= 255:
        raise OutOfRangeError("Assignment.target", target, 1, 255)
    return _BBHHBX.pack(vehicle, task_origin, task_number, box, target)


def unpack_assignment(sender: int, data: bytes) -> Assignment | None:
    vehicle, task_origin, task_number, box, target = _BBHHBX.unpack_from(data)
    if vehicle < 1 or vehicle > 250:
        return None
    if box < 1:
        return None
    if target < 1:
        return None
    return Assignment(sender, vehicle, _new(Reference, (task_origin, task_number)), box, target)


def pack_plan_head(message: PlanHead) -> bytes:
    version = message.version
    if not 1 <= version <= 255:
        raise OutOfRangeError("PlanHead.version", version, 1, 255)
    steps = message.steps
    if not 0 <= steps <= 31:
        raise OutOfRangeError("PlanHead.steps", steps, 0, 31)
    tasks = message.tasks
    if not 0 <= tasks <= 7:
        raise OutOfRangeError("PlanHead.tasks", tasks, 0, 7)
    begin_ms = message.begin_ms
    if not 0 <= begin_ms <= 4294967295:
        raise OutOfRangeError("PlanHead.begin_ms", begin_ms, 0, 4294967295)
    return _BBIXX.pack(version, steps + tasks * 0x20, begin_ms)


def unpack_plan_head(sender: int, data: bytes) -> PlanHead | None:
    version, word_1, begin_ms = _BBIXX.unpack_from(data)
    if version < 1:
        return None
    steps = word_1 & 0x1F
    tasks = word_1 >> 5
    return PlanHead(sender, version, steps, tasks, begin_ms)


def pack_plan_step(message: PlanStep) -> bytes:
    version = message.version
    if not 1 <= version <= 255:
        raise OutOfRangeError("PlanStep.version", version, 1, 255)
    step = message.step
    if not 0 <= step <= 30:
        raise OutOfRangeError("PlanStep.step", step, 0, 30)
    entity = message.entity
    if not 1 <= entity <= 255:
        raise OutOfRangeError("PlanStep.entity", entity, 1, 255)
    end_ms = message.end_ms
    if not 0 <= end_ms <= 16777215:
        raise OutOfRangeError("PlanStep.end_ms", end_ms, 0, 16777215)
    after = message.after
    if not 0 <= after <= 255:
        raise OutOfRangeError("PlanStep.after", after, 0, 255)
    after_step = message.after_step
    if not 0 <= after_step <= 31:
        raise OutOfRangeError("PlanStep.after_step", after_step, 0, 31)
    return _BBIBB.pack(version, step + message.action * 0x20, entity + end_ms * 0x100, after, after_step)


def unpack_plan_step(sender: int, data: bytes) -> PlanStep | None:
    version, word_1, word_2, after, after_step = _BBIBB.unpack_from(data)
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
    if not 1 <= version <= 255:
        raise OutOfRangeError("PlanTask.version", version, 1, 255)
    part = message.part
    if not 0 <= part <= 6:
        raise OutOfRangeError("PlanTask.part", part, 0, 6)
    pick = message.pick
    if not 0 <= pick <= 31:
        raise OutOfRangeError("PlanTask.pick", pick, 0, 31)
    put = message.put
    if not 0 <= put <= 30:
        raise OutOfRangeError("PlanTask.put", put, 0, 30)
    box = message.box
    if not 1 <= box <= 65535:
        raise OutOfRangeError("PlanTask.box", box, 1, 65535)
    task_origin = message.task.origin
    if not 0 <= task_origin <= 255:
        raise OutOfRangeError("PlanTask.task_origin", task_origin, 0, 255)
    task_number = message.task.number
    if not 0 <= task_number <= 65535:
        raise OutOfRangeError("PlanTask.task_number", task_number, 0, 65535)
    return _Q.pack(
        version
        + part * 0x100
        + pick * 0x800
        + put * 0x10000
        + (box + task_origin * 0x10000) * 0x200000
        + task_number * 0x200000000000
    )


def unpack_plan_task(sender: int, data: bytes) -> PlanTask | None:
    (word_0,) = _Q.unpack_from(data)
    version = word_0 & 0xFF
    if version < 1:
        return None
    part = word_0 >> 8 & 0x7
    if part > 6:
        return None
    pick = word_0 >> 11 & 0x1F
    put = word_0 >> 16 & 0x1F
    if put > 30:
        return None
    box = word_0 >> 21 & 0xFFFF
    if box < 1:
        return None
    task_origin = word_0 >> 37 & 0xFF
    task_number = word_0 >> 45 & 0xFFFF
    return PlanTask(sender, version, part, pick, put, box, _new(Reference, (task_origin, task_number)))


def pack_step_report(message: StepReport) -> bytes:
    version = message.version
    if not 1 <= version <= 255:
        raise OutOfRangeError("StepReport.version", version, 1, 255)
    step = message.step
    if not 0 <= step <= 30:
        raise OutOfRangeError("StepReport.step", step, 0, 30)
    entity = message.entity
    if not 1 <= entity <= 255:
        raise OutOfRangeError("StepReport.entity", entity, 1, 255)
    at_ms = message.at_ms
    if not 0 <= at_ms <= 4294967295:
        raise OutOfRangeError("StepReport.at_ms", at_ms, 0, 4294967295)
    return _Q.pack(version + step * 0x100 + message.result * 0x2000 + entity * 0x8000 + at_ms * 0x800000)


def unpack_step_report(sender: int, data: bytes) -> StepReport | None:
    (word_0,) = _Q.unpack_from(data)
    version = word_0 & 0xFF
    if version < 1:
        return None
    step = word_0 >> 8 & 0x1F
    if step > 30:
        return None
    result = word_0 >> 13 & 0x3
    if result > 2:
        return None
    entity = word_0 >> 15 & 0xFF
    if entity < 1:
        return None
    at_ms = word_0 >> 23 & 0xFFFFFFFF
    return StepReport(sender, version, step, _STEP_RESULT[result], entity, at_ms)


def pack_lane_state(message: LaneState) -> bytes:
    lane = message.lane
    if not 1 <= lane <= 255:
        raise OutOfRangeError("LaneState.lane", lane, 1, 255)
    since_ms = message.since_ms
    if not 0 <= since_ms <= 4294967295:
        raise OutOfRangeError("LaneState.since_ms", since_ms, 0, 4294967295)
    return _Q.pack(lane + message.blocked * 0x100 + since_ms * 0x200)


def unpack_lane_state(sender: int, data: bytes) -> LaneState | None:
    (word_0,) = _Q.unpack_from(data)
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
