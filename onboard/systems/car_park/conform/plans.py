"""What is judged of every plan and place that a robot tells: chapters 7 and 8 of docs/protocol.md."""

from itertools import pairwise

from onboard.conform.cast import Cast
from onboard.conform.checks import Check
from onboard.conform.stage import Stage, Word, after_ms
from onboard.contract.codes import Grade, LegAction, TokenKind
from onboard.contract.messages import Itinerary, Leg, Progress, TaskReport, TokenGrant
from onboard.core.site import Segment
from onboard.systems.car_park.conform.desk import Desk
from onboard.systems.car_park.site import car_park

#: Duty P13.
_MOST_LEGS = 31
#: Duty P9, and what a word may take, ms.
_LATE_MS, _SOON_MS = 2_300, 800
#: So much of a body beyond a border is none, mm: what its drive may read too little.
_EDGE_MM = 20
#: Two frames at 125 kbit/s, and as many of others, us.
_OVERTAKES_US = 5_000
_FOLLOW = "The legs follow each other in time and place: leg n begins when and where leg n - 1 ends"

PLANS = (
    Check("legs-follow-in-place", "P1", _FOLLOW),
    Check("legs-follow-in-time", "P1", _FOLLOW),
    Check("plan-has-few-legs", "P13", "At most 31 legs"),
    Check(
        "runs-take-their-time",
        "P4",
        ("A run over d mm with the site's top speed v and acceleration a lasts d/v + v/a seconds"),
    ),
    Check("runs-keep-to-the-track", "P3", "TRAVEL runs from rest to rest on one track"),
    Check("works-at-a-station", "P3", "WORK is at the station beside `to_index` on `side`."),
    Check("stands-where-it-is", "P3", "STAND waits."),
    Check("plan-ends-in-a-refuge", "P5", "A plan ends in a refuge: a segment that is before no compartment"),
    Check("place-names-its-plan", "P10", "`itinerary_version` and `leg` are of the plan in hand."),
    Check("place-names-a-leg", "P10", "`itinerary_version` and `leg` are of the plan in hand."),
    Check(
        "each-return-comes-behind-its-place",
        "P10",
        "A robot says it before it gives back segments that it has left since.",
    ),
    Check(
        "is-where-its-plan-has-it",
        "P9",
        ("A robot whose step is, or will be, 2 s late tells its plan anew while the step still lasts"),
    ),
    Check(
        "is-there-no-sooner-than-planned",
        "P9",
        "where what follows begins more than 0.5 s later or sooner than planned.",
    ),
    Check("is-only-where-it-may-be", "K2", "I move, or let move, only within segments whose tokens I hold"),
    Check("reports-only-what-was-awarded", "B9", "I act on a task only when `Award` names me with AWARDED."),
)


class PlanJudge:
    """The judge of plans and places; made once for a play."""

    def __init__(self, stage: Stage, cast: Cast) -> None:
        self.stage, self.cast, self.site = stage, cast, car_park(stage.site)
        #: Segments given back before a word that the body has left them.
        self._given: list[tuple[Word, Segment]] = []
        self.desk = Desk(stage, cast)
        stage.hearers.append(self.hear)

    def hear(self, word: Word) -> None:
        """One word of the node."""
        if self._given:
            self._review_given(word)
        if isinstance(word.message, Itinerary):
            self._on_plan(word, word.message)
        elif isinstance(word.message, Progress):
            self._on_place(word, word.message)
        elif isinstance(word.message, TokenGrant) and word.message.token_kind is TokenKind.SEGMENT:
            self._on_given(word, Segment(*divmod(word.message.token, 256)))
        elif isinstance(word.message, TaskReport):
            is_known = word.message.task in self.stage.awarded or word.message.reason != 0
            self.stage.judge("reports-only-what-was-awarded", is_known, "nobody awarded it", word)

    def _on_plan(self, word: Word, plan: Itinerary) -> None:
        if plan.grade is not Grade.FIRM or not plan.legs:
            return
        stage, pairs = self.stage, list(pairwise(plan.legs))
        joined = all(self._at(a, a.to_index) == self._at(b, b.from_index) or self._turns(a, b) for a, b in pairs)
        stage.judge("legs-follow-in-place", joined, "a leg begins where none ends", word)
        ordered = all((b.end_ms - a.end_ms) % 2**32 < 2**31 for a, b in pairs)
        stage.judge("legs-follow-in-time", ordered, "a leg ends before the one before it", word)
        stage.judge("plan-has-few-legs", len(plan.legs) <= _MOST_LEGS, f"{len(plan.legs)} legs", word)
        first = next((leg for leg in plan.legs if leg.action is LegAction.TRAVEL), None)
        short = [b for a, b in pairs if b.action is LegAction.TRAVEL and not self._lasts(a, b, is_first=b is first)]
        stage.judge("runs-take-their-time", not short, f"too short: {short}", word)
        for leg in plan.legs:
            self._on_leg(word, leg)
        last = plan.legs[-1]
        if len(plan.legs) > 1:
            is_refuge = (last.track, last.to_index) not in {bay.segment for bay in self.site.compartments.values()}
            stage.judge("plan-ends-in-a-refuge", is_refuge, "ends before a compartment", word)

    def _at(self, leg: Leg, index: int) -> Segment:
        """Where a leg begins or ends: a ride at the platform as its floor's alley has it."""
        if leg.track not in self.site.lifts:
            return Segment(leg.track, index)
        doors = self.site.tracks[leg.track].joins
        return self.site.beyond(doors[index - 1]) if 0 < index <= len(doors) else Segment(leg.track, index)

    def _turns(self, before: Leg, leg: Leg) -> bool:
        """Whether a leg goes over a linked end, from where the one before it ends."""
        here, there = Segment(before.track, before.to_index), Segment(leg.track, leg.from_index)
        tracks = [self.site.tracks[one] for one in {here.track, there.track} if one in self.site.tracks]
        ends = [{mouth, track.inside(index)} for track in tracks for index, mouth in track.ends]
        return leg.action is LegAction.TRAVEL and leg.from_index == leg.to_index and {here, there} in ends

    def _lasts(self, before: Leg, leg: Leg, *, is_first: bool) -> bool:
        lasts_us = (leg.end_ms - before.end_ms) % 2**32 * 1000
        if leg.from_index == leg.to_index:
            return lasts_us >= self.desk.run_us(0, 1) + self.site.carrier_turn_us - 2_000
        least_us, at = self.desk.run_us(leg.from_index, leg.to_index), self.stage.last(Progress)
        if is_first and at is not None and at.message.track == leg.track:
            # It may stand beside a mark, as after a cut, and nearer to where it goes.
            least_us = min(least_us, self.desk.run_from_us(at.message.index, at.message.offset_mm, leg.to_index))
        return lasts_us >= least_us - 2_000

    def _on_leg(self, word: Word, leg: Leg) -> None:
        stage, site = self.stage, self.site
        if leg.action is LegAction.TRAVEL:
            length = site.tracks[leg.track].length if leg.track in site.tracks else 0
            inside = all(0 <= index <= length + 1 for index in (leg.from_index, leg.to_index))
            stage.judge("runs-keep-to-the-track", length and inside, f"{leg}", word)
        elif leg.action is LegAction.STAND:
            stage.judge("stands-where-it-is", leg.from_index == leg.to_index, f"{leg}", word)
        elif leg.action is LegAction.WORK:
            here = (leg.track, leg.to_index, leg.side)
            is_one = here in (*site.places, *site.compartments.values())
            stage.judge("works-at-a-station", is_one, f"no station at {here}", word)

    def _on_place(self, word: Word, at: Progress) -> None:
        stage, plan = self.stage, self.stage.last(Itinerary)
        if plan is not None and at.itinerary_version:
            is_its = at.itinerary_version == plan.message.version
            stage.judge("place-names-its-plan", is_its, f"the plan is {plan.message.version}", plan, word)
            self._in_time(plan, word, at)
            stage.judge("place-names-a-leg", at.leg <= len(plan.message.legs), "no such leg", plan, word)
        holder = self.cast.holder(self.desk.segment_key(at.track, at.index))[0]
        if stage.means.power:
            stage.judge("is-only-where-it-may-be", holder == stage.node, f"node {holder} has the segment", word)

    def _on_given(self, word: Word, given: Segment) -> None:
        """By its last word of where it is no part of its body is in what it gives back, or to another."""
        told = self.stage.last(Progress)
        if told is not None and not self._is_out_of(given, told.message):
            self._given.append((word, given))
        elif told is not None:
            self.stage.judge("each-return-comes-behind-its-place", True, "", told, word)

    def _review_given(self, word: Word) -> None:
        """A grant may overtake the place that was said before it where both wait for the bus."""
        place = word.message if isinstance(word.message, Progress) else None
        if place is None and word.time_us <= self._given[0][0].time_us + _OVERTAKES_US:
            return
        for early, given in self._given:
            is_soon = word.time_us <= early.time_us + _OVERTAKES_US
            is_kept = is_soon and place is not None and self._is_out_of(given, place)
            self.stage.judge("each-return-comes-behind-its-place", is_kept, "was in it by its last word", early, word)
        self._given.clear()

    def _is_out_of(self, slot: Segment, at: Progress) -> bool:
        if at.track != slot.track:
            return True
        pitch_mm = self.site.tracks[slot.track].pitch_mm
        away_mm = abs((slot.index - at.index) * pitch_mm - at.offset_mm)
        return away_mm >= (pitch_mm + self.site.carrier_length_mm) // 2 - _EDGE_MM

    def _in_time(self, plan: Word, word: Word, at: Progress) -> None:
        """A place that it tells while it moves is one of the leg in hand, between its begin and its end."""
        stage, legs = self.stage, plan.message.legs
        if at.itinerary_version != plan.message.version or not (at.speed_mm_s and at.leg < len(legs)):
            return
        begin_ms = legs[at.leg - 1].end_ms if at.leg else plan.message.stamp.award_ms
        now_ms = stage.bus_ms()
        late_ms = after_ms(now_ms, legs[at.leg].end_ms)
        soon_ms = after_ms(begin_ms, now_ms)
        stage.judge("is-where-its-plan-has-it", late_ms <= _LATE_MS, f"{late_ms} ms behind the leg's end", plan, word)
        stage.judge("is-there-no-sooner-than-planned", soon_ms <= _SOON_MS, f"{soon_ms} ms before it", plan, word)


def watch(stage: Stage, cast: Cast) -> None:
    """Judge plans and places from now on."""
    PlanJudge(stage, cast)
