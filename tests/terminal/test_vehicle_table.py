"""A vehicle's steps: every action meets whatever its devices may say, and does what its table says and nothing else."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import ManualMode, Reason, TokenKind
from onboard.contract.messages import CarAt, ManualOrder, Reference, TaskReport, TokenRefusal, TokenRequest
from onboard.contract.terminal import Action, HandlerMode, LaneState, MoveMode, StepReport
from onboard.contract.terminal_device import HandlerOrder, HandlerState, MoveOrder, MoveState
from onboard.core.authority import segment_token
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.motion_authority import acts, authorised
from onboard.core.records import TokenHeldRecord
from onboard.core.site import Segment, Site
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.systems.terminal.memory import plan_record
from onboard.systems.terminal.plan import ActionPlan, ActionStep, Load
from onboard.systems.terminal.planner import TURN_US
from onboard.systems.terminal.records import BoxRecord, StepOverRecord
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.steps import TABLE, ActionDeed, ActionFinding
from onboard.systems.terminal.vehicle import Vehicle
from onboard.ways.tokens import car_token

VEHICLE, VERSION, BOX = 11, 1, 1
NOW_US, LATER_US = 100_000_000, 103_000_000


def terminal(site: Site) -> Terminal:
    assert isinstance(site, Terminal)
    return site


SITE = terminal(find_site("terminal"))
NUMBER = {one.name: one.number for one in SITE.entities.values()}
TASK = Reference(SITE.desk, 1)
PLAN = (
    (Action.GOTO, "A1"), (Action.GOTO, "L3"), (Action.GOTO, "C1"), (Action.GOTO, "L2"), (Action.GOTO, "A4"),
    (Action.DOCK, "S2"), (Action.PICK_UP, "S2"), (Action.UNDOCK, "S2"),
    (Action.GOTO, "A4"), (Action.DOCK, "S3"), (Action.PUT_DOWN, "S3"), (Action.UNDOCK, "S3"),
)  # fmt: skip
#: One step of each action, of GOTO one on each kind of entity.
AREA, LANE, CROSSING = 0, 1, 2
STEPS = (AREA, LANE, CROSSING, 5, 6, 7, 10)


@dataclass(frozen=True)
class Words:
    """What drive and handler say, what they were ordered and have not done, what is held back, and by whom."""

    mode: MoveMode = MoveMode.STANDING
    at_end: bool = True
    #: In the last slot of a lane; in an area, crossed to where the plan leads next.
    is_last: bool = False
    is_there: bool = False
    is_moving: bool = False
    gear: HandlerMode = HandlerMode.FREE
    box: int = 0
    is_handling: bool = False
    is_held: bool = False
    has_right: bool = True
    is_closed: bool = False


FLAGS = (False, True)


def words_for(step: int) -> Iterator[Words]:
    """All that may be said in a step: about the way where it is a GOTO, else about the handler."""
    if PLAN[step][0] is Action.GOTO:
        for mode, flags in product(MoveMode, product(FLAGS, repeat=6)):
            at_end, is_last, is_there, is_moving, is_held, is_closed = flags
            yield Words(mode, at_end, is_last, is_there, is_moving, is_held=is_held, is_closed=is_closed)
        return
    for gear, box, flags in product(HandlerMode, (0, BOX), product(FLAGS, repeat=6)):
        at_end, is_there, is_moving, is_handling, is_held, has_right = flags
        yield Words(MoveMode.STANDING, at_end, False, is_there, is_moving, gear, box, is_handling, is_held, has_right)


def place(step: int, words: Words) -> tuple[int, int]:
    """Entity and slot of the body: that of the step, or the one after."""
    action, name = PLAN[step]
    entity = SITE.entities[NUMBER[name]]
    if words.is_there:
        after = NUMBER[PLAN[step + 1][1]] if action is Action.GOTO else entity.area
        return after, 1
    return entity.number, entity.capacity if step == LANE and words.is_last else 1


def vehicle(step: int, words: Words) -> Vehicle:
    """One in this step of its plan, with these words said."""
    steps = tuple(ActionStep(action, NUMBER[name], 1_000_000, LATER_US) for action, name in PLAN)
    plan = ActionPlan(VEHICLE, VERSION, NOW_US, steps, (Load(BOX, TASK, 6, 10),))
    here, box = place(step, words), car_token(*SITE.box(BOX))
    entries = [plan_record(plan).entry, *(StepOverRecord(VERSION, one, NOW_US).entry for one in range(step))]
    entries.append(TokenHeldRecord(TokenKind.SEGMENT, segment_token(Segment(*here)).number, 1, VEHICLE).entry)
    if words.has_right:
        entries.append(TokenHeldRecord(box.kind, box.number, 1, VEHICLE).entry)
    machine = SITE.machines[VEHICLE]
    behaviour = Holon(SITE, machine, factory_for(SITE, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(behaviour, Vehicle)
    behaviour.fleet.tokens.trust()
    behaviour.fleet.motion.why_still = acts
    behaviour.start(NOW_US)
    say(behaviour, step, words, here)
    return behaviour


def say(one: Vehicle, step: int, words: Words, here: tuple[int, int]) -> None:
    body, free = one.body, authorised(one.fleet.motion, ())
    following = NUMBER[PLAN[step + 1][1]] if PLAN[step][0] is Action.GOTO else 0
    # Where the step begins, before what is said since.
    one.sense(MoveState(VEHICLE, 0, NUMBER[PLAN[step][1]], 1, MoveMode.STANDING, at_end=False), NOW_US)
    one.sense(HandlerState(VEHICLE, 0, HandlerMode.FREE, 0), NOW_US)
    if step == AREA and words.is_last and not words.is_there:
        body.go(free, *here, following, NOW_US)
    if words.is_handling:
        body.gear.order((Action.DOCK, 0), free, LATER_US - 1)
    one.sense(MoveState(VEHICLE, body.drive.sequence, *here, words.mode, words.at_end), NOW_US)
    one.sense(HandlerState(VEHICLE, 0, words.gear, words.box), NOW_US)
    if words.is_moving:
        body.drive.order((250, 1, 0), free, LATER_US - 1)
    if words.is_held:
        one.hear(ManualOrder(251, VEHICLE, 1, ManualMode.HELD), NOW_US)
    if words.is_closed:
        one.hear(LaneState(SITE.desk, following, blocked=True, since_ms=NOW_US // 1000), NOW_US)


def meant(step: int, words: Words) -> ActionFinding:
    """What the words come to, told once more."""
    action = PLAN[step][0]
    if action is Action.GOTO:
        return _meant_on_way(step, words)
    if action is Action.PICK_UP and not words.has_right:
        return ActionFinding.NO_RIGHT
    if action is Action.UNDOCK and words.is_there:
        return ActionFinding.DONE
    if action is Action.UNDOCK and words.gear is HandlerMode.FREE and not words.is_handling:
        return (
            ActionFinding.AT_WORK if words.is_moving else ActionFinding.HELD if words.is_held else ActionFinding.AT_END
        )
    is_done = {
        Action.DOCK: words.gear is HandlerMode.DOCKED,
        Action.PICK_UP: words.box == BOX,
        Action.PUT_DOWN: words.box == 0,
        Action.UNDOCK: False,
    }[action]
    if is_done and not words.is_handling:
        return ActionFinding.DONE
    cannot_yet = action is Action.DOCK and (words.is_moving or not words.at_end)
    if words.is_handling or cannot_yet:
        return ActionFinding.AT_WORK
    if words.is_held:
        return ActionFinding.HELD
    return ActionFinding.FAILED if words.gear is HandlerMode.FAILED else ActionFinding.READY


def _meant_on_way(step: int, words: Words) -> ActionFinding:
    if words.is_there:
        return ActionFinding.DONE
    if words.is_moving:
        return ActionFinding.AT_WORK
    if words.mode is MoveMode.BLOCKED:
        return ActionFinding.OBSTACLE
    if words.is_held:
        return ActionFinding.HELD
    if step == LANE and not words.is_last:
        return ActionFinding.IN_LANE
    if step == AREA and not words.is_last:
        return ActionFinding.CROSSES_ELSEWHERE
    return ActionFinding.CLOSED if words.is_closed else ActionFinding.AT_END


def expected(step: int, words: Words) -> list[object]:
    """What the table's deed orders, writes and tells; rights to what comes next are still to be had."""
    action, name = PLAN[step]
    over: list[object] = [("over", step), "DONE"]
    entity, slot = place(step, words)
    is_ready = words.at_end and words.mode is MoveMode.STANDING and not words.is_moving
    following = NUMBER[PLAN[step + 1][1]] if step + 1 < len(PLAN) else 0
    onward = NUMBER[PLAN[step + 2][1]] if step + 2 < len(PLAN) else 0
    said: dict[ActionDeed, list[object]] = {
        ActionDeed.WAIT: [],
        ActionDeed.END: over,
        ActionDeed.END_ABOARD: ["box", "LOADED", *over],
        ActionDeed.END_PUT_DOWN: [("stands", NUMBER[name]), "box", "DONE", *over],
        ActionDeed.TELL_OBSTACLE: ["BLOCKED"],
        ActionDeed.TELL_FAILURE: ["FAILED"],
        ActionDeed.NEXT_SLOT: [("asks", Segment(entity, slot + 1))],
        ActionDeed.CROSS: [("goes", entity, following)],
        ActionDeed.NEXT_ENTITY: [("asks", Segment(following, 1))],
        # In an area nobody needs a right.
        ActionDeed.BACK_TO_AREA: [("goes", SITE.entities[entity].area, onward)] if is_ready else [],
        ActionDeed.ASK_FOR_BOX: [("asks", BOX)],
        ActionDeed.HANDLE: [action] if words.has_right or action is not Action.PUT_DOWN else [],
    }
    return said[TABLE[action, meant(step, words)]]


def told(effects: list[Effect], known: int = -1) -> Iterator[object]:
    """``known``: the number of the order that the drive is at."""
    for one in effects:
        match one:
            case Actuate(MoveOrder() as order) if order.sequence == known:
                yield "goes on in", order.entity, order.slot
            case Actuate(MoveOrder() as order):
                yield "goes", order.entity, order.towards
            case Actuate(HandlerOrder() as order):
                yield order.action
            case Record(StepOverRecord() as record):
                yield "over", record.step
            case Record(BoxRecord() as record):
                yield "stands", record.station
            case Send(StepReport() as report):
                yield report.result.name
            case Send(TaskReport() as report):
                yield report.phase.name
            case Send(CarAt()):
                yield "box"
            case Send(TokenRequest() as request):
                number = request.token
                is_slot = request.token_kind is TokenKind.SEGMENT
                yield "asks", Segment(number >> 8, number & 0xFF) if is_slot else number & 0xFFFF


@pytest.mark.parametrize("step", STEPS)
def test_every_action_meets_every_word_of_drive_and_handler(step: int) -> None:
    for words in words_for(step):
        one = vehicle(step, words)
        # Who is held says first that it has come to rest; a drive that crosses a slot hears its order again.
        assert one.body.move is not None
        said = list(told(one.advance(LATER_US), one.body.move.sequence))
        crosses = [("goes on in", *place(step, words))] if not (words.at_end or words.is_moving) else []
        assert said[: len(crosses)] == crosses, words
        said = said[len(crosses) :] or list(told(one.advance(LATER_US)))
        assert said == expected(step, words), (words, meant(step, words))


def test_a_line_of_the_table_is_for_what_can_be() -> None:
    assert {(PLAN[step][0], meant(step, words)) for step in STEPS for words in words_for(step)} == set(TABLE)


def test_who_is_refused_its_box_waits_for_it_and_goes_on() -> None:
    """The right to a box was read as one to a way: the vehicle halted, with a person needed."""
    one = vehicle(STEPS[-3], Words(gear=HandlerMode.DOCKED, has_right=False))
    assert list(told(one.advance(LATER_US))) == [("asks", BOX)]
    key = car_token(*SITE.box(BOX))
    one.fleet.tokens.on_refusal(
        TokenRefusal(SITE.desk, key.kind, key.number, 1, VEHICLE, Reason.TOKEN_NOT_GRANTABLE_YET), LATER_US
    )
    assert key in one.fleet.tokens.refused
    for turn in range(60):
        one.advance(LATER_US + turn * TURN_US)
