"""Riding a lift that the kit plays: duties L1 to L5 of docs/protocol.md, for a robot."""

from dataclasses import dataclass

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import Play, Stage, Word, after_ms
from onboard.contract.codes import Grade, LegAction, MachineState, TaskPhase
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    CallForProposals,
    CarAt,
    Heartbeat,
    Itinerary,
    Leg,
    Progress,
    SyncRequest,
    TaskReport,
    TokenGrant,
    TokenRequest,
)
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.desk import Desk, ride_us
from onboard.systems.car_park.conform.platforms import (
    MARK_MM,
    Phase,
    Platform,
    as_said,
    elsewhere,
    otherwise,
    platform_of,
    unsaid,
)

_BOTH = "A robot crosses the sill only while it holds platform and gate, and has heard the lift's `Progress`"
_STANDS = "with its stop there, speed 0, at most 5 mm off"
_BITS = "whose `itinerary_version` and `leg` are bits 7 to 0 and 12 to 8 of the gate's version that the robot holds."
_EARLIER = "No time and no earlier word stands for it."
_ASKS = "which a robot that holds the gate does every `T_sill` while that word is missing."
_BACK = "A robot gives the gate back when it is wholly aboard or wholly out, the platform when it is out."
_ELSEWHERE = (
    "If the lift says, under the gate that the robot holds, that it stands elsewhere, the robot gives both back."
)
_RIDE = "RIDE is on a lift's track, from stop to stop."
_RIDES = "So a plan that drives onto a platform rides before it drives off"
_OPTIONS = "who is awarded says AWARDED to those that its bid rests on."

RIDING = (
    Check("bids-for-what-needs-rides", "B1", "with an operation and criterion that I know"),
    Check("awards-its-rides", "B12", _OPTIONS),
    Check("ride-is-from-stop-to-stop", "P3", _RIDE),
    Check("ride-takes-its-time", "P4", "a ride the same over the height with the lift's, and 0.4 s for gate and sill."),
    Check("plan-rides-before-it-drives-off", "L3", _RIDES),
    Check("plan-ends-before-no-lift", "P5", "a segment that is before no compartment, no lift, in no mouth"),
    Check("waits-for-the-platform", "L1", _BOTH),
    Check("asks-again-for-the-platform", "K11", "Who was refused asks again after `T_token_most`"),
    Check("waits-for-the-gate", "L1", _BOTH),
    Check("asks-again-for-the-gate", "K11", "Who was refused asks again after `T_token_most`"),
    Check("waits-for-the-lifts-word", "L1", _BOTH),
    Check("asks-the-lift-for-its-word", "L4", _ASKS),
    Check("earlier-word-proves-nothing", "L1", _EARLIER),
    Check("word-of-other-high-bits-proves-nothing", "L1", _BITS),
    Check("word-of-a-moving-platform-proves-nothing", "L1", _STANDS),
    Check("word-above-the-mark-proves-nothing", "L1", _STANDS),
    Check("word-below-the-mark-proves-nothing", "L1", _STANDS),
    Check("boards-by-the-lifts-word", "L1", _STANDS),
    Check("crosses-sills-with-both-and-a-word", "L1", _BOTH),
    Check("gate-goes-back-aboard", "L5", _BACK),
    Check("gate-goes-back-not-before", "L5", _BACK),
    Check("platform-stays-while-aboard", "L5", _BACK),
    Check("waits-aboard-for-the-gate", "L1", _BOTH),
    Check("waits-aboard-for-the-lifts-word", "L1", _BOTH),
    Check("asks-the-lift-aboard", "L4", _ASKS),
    Check("leaves-by-the-lifts-word", "L1", _BITS),
    Check("both-go-back-outside", "L5", _BACK),
    Check("takes-its-car-below", "C3", "When the shuttle is home with a car: `CarAt` with 65535 (aboard)"),
    Check("gives-both-back-where-the-lift-is-elsewhere", "L5", _ELSEWHERE),
    Check("boards-not-where-the-lift-is-elsewhere", "L1", _STANDS),
    Check("boards-when-the-lift-is-there", "L1", _STANDS),
    Check("leaves-not-at-another-stop", "L1", _STANDS),
    Check("leaves-when-the-lift-is-there", "L1", _STANDS),
    Check("parks-over-a-lift", "U2", "DONE with the station where the car is left when the shuttle is home."),
)


@dataclass
class SillJudge:
    """Judges plans with rides, and each crossing of a sill, from the first ride on."""

    stage: Stage
    cast: Cast
    lift: Platform
    was_on: bool = False

    def __post_init__(self) -> None:
        place = self.stage.last(Progress)
        self.was_on = place is not None and self.lift.is_on(place.message)
        # Before the fleet takes a right back: a crossing is judged by what the node held.
        self.stage.hearers.insert(0, self.hear)

    def hear(self, word: Word) -> None:
        """One word of the node."""
        match word.message:
            case Progress() as at:
                self._on_place(word, at)
            case TokenGrant() as grant:
                self._on_grant(word, TokenKey(grant.token_kind, grant.token))
            case Itinerary() as plan if plan.grade is Grade.FIRM and plan.legs:
                self._on_plan(word, plan)

    def _judge(self, name: str, is_kept: object, why: str, *words: Word | None) -> None:
        # Which scenes are played is a person's choice.
        if name in self.stage.findings.by_name:
            self.stage.judge(name, is_kept, why, *words)

    def _on_place(self, word: Word, at: Progress) -> None:
        is_on, lift = self.lift.is_on(at), self.lift
        if is_on != self.was_on:
            version = self.cast.holder(lift.gate_key)[1]
            has = lift.has(lift.platform_key) and lift.has(lift.gate_key) and lift.proved == version
            self._judge("crosses-sills-with-both-and-a-word", has, "without right or word", word)
        self.was_on = is_on

    def _on_grant(self, word: Word, key: TokenKey) -> None:
        place, lift = self.stage.last(Progress), self.lift
        if key == lift.gate_key and lift.phase in (Phase.BOARDING, Phase.LEAVING) and self.was_on:
            is_still = place is not None and not place.message.speed_mm_s
            self._judge("gate-goes-back-not-before", is_still, "while it moves on the sill", place, word)
        elif key == lift.platform_key:
            self._judge("platform-stays-while-aboard", not self.was_on, "gives it from aboard", place, word)

    def _on_plan(self, word: Word, plan: Itinerary) -> None:
        lift, legs = self.lift, plan.legs
        begins = (plan.stamp.award_ms, *(leg.end_ms for leg in legs))
        for number, leg in enumerate(legs):
            if leg.action is LegAction.RIDE:
                self._on_ride(word, leg, after_ms(leg.end_ms, begins[number]), is_first=number == 0)
        onto = [one for one, leg in enumerate(legs) if leg.action is LegAction.TRAVEL and self._ends_on(leg)]
        off = [one for one in onto if one + 1 == len(legs) or legs[one + 1].action is LegAction.TRAVEL]
        self._judge("plan-rides-before-it-drives-off", not off, "drives on and off, or ends aboard", word)
        last = legs[-1]
        if len(legs) > 1:
            sills = lift.site.tracks[lift.track].joins
            is_refuge = (last.track, last.to_index) not in sills and not self._ends_on(last)
            self._judge("plan-ends-before-no-lift", is_refuge, "ends before the lift", word)

    def _ends_on(self, leg: Leg) -> bool:
        lift = self.lift
        return leg.track != lift.track and lift.site.platforms.get(Segment(leg.track, leg.to_index)) == lift.track

    def _on_ride(self, word: Word, leg: Leg, lasts_ms: int, *, is_first: bool) -> None:
        lift = self.lift
        stops = set(range(1, lift.site.tracks[lift.track].length + 1))
        is_known = leg.track == lift.track and {leg.from_index, leg.to_index} <= stops
        self._judge("ride-is-from-stop-to-stop", is_known and leg.from_index != leg.to_index, f"{leg}", word)
        if is_known and not is_first:
            least_ms = ride_us(lift.site, lift.track, leg.from_index, leg.to_index) // 1000
            self._judge("ride-takes-its-time", lasts_ms >= least_ms - 2, f"{lasts_ms} ms, not {least_ms}", word)


def riding(stage: Stage, cast: Cast) -> Play:
    """It fetches a car from below: onto the platform, down, off, and the same way back, and the lift fails in turn."""
    desk, lift = Desk(stage, cast, 0x1D00, 2_900), platform_of(cast)
    SillJudge(stage, cast, lift)
    yield from car_below(stage, cast, desk)
    begin_us = stage.now_us
    lift.keeps = {lift.platform_key, lift.gate_key}
    call, bid = yield from desk.wins()
    stage.judge("bids-for-what-needs-rides", bid, "no bid", bid)
    if bid is None:
        return
    yield from _awards(stage, lift, begin_us)
    asks = yield from stage.hears(TokenRequest, lambda one: one.token == lift.platform_key.number, 30.0, begin_us)
    yield from stage.hears(Progress, lambda one: not one.speed_mm_s and one.index == 1, 30.0, begin_us)
    yield from _boards(stage, lift, asks)
    yield from _rides(stage, lift)
    lift.reset()
    aboard = yield from stage.hears(CarAt, lambda one: one.station == ANY_STATION, 120.0, begin_us)
    stage.judge("takes-its-car-below", aboard, "no CarAt aboard within 120 s", aboard)
    if aboard is not None:
        yield from _elsewhere(stage, lift)
    lift.reset()
    done = yield from stage.hears(
        TaskReport, lambda one: one.task == call.task and one.phase is TaskPhase.DONE, 120.0, begin_us
    )
    stage.judge("parks-over-a-lift", done, "no DONE within 120 s", done)
    yield from stage.pause(15.0)


def car_below(stage: Stage, cast: Cast, desk: Desk) -> Play:
    """The car stands in the bay, brought there if it must be, and the node rests above."""
    desk.place_car()
    at = cast.cars[desk.car]
    if at.station not in (ANY_STATION, desk.bay.number):
        call, bid = yield from desk.wins_back(at.station)
        if bid is not None:
            yield from stage.hears(
                TaskReport, lambda one: one.task == call.task and one.phase is TaskPhase.DONE, 180.0, bid.time_us
            )
    yield from stage.hears(Heartbeat, lambda one: one.state is MachineState.IDLE, 90.0)
    yield from stage.pause(40.0)


def _awards(stage: Stage, lift: Platform, begin_us: int) -> Play:
    """What was asked for before the bid is awarded, and no more once the lift has said that it has heard it."""
    yield from stage.pause(1.0)
    rides = {one.message.call for one in stage.since(CallForProposals, begin_us)}
    said = lift.awarded & rides
    stage.judge("awards-its-rides", said and lift.optioned & rides == said, f"{sorted(said)} of {sorted(rides)}")


def _on(stage: Stage, lift: Platform, since_us: int) -> list[Word]:
    """Places on the platform that the node told from a time on."""
    return [one for one in stage.since(Progress, since_us) if lift.is_on(one.message)]


def _off(stage: Stage, lift: Platform, since_us: int) -> list[Word]:
    return [one for one in stage.since(Progress, since_us) if not lift.is_on(one.message)]


def _asked(stage: Stage, key: TokenKey, since_us: int) -> list[Word]:
    return [one for one in stage.since(TokenRequest, since_us) if one.message.token == key.number]


def _stays_out(stage: Stage, lift: Platform, name: str, seconds: float) -> Play:
    begin_us = stage.now_us
    yield from stage.pause(seconds)
    stage.none_of(name, _on(stage, lift, begin_us), "drives onto the platform")


def _boards(stage: Stage, lift: Platform, asks: Word | None) -> Play:
    """Neither right; the platform; the gate without a word; wrong words; the right one."""
    begin_us = stage.now_us
    yield from _stays_out(stage, lift, "waits-for-the-platform", 11.0)
    again = _asked(stage, lift.platform_key, begin_us)
    stage.judge("asks-again-for-the-platform", 1 <= len(again) <= 3, f"{len(again)} times in 11 s", asks, *again)
    lift.keeps = {lift.gate_key}
    lift.look_again()
    begin_us = stage.now_us
    yield from _stays_out(stage, lift, "waits-for-the-gate", 11.0)
    again = _asked(stage, lift.gate_key, begin_us)
    stage.judge("asks-again-for-the-gate", 1 <= len(again) <= 3, f"{len(again)} times in 11 s", *again)
    lift.keeps, lift.tells = set(), unsaid
    lift.look_again()
    begin_us = stage.now_us
    yield from _stays_out(stage, lift, "waits-for-the-lifts-word", 4.5)
    asked = [one for one in stage.since(SyncRequest, begin_us) if one.message.whom == lift.node]
    stage.judge("asks-the-lift-for-its-word", 3 <= len(asked) <= 5, f"{len(asked)} times in 4.5 s", *asked)
    word = lift.word()
    wrong = {
        "earlier-word-proves-nothing": {"itinerary_version": (word.itinerary_version - 1) % 256},
        "word-of-other-high-bits-proves-nothing": {"leg": word.leg + 1},
        "word-of-a-moving-platform-proves-nothing": {"speed_mm_s": 200},
        "word-above-the-mark-proves-nothing": {"offset_mm": MARK_MM + 1},
        "word-below-the-mark-proves-nothing": {"offset_mm": -MARK_MM - 1},
    }
    for name, changes in wrong.items():
        lift.tells = otherwise(**changes)
        lift.tell()
        yield from _stays_out(stage, lift, name, 2.5)
    begin_us = stage.now_us
    lift.tells = otherwise(offset_mm=MARK_MM)
    lift.tell()
    lift.proved = lift.cast.holder(lift.gate_key)[1]
    yield from stage.until(lambda: bool(_on(stage, lift, begin_us)), 20.0)
    on = _on(stage, lift, begin_us)
    stage.judge("boards-by-the-lifts-word", on, "not aboard within 20 s", *on)


def _rides(stage: Stage, lift: Platform) -> Play:
    """The gate comes back; at the ride's end it stays away, then its word does."""
    lift.keeps, lift.tells = {lift.gate_key}, as_said
    begin_us = stage.now_us
    is_back = yield from stage.until(lambda: not lift.has(lift.gate_key), 15.0)
    stage.judge("gate-goes-back-aboard", is_back, "still has the gate after 15 s", *_on(stage, lift, begin_us))
    yield from stage.until(lambda: lift.phase is Phase.LEAVING, 30.0)
    begin_us = stage.now_us
    yield from stage.pause(6.0)
    stage.none_of("waits-aboard-for-the-gate", _off(stage, lift, begin_us), "drives off")
    lift.keeps, lift.tells = set(), unsaid
    lift.look_again()
    begin_us = stage.now_us
    yield from stage.pause(8.5)
    stage.none_of("waits-aboard-for-the-lifts-word", _off(stage, lift, begin_us), "drives off")
    asked = [one for one in stage.since(SyncRequest, begin_us) if one.message.whom == lift.node]
    stage.judge("asks-the-lift-aboard", 2 <= len(asked) <= 9, f"{len(asked)} times in 8.5 s", *asked)
    begin_us = stage.now_us
    lift.tells = as_said
    lift.tell()
    yield from _leaves(stage, lift, "leaves-by-the-lifts-word", begin_us)
    free = yield from stage.until(lambda: lift.phase is Phase.FREE, 15.0)
    stage.judge("both-go-back-outside", free, "platform or gate still away after 15 s")


def _leaves(stage: Stage, lift: Platform, name: str, begin_us: int) -> Play:
    yield from stage.until(lambda: bool(_off(stage, lift, begin_us)), 25.0)
    off = _off(stage, lift, begin_us)
    stage.judge(name, off, "still aboard after 25 s", *off)


def _elsewhere(stage: Stage, lift: Platform) -> Play:
    """The lift says under the gate that it stands at its other stop: before the node boards, and before it leaves."""
    lift.tells = elsewhere
    begin_us = stage.now_us
    yield from stage.until(lambda: lift.has(lift.gate_key), 60.0)
    yield from stage.until(lambda: not lift.has(lift.gate_key) and not lift.has(lift.platform_key), 10.0)
    is_back = not lift.has(lift.gate_key) and not lift.has(lift.platform_key)
    stage.judge("gives-both-back-where-the-lift-is-elsewhere", is_back, "keeps platform or gate")
    stage.none_of("boards-not-where-the-lift-is-elsewhere", _on(stage, lift, begin_us), "drives onto the platform")
    lift.tells = as_said
    yield from stage.until(lambda: lift.phase is Phase.RIDING, 60.0)
    stage.judge("boards-when-the-lift-is-there", lift.phase is Phase.RIDING, "not aboard within 60 s")
    lift.tells = elsewhere
    yield from stage.until(lambda: lift.phase is Phase.LEAVING, 30.0)
    begin_us = stage.now_us
    yield from stage.pause(8.0)
    stage.none_of("leaves-not-at-another-stop", _off(stage, lift, begin_us), "drives off")
    lift.tells = as_said
    begin_us = stage.now_us
    if lift.has(lift.gate_key):
        lift.tell()
    yield from _leaves(stage, lift, "leaves-when-the-lift-is-there", begin_us)


SCENES = (Scene("riding", RIDING, riding, needs_car=True, needs_lift=True),)
