"""Another robot of the kit's fleet: its plans, its places and its tokens; and when two plans meet (duties P4, P6)."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import sqrt
from typing import NamedTuple

from onboard.conform.cast import Cast
from onboard.conform.stage import SECOND, Play, Stage, after_ms
from onboard.contract.codes import Grade, LegAction, Side, TokenKind
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp, TokenGrant, TokenHeld, TokenRequest
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey, genesis_holder
from onboard.systems.car_park.conform.desk import Desk

#: Windows that overlap by no more do not meet: ``T_round``, and what two ways of reckoning may differ by, ms.
_MEETS_MS = 10 + 90


class Window(NamedTuple):
    """When a plan is in a segment, bus time in ms by the round nearest to now."""

    segment: Segment
    from_ms: int
    to_ms: int


@dataclass
class Rival:
    """The robot that the kit speaks as. It has no body: it is where it says that it is."""

    stage: Stage
    cast: Cast
    desk: Desk
    legs: list[Leg] = field(default_factory=list)

    @property
    def node(self) -> int:
        """The node-ID under which the kit speaks as it; the site has one where a scene needs it."""
        return self.stage.rival

    @property
    def home(self) -> Segment:
        """The segment in a spur where it rests, its home by the site file."""
        return self.stage.site.machines[self.node].home

    @property
    def plan(self) -> Itinerary:
        """The firm itinerary that it told last; all digests have it."""
        return self.cast.plans[self.node]

    # --- plans ---------------------------------------------------------------------------------------------------

    def way(self, *stops: tuple[int, float], first_s: float = 0.0, slower_s: float = 0.0) -> "Rival":
        """A plan from home: out of the spur after ``first_s``, then to each index of the alley to work so long, s.

        Each run there takes ``slower_s`` longer than it must.
        """
        self.legs = []
        if first_s:
            self._add(LegAction.STAND, self.home.track, self.home.index, self.home.index, round(first_s * 1000))
        mouth = self.desk.segment_at(self.home.track, 0)
        self._turn(mouth.track, mouth.index)
        here = mouth.index
        for index, works_s in stops:
            here = self._run(mouth.track, here, index, round(slower_s * 1000))
            if works_s:
                self._add(LegAction.WORK, mouth.track, here, here, round(works_s * 1000))
        return self

    def into(self, spur: int) -> "Rival":
        """End it in a spur."""
        mouth = self.desk.segment_at(spur, 0)
        here = self._run(mouth.track, self.legs[-1].to_index, mouth.index)
        assert here == mouth.index
        self._turn(spur, 1)
        return self

    def _run(self, track: int, begin: int, end: int, slower_ms: int = 0) -> int:
        if begin != end:
            self._add(LegAction.TRAVEL, track, begin, end, self.desk.run_us(begin, end) // 1000 + slower_ms)
        return end

    def _turn(self, track: int, index: int) -> None:
        lasts_ms = (self.desk.run_us(0, 1) + self.desk.site.carrier_turn_us) // 1000
        self._add(LegAction.TRAVEL, track, index, index, lasts_ms)

    def _add(self, action: LegAction, track: int, begin: int, end: int, lasts_ms: int) -> None:
        ends_ms = (self.legs[-1].end_ms if self.legs else 0) + lasts_ms
        works_at = (one.side for one in self.desk.site.places if one.segment == Segment(track, end))
        side = next(works_at, Side.NEAR) if action is LegAction.WORK else Side.NEAR
        self.legs.append(Leg(action, track, begin, end, side, ends_ms))

    def tell(self, stamp: Stamp | None = None) -> Itinerary:
        """Say the plan that was made, under the next version; ``stamp``: else that of bus time now and its own node."""
        stamp = Stamp(self.stage.bus_ms(), self.node, 0) if stamp is None else stamp
        legs = tuple(leg._replace(end_ms=(leg.end_ms + stamp.award_ms) % 2**32) for leg in self.legs)
        version = self.plan.version % 255 + 1 if self.node in self.cast.plans else 1
        self.cast.plans[self.node] = Itinerary(self.node, version, Grade.FIRM, stamp, legs)
        self.stage.say(self.plan)
        return self.plan

    def stands(self, at: Segment | None = None) -> None:
        """Say that it stands there, at home if nothing is said, without end."""
        at = self.home if at is None else at
        self.legs = []
        self._add(LegAction.STAND, at.track, at.index, at.index, 1)
        self.is_at(at)
        self.tell()

    def is_at(self, at: Segment, speed_mm_s: int = 0, leg: int = 0) -> None:
        """Say its place, under the plan that it told last."""
        self.cast.places[self.node] = Progress(self.node, self.plan.version, leg, at.track, at.index, 0, speed_mm_s)
        self.stage.say(self.cast.places[self.node])

    def drives(self, seconds: float) -> Play:
        """Let so much time go by, and say on the way where it is by its plan."""
        until_us = self.stage.now_us + round(seconds * SECOND)
        while self.stage.now_us < until_us:
            self._follow()
            yield from self.stage.pause(min(1.0, (until_us - self.stage.now_us) / SECOND))

    def _follow(self) -> None:
        plan, now_ms = self.plan, self.stage.bus_ms()
        number = sum(1 for leg in plan.legs if after_ms(now_ms, leg.end_ms) >= 0)
        leg = plan.legs[min(number, len(plan.legs) - 1)]
        is_over = number == len(plan.legs)
        at = Segment(leg.track, leg.to_index if is_over or leg.action is LegAction.WORK else leg.from_index)
        said = self.cast.places[self.node]
        if (said.itinerary_version, said.leg, said.track, said.index) != (plan.version, number, *at):
            self.is_at(at, leg=number)

    # --- rights --------------------------------------------------------------------------------------------------

    def takes(self, *segments: Segment) -> None:
        """It is given these by who has them in the kit's fleet, and says that it holds them."""
        for segment in segments:
            self._moves(TokenKey(TokenKind.SEGMENT, segment.number), self.node)

    def gives_back(self, *segments: Segment) -> None:
        """They go back to their steward."""
        for segment in segments:
            key = TokenKey(TokenKind.SEGMENT, segment.number)
            self._moves(key, genesis_holder(self.stage.site, key))

    def _moves(self, key: TokenKey, to: int) -> None:
        holder, version = self.cast.holder(key)
        if holder in self.cast.parts and holder != to:
            self.cast.tokens[key] = (to, version + 1)
            self.stage.say(TokenGrant(holder, *key, version + 1, to), TokenHeld(to, *key, version + 1))

    def asks(self, segment: Segment, before: int, version: int | None = None) -> TokenRequest:
        """It asks for a segment, with the machine that passes right before it."""
        key = TokenKey(TokenKind.SEGMENT, segment.number)
        seen = self.cast.holder(key)[1] & 0xFFFFF
        said = TokenRequest(self.node, *key, seen, self.plan.version if version is None else version, before)
        self.stage.say(said)
        return said


# --- when plans meet ---------------------------------------------------------------------------------------------


def windows(desk: Desk, plan: Itinerary) -> list[Window]:
    """When it is in which segment, at the least; the last one has no end."""
    found: list[Window] = []
    first_ms = begin_ms = desk.stage.unrolled_ms(plan.stamp.award_ms)
    for leg in plan.legs:
        end_ms = first_ms + (leg.end_ms - plan.stamp.award_ms) % 2**32
        found += _windows_of(desk, leg, begin_ms, end_ms)
        begin_ms = end_ms
    last = plan.legs[-1]
    return [*found, Window(Segment(last.track, last.to_index), begin_ms, begin_ms + 3_600_000)]


def _work_windows(desk: Desk, plan: Itinerary) -> list[Window]:
    """The same up to the end of its last work: the way back, where it is not begun, yields to work (duty P7)."""
    last = max((number for number, leg in enumerate(plan.legs, 1) if leg.action is LegAction.WORK), default=0)
    return windows(desk, replace(plan, legs=plan.legs[:last]))[:-1] if last else []


def _windows_of(desk: Desk, leg: Leg, begin_ms: int, end_ms: int) -> Iterator[Window]:
    if leg.from_index == leg.to_index or leg.action is not LegAction.TRAVEL:
        yield Window(Segment(leg.track, leg.to_index), begin_ms, end_ms)
        return
    site, track = desk.site, desk.site.tracks[leg.track]
    steps = range(leg.from_index, leg.to_index, 1 if leg.to_index > leg.from_index else -1)
    way_mm = len(steps) * track.pitch_mm
    reach_mm = (site.carrier_length_mm + track.pitch_mm) / 2 + site.carrier_clearance_mm
    spare_ms = max(0, end_ms - begin_ms - desk.run_us(leg.from_index, leg.to_index) // 1000)
    for number, index in enumerate((*steps, leg.to_index)):
        middle_mm = number * track.pitch_mm
        enters_ms = _time_ms(desk, middle_mm - reach_mm, way_mm)
        leaves_ms = _time_ms(desk, middle_mm + reach_mm, way_mm)
        yield Window(Segment(leg.track, index), begin_ms + round(enters_ms), begin_ms + round(leaves_ms) + spare_ms)


def _time_ms(desk: Desk, at_mm: float, way_mm: float) -> float:
    """When a run from rest to rest is at a point of its way, ms after its begin."""
    speed, acceleration = desk.site.carrier.speed_mm_s, desk.site.carrier.acceleration_mm_s2
    at_mm = min(max(at_mm, 0.0), way_mm)
    if at_mm > way_mm / 2:
        return _lasts_ms(speed, acceleration, way_mm) - _time_ms(desk, way_mm - at_mm, way_mm)
    ramp_mm = min(speed * speed / (2 * acceleration), way_mm / 2)
    if at_mm <= ramp_mm:
        return 1000 * sqrt(2 * at_mm / acceleration)
    return 1000 * (sqrt(2 * ramp_mm / acceleration) + (at_mm - ramp_mm) / speed)


def _lasts_ms(speed: int, acceleration: int, way_mm: float) -> float:
    if way_mm * acceleration >= speed * speed:
        return 1000 * (way_mm / speed + speed / acceleration)
    return 2000 * sqrt(way_mm / acceleration)


def meeting(
    desk: Desk, one: Itinerary, other: Itinerary, from_ms: int = 0, *, way_back: bool = True
) -> tuple[Window, Window] | None:
    """Where two plans are in one segment at once, behind ``from_ms``; None where they are nowhere.

    Without ``way_back`` that of the other counts for nothing.
    """
    others = windows(desk, other) if way_back else _work_windows(desk, other)
    for mine in windows(desk, one):
        for theirs in others:
            if mine.segment == theirs.segment:
                overlap_ms = min(mine.to_ms, theirs.to_ms) - max(mine.from_ms, theirs.from_ms, from_ms)
                if overlap_ms > _MEETS_MS:
                    return mine, theirs
    return None
