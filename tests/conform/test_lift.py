"""The kit on a site with a lift: our robot keeps to all that is judged there, and each check can fail."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import pytest

from onboard.conform.checks import Verdict
from onboard.conform.report import frame_words, lines_of
from onboard.conform.stage import Stage
from onboard.conform.suite import scenes_of
from onboard.contract.codes import CallResult, KindCode, LegAction, Reason, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    Call,
    CallLoad,
    CallParent,
    CarAt,
    Heartbeat,
    ItineraryLeg,
    Progress,
    Reference,
    SyncRequest,
    TaskReport,
    TokenGrant,
    TokenRequest,
)
from onboard.core.frame import Frame
from onboard.core.negotiation import sub_calls
from onboard.core.negotiation.bidding import last_bid_us
from onboard.core.negotiation.participant import Participant
from onboard.core.site import Timing
from onboard.systems.car_park import asking, riding, sill
from onboard.systems.car_park.asking import AskingGeneration
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.ride_calls import rides_of
from onboard.systems.car_park.sill import SillProof
from tests.conform.bench import SITES, play

LIFT = SITES[3]
OF_LIFTS = [one for one in scenes_of(LIFT) if one.needs_lift]
#: What a word of the node becomes on its way to the kit.
Change = Callable[[Stage, Any], Iterable[Any]]


class Fault(NamedTuple):
    """A robot that is wrong in one way, the scene in which it is seen, and checks that it breaks, by words of each.

    ``says`` makes what it says wrong; ``does`` is what is wrong in our robot: an owner, a name and what is there now.
    """

    scene: str
    breaks: str
    says: Callable[[], Change] | None = None
    does: tuple[tuple[Any, str, Any], ...] = ()


def says(monkeypatch: pytest.MonkeyPatch, change: Change) -> None:
    """The node's words come to the kit, and to the fleet that it plays, as ``change`` has them."""
    hear = Stage.hear

    def heard(stage: Stage, frame: Frame) -> None:
        part = stage.codec.decode_part(frame) if frame.arbitration_id & 0xFF == stage.node else Reason.NONE
        if isinstance(part, Reason):
            hear(stage, frame)
            return
        for said in change(stage, part):
            for one in [frame] if said is part else stage.codec.encode(said):
                hear(stage, one)

    monkeypatch.setattr(Stage, "hear", heard)


def never(kind: type, **fields: object) -> Callable[[], Change]:
    """Words of a kind with these fields are not said."""
    return lambda: lambda _, said: [] if _fits(said, kind, fields) else [said]


def otherwise(kind: type, changes: Callable[[Any], dict[str, Any]], **fields: object) -> Callable[[], Change]:
    """They are said with these changes."""
    return lambda: lambda _, said: [replace(said, **changes(said))] if _fits(said, kind, fields) else [said]


def with_it(kind: type, more: Callable[[Stage, Any], Any], **fields: object) -> Callable[[], Change]:
    """Something more is said behind them."""
    return lambda: lambda stage, said: [said, more(stage, said)] if _fits(said, kind, fields) else [said]


def once(kind: type, **fields: object) -> Callable[[], Change]:
    """Each of them, by its token, is said once in the play."""

    def change() -> Change:
        told: set[int] = set()

        def heard(_: Stage, said: Any) -> Iterable[Any]:
            if not _fits(said, kind, fields):
                return [said]
            is_first = said.token not in told
            told.add(said.token)
            return [said] if is_first else []

        return heard

    return change


def from_cut(number: int, then: Callable[[], Change]) -> Callable[[], Change]:
    """As it is until its power has been cut so often; who is started asks all."""

    def change() -> Change:
        begun, changed = [0], then()

        def heard(stage: Stage, said: Any) -> Iterable[Any]:
            begun[0] += isinstance(said, SyncRequest) and said.whom == 0 and stage.is_off is False
            return changed(stage, said) if begun[0] > number else [said]

        return heard

    return change


def on_the_platform(stage: Stage, _: Any) -> Progress:
    """A place above on the platform."""
    return Progress(stage.node, 0, 0, 2, 0, 0, 0)


def off_the_platform(stage: Stage, _: Any) -> Progress:
    """A place below before the lift."""
    return Progress(stage.node, 0, 0, 1, 1, 0, 0)


def below(stage: Stage, _: Any) -> Progress:
    """A place below on the platform."""
    return Progress(stage.node, 0, 0, 1, 0, 0, 0)


def gives_up(bidder: Participant, due_us: int) -> int:
    """When a bidder asks that leaves a call to whoever has asked others for it."""
    return bidder.cut_off_us + 1 if bidder.rivals_until_us else due_us


def a_quarter(outer_us: int, now_us: int, timing: Timing) -> int:
    """The deadline of sub-calls of a robot that gives them a quarter of the time, however little."""
    return now_us + (last_bid_us(outer_us, timing) - now_us) // 4


def _fits(said: Any, kind: type, fields: dict[str, object]) -> bool:
    return isinstance(said, kind) and all(getattr(said, name) == value for name, value in fields.items())


ASK, RIDE, CUT = (one.name for one in OF_LIFTS)
PLATFORM, GATE = 128 << 8, 128 << 8 | 255
FAULTS = [
    Fault(ASK, "asks-the-lift-before-it-bids", does=((AskingGeneration, "answer", CarParkGeneration.answer),)),
    Fault(ASK, "asks-for-each-ride", does=((asking, "rides_of", lambda steps: rides_of(steps)[:1]),)),
    Fault(ASK, "sub-call-is-one-deeper", otherwise(Call, lambda one: {"depth": one.depth + 1})),
    Fault(ASK, "parts-are-numbered", otherwise(Call, lambda one: {"part": one.part + 1})),
    Fault(ASK, "sub-call-is-opened-once", otherwise(Call, lambda _: {"attempt": 2})),
    Fault(ASK, "asks-lifts-by-time", otherwise(Call, lambda _: {"kind": KindCode.ANY})),
    Fault(ASK, "sub-call-names-its-parent", otherwise(CallParent, lambda _: {"parent": Reference(1, 1)})),
    Fault(ASK, "sub-call-tells-how-long-it-holds", otherwise(CallParent, lambda one: {"hold_ms": one.hold_ms + 500})),
    Fault(ASK, "sub-call-has-the-whole-task", otherwise(CallLoad, lambda _: {"wheelbase_mm": 2_000})),
    Fault(
        ASK,
        "sub-call-takes-half-of-the-time asks-nobody-where-time-is-short bids-not-where-time-is-short",
        does=((sub_calls, "inner_deadline_us", a_quarter),),
    ),
    Fault(ASK, "bids-though-no-lift-answers bid-comes-behind-the-answers", never(Bid)),
    Fault(
        ASK,
        "what-is-promised-is-not-asked-again asks-when-its-delay-is-over",
        does=((asking, "TOLERANCE_US", -1),),
    ),
    Fault(ASK, "best-bidder-has-the-option option-comes-at-the-deadline", never(Award, result=CallResult.OPTION)),
    Fault(ASK, "options-go-when-it-is-outbid", never(Award, result=CallResult.WITHDRAWN)),
    Fault(
        ASK,
        "options-go-for-nobody-else",
        with_it(Award, lambda _, one: replace(one, result=CallResult.WITHDRAWN), result=CallResult.OPTION),
    ),
    Fault(
        ASK,
        "late-answer-is-no-option",
        otherwise(Award, lambda _: {"result": CallResult.OPTION, "winner": 5}, result=CallResult.REFUSED),
    ),
    Fault(ASK, "bid-goes-by-the-lifts-answer", does=((AskingGeneration, "_late_uses", lambda *_: []),)),
    Fault(ASK, "asks-nobody-where-it-is-beaten", does=((Participant, "_is_beaten", lambda _: False),)),
    Fault(ASK, "asks-after-anothers-answer", does=((Participant, "on_rival", lambda *_: None),)),
    Fault(ASK, "asks-behind-another-where-there-is-time", does=((Participant, "_behind_rivals_us", gives_up),)),
    Fault(RIDE, "bids-for-what-needs-rides", never(Bid)),
    Fault(RIDE, "awards-its-rides", never(Award)),
    Fault(RIDE, "takes-its-car-below", never(CarAt)),
    Fault(RIDE, "parks-over-a-lift", never(TaskReport, phase=TaskPhase.DONE)),
    Fault(
        RIDE,
        "ride-is-from-stop-to-stop",
        otherwise(ItineraryLeg, lambda one: {"to_index": one.from_index}, action=LegAction.RIDE),
    ),
    Fault(
        RIDE,
        "ride-takes-its-time",
        otherwise(ItineraryLeg, lambda one: {"end_ms": one.end_ms - 2_000}, action=LegAction.RIDE),
    ),
    Fault(
        RIDE,
        "plan-rides-before-it-drives-off",
        otherwise(ItineraryLeg, lambda _: {"action": LegAction.TRAVEL}, action=LegAction.RIDE),
    ),
    Fault(
        RIDE,
        "plan-ends-before-no-lift",
        otherwise(ItineraryLeg, lambda _: {"to_index": 1}, action=LegAction.WORK, track=2),
    ),
    Fault(RIDE, "asks-again-for-the-platform asks-again-for-the-gate", once(TokenRequest)),
    Fault(RIDE, "waits-for-the-platform", with_it(TokenRequest, on_the_platform, token=PLATFORM)),
    Fault(RIDE, "waits-for-the-gate", with_it(TokenRequest, on_the_platform, token=GATE)),
    Fault(
        RIDE,
        "waits-for-the-lifts-word crosses-sills-with-both-and-a-word earlier-word-proves-nothing "
        "word-of-other-high-bits-proves-nothing word-of-a-moving-platform-proves-nothing "
        "word-above-the-mark-proves-nothing word-below-the-mark-proves-nothing",
        with_it(SyncRequest, on_the_platform, whom=5),
    ),
    Fault(RIDE, "waits-aboard-for-the-lifts-word", with_it(SyncRequest, off_the_platform, whom=5)),
    Fault(RIDE, "waits-aboard-for-the-gate", does=((SillProof, "lacks", lambda *_: Reason.NONE),)),
    Fault(RIDE, "asks-the-lift-for-its-word asks-the-lift-aboard", never(SyncRequest)),
    Fault(
        RIDE,
        "boards-by-the-lifts-word leaves-by-the-lifts-word both-go-back-outside",
        never(Progress, index=0),
    ),
    Fault(RIDE, "gate-goes-back-aboard", never(TokenGrant, token=GATE)),
    Fault(RIDE, "gate-goes-back-not-before", otherwise(Progress, lambda _: {"speed_mm_s": 100}, index=0)),
    Fault(RIDE, "platform-stays-while-aboard", otherwise(Progress, lambda _: {"index": 0}, index=1, track=2)),
    Fault(
        RIDE,
        "gives-both-back-where-the-lift-is-elsewhere boards-when-the-lift-is-there",
        does=((SillProof, "refuse", lambda *_: []),),
    ),
    Fault(
        RIDE,
        "boards-not-where-the-lift-is-elsewhere",
        with_it(TokenGrant, below, token=PLATFORM),
    ),
    Fault(
        RIDE,
        "leaves-not-at-another-stop leaves-when-the-lift-is-there",
        does=tuple((one, "is_same_stop", lambda *stops: stops[2] is not None) for one in (sill, riding)),
    ),
    *(
        Fault(CUT, f"cut-{name}-{breaks}", from_cut(number, change))
        for number, name in enumerate(("aboard", "on-the-ride", "at-its-stop"), 1)
        for breaks, change in (
            ("is-on-the-platform", otherwise(Progress, lambda _: {"index": 1})),
            ("takes-part-again", never(Heartbeat)),
            ("has-its-task", never(TaskReport)),
            ("rides-on", never(Progress, track=1)),
            ("gives-both-back", never(TokenGrant, token=PLATFORM)),
        )
    ),
]
NEW = {check.name for one in OF_LIFTS for check in one.checks}


def test_our_robot_keeps_to_all_that_is_judged_over_a_lift() -> None:
    findings = play(site=LIFT).findings
    assert [line for one in findings.of(Verdict.FAILED) for line in lines_of(one, frame_words)] == []
    of_two = {one.name for one in scenes_of(LIFT) if one.needs_rival}
    unreached = {one.check.name for one in findings.of(Verdict.NOT_REACHED) if one.scene not in of_two}
    assert unreached == {
        # Its delay is over when it asks, not when it bids.
        *("bid-waits-its-delay", "bid-is-not-late", "bid-is-in-its-slot", "call-twice-waits-once"),
        # The lift's platform and gate are among what it asks for next.
        *("grant-to-another-is-not-mine", "grant-of-a-run-is-one-for-each"),
    }


@pytest.mark.parametrize("fault", FAULTS, ids=lambda one: one.breaks.split()[0])
def test_a_robot_that_is_wrong_with_lifts_is_caught(fault: Fault, monkeypatch: pytest.MonkeyPatch) -> None:
    if fault.says is not None:
        says(monkeypatch, fault.says())
    for owner, name, wrong in fault.does:
        monkeypatch.setattr(owner, name, wrong)
    failed = play((fault.scene,), site=LIFT).findings.of(Verdict.FAILED)
    assert set(fault.breaks.split()) <= {one.check.name for one in failed}


def test_each_check_about_lifts_can_fail() -> None:
    assert {name for one in FAULTS for name in one.breaks.split()} == NEW
