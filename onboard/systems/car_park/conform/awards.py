"""Awards and what is won, as far as nothing moves: chapters 4, 6 and 7 of docs/protocol.md."""

from collections.abc import Generator

from onboard.conform.cast import Cast, silent
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import SECOND, Play, Stage, Wait, Word, after_ms
from onboard.contract.codes import CallResult, Grade, LegAction, Reason, TaskPhase, TokenKind
from onboard.contract.messages import Award, CallForProposals, Itinerary, Reference, TaskReport, TokenRequest
from onboard.systems.car_park.conform.desk import Desk

_ONLY = "I act on a task only when `Award` names me with AWARDED."
_ANSWER = (
    "The answer to an award is a new FIRM itinerary with the award's stamp (a "
    "machine without plans: none) and `TaskReport` AWARDED with the station where "
    "the load will be."
)
_AGAIN = "An award for me that is heard again is answered with how the task stands"
_LOST = (
    "A task in hand that is not begun is lost by `Award` AWARDED to another under a"
    " newer `task_version`, REJECTED of my call, or WITHDRAWN, from its initiator."
)
_UNKNOWN = (
    "An award for me, in a call that I do not know (0: who says it has forgotten "
    "the call), is answered like one that is heard again"
)

#: Awards that give it nothing: result, whom they name ("me", "other", "nobody"), who says them.
_NOTHING: dict[str, tuple[CallResult, str, str]] = {
    "award-to-another-is-not-mine": (CallResult.AWARDED, "other", "caller"),
    "award-to-nobody-is-not-mine": (CallResult.AWARDED, "nobody", "caller"),
    "refused-is-no-award": (CallResult.REFUSED, "nobody", "caller"),
    "reopened-is-no-award": (CallResult.REOPENED, "nobody", "caller"),
    "rejected-is-no-award": (CallResult.REJECTED, "nobody", "caller"),
    "withdrawn-is-no-award": (CallResult.WITHDRAWN, "nobody", "caller"),
    "option-is-no-award": (CallResult.OPTION, "me", "caller"),
    "award-of-a-stranger-is-none": (CallResult.AWARDED, "me", "stranger"),
}
NOTHING = tuple(Check(name, "B9", _ONLY) for name in _NOTHING)


def nothing(stage: Stage, cast: Cast) -> Play:
    """It bids best, and what is said then is no award for it."""
    desk = Desk(stage, cast, 0x0600, 500)
    desk.place_car()
    cast.answer = silent
    for name, (result, winner, sender) in _NOTHING.items():
        call = desk.call()
        bid = yield from desk.asks(call, withdraws=False)
        if bid is None:
            continue
        begin_us = stage.now_us
        whom = {"me": stage.node, "other": stage.other or stage.stranger, "nobody": 0}[winner]
        said_by = {"caller": stage.caller, "stranger": stage.stranger}[sender]
        desk.award(call, whom, result, sender=said_by)
        yield from stage.pause(1.5)
        stage.none_of(name, _acts(stage, begin_us), "it acts on it")
        desk.withdraw(call)
        yield from stage.pause(0.3)


def _acts(stage: Stage, begin_us: int) -> list[Word]:
    plans = [one for one in stage.since(Itinerary, begin_us) if one.message.grade is Grade.FIRM]
    return [*plans, *stage.since(TaskReport, begin_us), *stage.since(TokenRequest, begin_us)]


WON = (
    Check("award-is-answered-with-a-plan", "U1", _ANSWER),
    Check(
        "plan-has-the-awards-stamp",
        "P7",
        ("The stamp is the deadline, initiator and low byte of the call that gave the task."),
    ),
    Check("award-is-answered-with-a-report", "U1", _ANSWER),
    Check("report-names-the-place", "U1", _ANSWER),
    Check("report-names-the-task", "U1", _ANSWER),
    Check("answer-is-prompt", "A3", "for as long as the winner is not heard"),
    Check("plan-works-at-the-bay", "P3", "WORK is at the station beside `to_index` on `side`."),
    Check("plan-works-at-the-place", "P3", "WORK is at the station beside `to_index` on `side`."),
    Check("plan-keeps-its-bid", "B2", "What it promises it keeps as well as it can"),
    Check("award-again-is-answered", "U3", _AGAIN),
    Check("award-again-makes-no-new-plan", "U3", _AGAIN),
    Check("award-of-a-forgotten-call-is-answered", "U4", _UNKNOWN),
    Check("asks-for-its-way", "K9", "I ask for a token with `TokenRequest`"),
    Check("older-award-to-another-changes-nothing", "U6", _LOST),
    Check("withdrawn-task-is-dropped", "U6", "It is dropped, and its plan is told anew."),
    Check("withdrawn-task-asks-no-more", "K9", "I say no request for what I do not need any more."),
    Check("withdrawn-task-is-not-mine", "U3", "or FORFEITED where I do not have it"),
)


def won(stage: Stage, cast: Cast) -> Play:
    """It wins; the award is said again; then it is taken back."""
    desk = Desk(stage, cast, 0x0700, 600)
    desk.place_car()
    cast.answer = silent
    call, bid = yield from desk.wins()
    if bid is None:
        return
    awarded_us = stage.now_us
    report = yield from stage.hears(TaskReport, lambda one: one.phase is TaskPhase.AWARDED, 3.0)
    plan = yield from stage.hears(Itinerary, lambda one: one.grade is Grade.FIRM, 3.0, awarded_us)
    stage.judge("award-is-answered-with-a-plan", plan, "no firm itinerary within 3 s", plan)
    stage.judge("award-is-answered-with-a-report", report, "no TaskReport AWARDED within 3 s", report)
    if plan is not None and report is not None:
        _judge_answer(stage, desk, call, bid, plan, report, awarded_us)
    asks = yield from stage.hears(TokenRequest, within_s=15.0, since_us=awarded_us)
    stage.judge("asks-for-its-way", asks, "no TokenRequest within 15 s", asks)
    for name, number in (("award-again-is-answered", call.call), ("award-of-a-forgotten-call-is-answered", 0)):
        again_us = stage.now_us
        desk.award(call, stage.node, call=number)
        answer = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 2.0)
        stage.judge(name, answer and answer.message.phase is TaskPhase.AWARDED, "not answered AWARDED", answer)
        if number:
            plans = (
                [one for one in stage.since(Itinerary, again_us) if one.message.version != plan.message.version]
                if plan
                else []
            )
            stage.none_of("award-again-makes-no-new-plan", plans, "another plan")
        yield from stage.pause(1.0)
    begin_us = stage.now_us
    desk.award(call, stage.other or stage.stranger, task_version=1, call=0)
    yield from stage.pause(1.0)
    drops = [one for one in stage.since(Itinerary, begin_us) if not _works(one.message)]
    stage.none_of("older-award-to-another-changes-nothing", drops, "dropped the task")
    yield from _dropped(stage, desk, call)


def _judge_answer(
    stage: Stage, desk: Desk, call: CallForProposals, bid: Word, plan: Word, report: Word, awarded_us: int
) -> None:
    told: Itinerary = plan.message
    stamp = (told.stamp.award_ms, told.stamp.initiator, told.stamp.call)
    wanted = (call.deadline_ms, call.sender, call.call & 0xFF)
    stage.judge("plan-has-the-awards-stamp", stamp == wanted, f"{stamp}, not {wanted}", plan)
    stage.judge("report-names-the-task", report.message.task == call.task, "another task", report)
    places = {place.number for place in desk.site.places}
    stage.judge("report-names-the-place", report.message.station in places, "no place of the site", report)
    is_prompt = max(plan.time_us, report.time_us) - awarded_us <= stage.site.timing.award_repeat_us
    stage.judge("answer-is-prompt", is_prompt, "only after the award was to be said again", plan, report)
    works = [leg.track << 8 | leg.side << 7 | leg.to_index for leg in told.legs if leg.action is LegAction.WORK]
    stage.judge("plan-works-at-the-bay", works[:1] == [desk.bay.number], "its first work is elsewhere", plan)
    stage.judge("plan-works-at-the-place", works[1:2] == [report.message.station], "its second work is elsewhere", plan)
    ends = [leg.end_ms for leg in told.legs if leg.action is LegAction.WORK]
    late_ms = after_ms(ends[-1], bid.message.cost) if ends else 0
    stage.judge("plan-keeps-its-bid", ends and abs(late_ms) <= 1_000, f"{late_ms} ms later than bid", bid, plan)


def _works(plan: Itinerary) -> bool:
    return any(leg.action is LegAction.WORK for leg in plan.legs)


def _dropped(stage: Stage, desk: Desk, call: CallForProposals) -> Play:
    begin_us = stage.now_us
    desk.withdraw(call)
    plan = yield from stage.hears(Itinerary, lambda one: not _works(one), 3.0)
    stage.judge("withdrawn-task-is-dropped", plan, "no plan without the task within 3 s", plan)
    yield from stage.pause(6.0)
    asks = [one for one in stage.since(TokenRequest, begin_us + SECOND) if one.message.token_kind is TokenKind.CAR]
    slots = stage.since(TokenRequest, begin_us + SECOND)
    stage.none_of("withdrawn-task-asks-no-more", [*asks, *slots], "asks for its way still")
    desk.award(call, stage.node, call=0)
    answer = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 2.0)
    is_kept = answer is not None and answer.message.phase is TaskPhase.FORFEITED
    stage.judge("withdrawn-task-is-not-mine", is_kept, "not answered FORFEITED", answer)
    yield from stage.pause(2.0)


OTHERS = (
    Check("newer-award-to-another-drops-it", "U6", _LOST),
    Check("rejected-task-is-dropped", "U6", _LOST),
    Check("award-of-an-unknown-task-is-answered", "U4", _UNKNOWN),
    Check("unknown-task-is-forfeited", "U3", "or FORFEITED where I do not have it"),
    Check("award-of-an-unknown-call-to-another-is-not-answered", "U4", "An award for me, in a call that I do not know"),
    Check("withdrawal-of-an-unknown-call-is-not-answered", "U4", "An award for me, in a call that I do not know"),
    Check("late-award-counts", "B9", "An award that comes after `T_belief` still counts"),
    Check("gives-its-bid-up-after-T-belief", "B7", "or `T_belief` after the deadline."),
    Check("withdrawal-of-a-stranger-is-none", "U6", "from its initiator."),
)


def others(stage: Stage, cast: Cast) -> Play:
    """What is won goes to another, comes late, or was never called for."""
    desk = Desk(stage, cast, 0x0800, 700)
    desk.place_car()
    cast.answer = silent
    for name, result, changes in (
        ("newer-award-to-another-drops-it", CallResult.AWARDED, {"task_version": 2}),
        ("rejected-task-is-dropped", CallResult.REJECTED, {}),
    ):
        call, bid = yield from desk.wins()
        yield from stage.pause(1.0)
        if bid is None:
            continue
        winner = stage.caller if result is CallResult.AWARDED else 0
        begin_us = stage.now_us
        desk.award(call, winner, result, **changes)
        plan = yield from stage.hears(Itinerary, lambda one: not _works(one), 3.0, begin_us)
        stage.judge(name, plan, "no plan without the task within 3 s", plan)
        desk.withdraw(call)
        yield from stage.pause(2.0)
    task = Reference(stage.caller, 9_999)
    begin_us = stage.now_us
    desk.award(desk.call(), stage.node, task=task)
    answer = yield from stage.hears(TaskReport, lambda one: one.task == task, 2.0)
    stage.judge("award-of-an-unknown-task-is-answered", answer, "no answer within 2 s", answer)
    forfeited = answer is not None and answer.message.phase is TaskPhase.FORFEITED
    stage.judge("unknown-task-is-forfeited", forfeited, "not FORFEITED", answer)
    for name, winner, result in (
        ("award-of-an-unknown-call-to-another-is-not-answered", stage.other or stage.stranger, CallResult.AWARDED),
        ("withdrawal-of-an-unknown-call-is-not-answered", stage.node, CallResult.WITHDRAWN),
    ):
        task = Reference(stage.caller, 9_998)
        begin_us = stage.now_us
        stage.say(Award(stage.caller, 0x0EEE, winner, task, 1, result, Reason.NONE))
        yield from stage.pause(1.5)
        told = [one for one in stage.since(TaskReport, begin_us) if one.message.task == task]
        stage.none_of(name, told, "it answers")
    yield from _late(stage, desk)


def _late(stage: Stage, desk: Desk) -> Play:
    call = desk.call()
    bid = yield from desk.asks(call, withdraws=False)
    if bid is None:
        return
    yield from stage.pause(12.0)
    yield from _given_up(stage, desk)
    desk.award(call, stage.node)
    answer = yield from stage.hears(TaskReport, lambda one: one.task == call.task, 2.0)
    is_kept = answer is not None and answer.message.phase is TaskPhase.AWARDED
    stage.judge("late-award-counts", is_kept, "not answered AWARDED", bid, answer)
    begin_us = stage.now_us
    desk.award(call, 0, CallResult.WITHDRAWN, sender=stage.stranger)
    yield from stage.pause(1.0)
    drops = [one for one in stage.since(Itinerary, begin_us) if not _works(one.message)]
    stage.none_of("withdrawal-of-a-stranger-is-none", drops, "dropped the task")
    desk.withdraw(call)
    yield from stage.pause(2.0)


def _given_up(stage: Stage, desk: Desk) -> Generator[Wait, None, None]:
    """What it kept for a bid is free: another call costs what it costs an idle robot."""
    call = desk.call()
    bid = yield from desk.asks(call)
    if bid is not None:
        over_ms = desk.over_ms(call, bid)
        least_ms = desk.floor_over_ms()
        is_free = over_ms <= least_ms + desk.approach_us() // 1000
        stage.judge("gives-its-bid-up-after-T-belief", is_free, f"{over_ms - least_ms} ms above the floor", bid)


SCENES = (
    Scene("no award", NOTHING, nothing),
    Scene("award", WON, won),
    Scene("other awards", OTHERS, others),
)
