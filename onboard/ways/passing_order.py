"""Who passes a segment before whom: the order in which tokens are granted (design, section 5).

Firm plans without conflict give an order of passing on every segment. It is agreed where two machines' plans, as last
told, nowhere want one segment at one time; while a delay of one has not been answered by the other they do, and then
the order is the one last agreed. What a machine has passed no longer counts: its own words (the leg in hand, where its
body is) and the tokens that it gave back tell, never the clock. So a machine that is late, or dead, keeps its place in
the order until it tells another plan, and a wrong order costs time, never safety.

A plan that is told anew drops the legs that are over, so a moving leg is known by how many more come behind it.
All times are bus time in us. Pure: plans, progress and grants in, an order out.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from onboard.contract.codes import LegAction, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp
from onboard.core.serial import is_newer, ranks_before
from onboard.core.site import Segment
from onboard.ways.lifts import MARK_TOLERANCE_MM
from onboard.ways.occupancy import LegWindows, body_mm, leg_windows, reach_segments, standing_segments
from onboard.ways.reservations import FOREVER
from onboard.ways.retreats import is_aged
from onboard.ways.site import WaySite
from onboard.ways.told_way import (
    TOLERANCE_US,
    BegunItinerary,
    ToldWay,
    Turn,
    Turns,
    ahead,
    conflict,
    has_work,
    meet,
    overlap_us,
)

#: A plan that was told so long ago, us, was heard by whoever tells one now: one took 10 ms as a rule and 1.85 s at most
#: from its first frame to its last, in logs of crowded drawn sites at 125 and 250 kbit/s.
CROSSED_US = 2_000_000


class Meeting(NamedTuple):
    """Two machines want one segment at one time: their turns, and who comes first by what they last agreed, or None."""

    segment: Segment
    mine: Turn
    theirs: Turn
    first: int | None


@dataclass
class PassingOrder:
    """The order of passing on all segments, as far as one machine has heard."""

    site: WaySite
    _ways: dict[int, ToldWay] = field(default_factory=dict)
    #: Turns of both under which two machines last agreed, lower node-ID first.
    _agreed: dict[tuple[int, int], tuple[Turns, Turns]] = field(default_factory=dict)
    #: How many segments beyond its own a body touches, by track.
    _reach: dict[int, int] = field(init=False)

    def __post_init__(self) -> None:
        self._reach = {track: reach_segments(self.site, track) for track in self.site.tracks}

    def copy(self) -> "PassingOrder":
        """The same order, of which machines may be dropped."""
        return replace(self, _ways=dict(self._ways), _agreed=dict(self._agreed))

    # --- what is heard -----------------------------------------------------------------------------------------

    def on_plan(self, plan: Itinerary, windows: LegWindows, now_us: int) -> None:
        """A firm plan under a new version, or a released one, which has no turns, with the windows of its legs."""
        node = plan.sender
        known = self._ways.get(node)
        way = ToldWay.of(self.site, plan, windows, now_us)
        continued = known is not None and known.ends_as(way)
        before, same = (0, 0) if known is None or continued else known.shared(way)
        if known is not None and (continued or same):
            way.go_on(known, 0 if continued else len(way.moves) - before)
            way.before = known.turns if continued else {}
        self._ways[node] = way
        if same:
            self._lead_on(node, before, same, len(way.moves))
        for other in self._ways:
            if other != node:
                self._agree(node, other, now_us, keep=continued or same > 0)

    def _lead_on(self, node: int, before: int, same: int, now: int) -> None:
        """A plan of ``before`` moving legs leads elsewhere behind the first ``same``: of these the order stays."""
        for pair, agreed in self._agreed.items():
            if node in pair:
                kept: Turns = {}
                for segment, turns in agreed[pair.index(node)].items():
                    shared = [turn for turn in turns if turn.to_come >= before - same]
                    kept[segment] = [turn._replace(to_come=turn.to_come + now - before) for turn in shared]
                self._agreed[pair] = (kept, agreed[1]) if pair[0] == node else (agreed[0], kept)

    def drop(self, node: int) -> None:
        """A machine is an obstacle: it passes nothing until it tells a plan, so nobody comes behind it."""
        self._ways.pop(node, None)
        for pair in [pair for pair in self._agreed if node in pair]:
            del self._agreed[pair]

    def on_progress(self, progress: Progress) -> None:
        """Where a machine's body is; of another version than its plan's it tells nothing."""
        way = self._ways.get(progress.sender)
        if way is None or progress.itinerary_version != way.itinerary.version or not way.itinerary.legs:
            return
        in_hand = way.to_come(progress.leg)
        if in_hand > way.in_hand:
            return
        if in_hand < way.in_hand:
            way.in_hand, way.left = in_hand, set()
        way.leg = min(progress.leg, len(way.itinerary.legs) - 1)
        leg = way.itinerary.legs[way.leg]
        way.body = Segment(progress.track, progress.index)
        if leg.track == progress.track:
            way.left |= self._behind(leg, progress)
        is_over = progress.leg >= len(way.itinerary.legs) or _is_at_end(leg, progress)
        if is_over and progress.track in self.site.tracks:
            # Who has come to its end has left all but where it stands, whoever heard it give that back; beside a mouth
            # there is what only its clearance was in, which it never held.
            way.left |= way.turns.keys() - standing_segments(self.site, way.body)

    def on_return(self, node: int, segment: Segment) -> None:
        """A machine gave a segment's token back: it has left it, unless it lies ahead of it in the leg in hand.

        A grant that was lost and is said again may come when the machine is on its way back already.
        """
        way = self._ways.get(node)
        if way is None or not way.itinerary.legs:
            return
        leg = way.itinerary.legs[way.leg]
        if leg.action is LegAction.TRAVEL and leg.track == segment.track:
            step = 1 if leg.to_index > leg.from_index else -1
            if (segment.index - way.index) * step > 0:
                return
        way.left.add(segment)

    # --- the order ---------------------------------------------------------------------------------------------

    def predecessor(self, node: int, segment: Segment) -> int | None:
        """Who passes right before ``node``, 0 for nobody; None where the plan of ``node`` does not come here."""
        mine = self._first(node, segment)
        if mine is None:
            return None
        found = [(turns[1].from_us, other) for other, turns in self._before(node, segment)]
        return max(found)[1] if found else NOBODY

    def verdict(self, node: int, segment: Segment, version: int, believed: int) -> Reason:
        """Whether the order lets ``node`` have the segment now.

        ``version`` and ``believed`` are its request's itinerary version and predecessor. MIRROR_BEHIND where the two
        views differ and a newer word is needed to tell who is right.
        """
        way = self._ways.get(node)
        if way is None or is_newer(version, way.itinerary.version, 8):
            return Reason.MIRROR_BEHIND
        first = self.predecessor(node, segment)
        if first is None:
            # It stands here after power-up, or has a plan that was not heard: only where nobody plans to be.
            others = (other for other in self._ways if other != node)
            return Reason.MIRROR_BEHIND if any(self._first(o, segment) for o in others) else Reason.NONE
        if first == NOBODY:
            unknown = believed not in (NOBODY, node) and version == way.itinerary.version
            return Reason.MIRROR_BEHIND if unknown and not self._has_passed(believed, segment) else Reason.NONE
        same = first == believed or version != way.itinerary.version
        return Reason.TOKEN_NOT_GRANTABLE_YET if same else Reason.MIRROR_BEHIND

    def meetings(self, node: int, other: int) -> list[Meeting]:
        """Where the plans of ``node`` and ``other`` want one segment at one time, in what is not over."""
        mine, theirs = self._ways.get(node), self._ways.get(other)
        if mine is None or theirs is None:
            return []
        return [
            Meeting(segment, one, two, self._agreed_first(node, other, segment, one, two))
            for segment, one, two in sorted(meet(mine, theirs), key=lambda met: met[0])
        ]

    def leg_in_hand(self, plan: BegunItinerary) -> int:
        """Number of the leg that a machine has come to in a plan that counts; 0 of any other."""
        way = self._ways.get(plan.itinerary.sender)
        return way.leg if way is not None and way.itinerary is plan.itinerary else 0

    def place(self, node: int) -> Segment | None:
        """Where the body of a machine that counts is, by its own word."""
        way = self._ways.get(node)
        return way.place if way is not None and way.itinerary.legs else None

    def comes_us(self, node: int, there: Segment) -> int | None:
        """From when the next run of ``node`` is ``there`` by its plan, bus us; None where that run does not lead there.

        It cannot be made while a body is in it.
        """
        number, way = self._run_through(node, there), self._ways.get(node)
        if number is None or way is None:
            return None
        return next((turn.from_us for turn in way.open_turns(there) if turn.to_come == way.to_come(number)), None)

    def comes_next(self, node: int, there: Segment) -> bool:
        """Whether the next move of ``node`` by its plan, a hop too, takes the segment ``there``."""
        way = self._ways.get(node)
        number = None if way is None else way.next_move()
        if way is None or number is None:
            return False
        return any(turn.to_come == way.to_come(number) for turn in way.open_turns(there))

    def wants(self, node: int, segments: Iterable[Segment], from_us: int, to_us: int) -> bool:
        """Whether a machine wants any of these segments at that time, by its plan."""
        way, stay = self._ways.get(node), Turn(0, from_us, to_us)
        if way is None:
            return False
        return any(overlap_us(turn, stay) > TOLERANCE_US for slot in segments for turn in way.open_turns(slot))

    def in_front(self, node: int, other: int, meeting: Meeting) -> int:
        """Who of two that meet passes first by where it is; NOBODY where that does not tell."""
        if self._is_in_front(node, other, meeting.segment, meeting.mine, meeting.theirs):
            return other
        is_mine = self._is_in_front(other, node, meeting.segment, meeting.theirs, meeting.mine)
        return node if is_mine else NOBODY

    def behind_us(self, node: int, other: int, meetings: Sequence[Meeting]) -> int:
        """How much later than told the leg of ``node`` in these meetings has to begin to come behind ``other``, us.

        Of two that meet head on, who came behind in one segment and before in the next would run into the other: it
        comes behind all that the other does there in the legs that it meets and right after them. Where ``node`` is to
        be first by what they last agreed, the other comes later.
        """
        mine, theirs = self._ways[node], self._ways[other]
        (to_come,) = {meeting.mine.to_come for meeting in meetings}
        met = {meeting.theirs.to_come for meeting in meetings}
        pairs = [
            (one, two)
            for segment in mine.turns.keys() & theirs.turns.keys()
            for one in mine.open_turns(segment)
            for two in theirs.open_turns(segment)
            if one.to_come == to_come and met & {two.to_come, two.to_come + 1}
            if two.to_us < FOREVER and self._agreed_first(node, other, segment, one, two) != node
        ]
        by_us = max(meeting.theirs.to_us - meeting.mine.from_us for meeting in meetings)
        while True:
            still = [(one, two) for one, two in pairs if overlap_us(one.later(by_us), two) > TOLERANCE_US]
            if not still:
                return by_us
            by_us = max(two.to_us - one.from_us for one, two in still)

    # --- plans made at the same time ---------------------------------------------------------------------------

    def who_yields(self, node: int, other: int, meetings: Sequence[Meeting]) -> int:
        """Of ``node`` and ``other``, who meet without an order, the one on its way back while the other works.

        Where both are on their ways back, the one without work, else the older stamp: of two that work still only the
        younger can have counted on that. NOBODY where both work. A move that clears the way counts as that work.
        """
        mine, theirs = self._ways[node], self._ways[other]
        pairs = [(meeting.mine, meeting.theirs) for meeting in meetings]
        return {True: node, False: other, None: NOBODY}[self._first_yields(mine, theirs, pairs)]

    def makes_way(self, plan: BegunItinerary, other: int, now_us: int) -> bool | None:
        """Whether ``other`` would yield to a ``plan`` that is not told yet; None where they do not meet."""
        windows = leg_windows(self.site, plan.itinerary, now_us, plan.first_begin_us)
        theirs, new = self._ways.get(other), ToldWay.of(self.site, plan.itinerary, windows, now_us)
        pairs = [] if theirs is None else [(one, two) for _, one, two in meet(new, theirs)]
        if theirs is None or not pairs:
            return None
        return self._first_yields(new, theirs, pairs) is False

    def ranks_before(self, node: int, other: int) -> bool:
        """Whether the plan of ``node`` keeps its windows before that of ``other``: by stamp, then work before room.

        False where one of them is not known, or no plan counts on it.
        """
        mine, theirs = self._ways.get(node), self._ways.get(other)
        if mine is None or theirs is None:
            return False
        if mine.itinerary.stamp != theirs.itinerary.stamp:
            return ranks_before(mine.itinerary.stamp, theirs.itinerary.stamp)
        return (not has_work(mine.itinerary), node) < (not has_work(theirs.itinerary), other)

    def may_yield(self, node: int, stamp: Stamp) -> bool:
        """Whether what is left of the way back of ``node`` yields to work under ``stamp``."""
        way = self._ways.get(node)
        return way is not None and not self._clears(way) and not is_aged(way.itinerary.stamp, stamp)

    def _first_yields(self, one: ToldWay, two: ToldWay, pairs: Sequence[tuple[Turn, Turn]]) -> bool | None:
        """Whether the first of two machines yields, the second (False), or neither by this rule (None)."""
        first = all(self._is_voluntary(one, turn, two) for turn, _ in pairs)
        second = all(self._is_voluntary(two, turn, one) for _, turn in pairs)
        if first and second and has_work(two.itinerary):
            return not has_work(one.itinerary) or ranks_before(one.itinerary.stamp, two.itinerary.stamp)
        if first and second and has_work(one.itinerary):
            return False
        return None if first == second else first

    def _is_voluntary(self, way: ToldWay, turn: Turn, other: ToldWay) -> bool:
        """Whether a turn is of a way back that is not begun and yields to the ``other``."""
        if turn.to_come >= min(way.retreat, way.in_hand) or self._clears(way):
            return False
        return not is_aged(way.itinerary.stamp, other.itinerary.stamp)

    def _clears(self, way: ToldWay) -> bool:
        """Whether a move without work has the stamp of work: it clears the way for that."""
        if has_work(way.itinerary):
            return False
        stamp = way.itinerary.stamp
        return any(one.itinerary.stamp == stamp and has_work(one.itinerary) for one in self._ways.values())

    # --- inner works -------------------------------------------------------------------------------------------

    def _run_through(self, node: int, there: Segment | None) -> int | None:
        """Number of the leg of the next run of ``node``, where that leads through ``there``; else None."""
        way = self._ways.get(node)
        if way is None or there is None:
            return None
        legs, number = way.itinerary.legs, way.next_move()
        if number is None or legs[number].action is not LegAction.TRAVEL or legs[number].track != there.track:
            return None
        run, step = legs[number], _step(legs[number])
        here = way.index if number == way.leg else run.from_index
        return number if there.index in range(here + step, run.to_index + step, step) else None

    def _is_in_front(self, node: int, other: int, segment: Segment, mine: Turn, theirs: Turn) -> bool:
        """Whether ``other`` passes before ``node`` by where it is: in my next run, from where it goes on or leaves.

        Whatever was agreed, no plan leads through a body. Who stands there for ever gives way. I come behind it with
        all that I do in or after that run, and behind all that it does in a segment until it leaves: out of one before
        it, or through it again, that I came into behind it, would be a circle.
        """
        there = self.place(other)
        if there is None or theirs.to_us >= FOREVER:
            return False
        number = self._run_through(node, there)
        if number is None or segment.track != there.track:
            return self._goes_ahead(node, other, segment, mine, theirs)
        way, run = self._ways[node], self._ways[node].itinerary.legs[number]
        step = _step(run)
        if segment.index not in range(there.index, run.to_index + step, step):
            return False
        if mine.to_come > way.to_come(number) or self._run_through(other, self.place(node)) is not None:
            return False
        before = self._ways[other]
        return any(before.stays(segment, first, theirs.to_come) for first in before.line(segment, step))

    def _goes_ahead(self, node: int, other: int, segment: Segment, mine: Turn, theirs: Turn) -> bool:
        """The same over several tracks: wherever I come by where it is and go on the way that it goes on."""
        before = self._ways[other]
        return any(
            mine.to_come <= my_leg and before.stays(segment, their_leg, theirs.to_come)
            for their_leg, my_leg in ahead(self._ways[node], before).items()
        )

    def _agreed_first(self, node: int, other: int, segment: Segment, one: Turn, two: Turn) -> int | None:
        """Who of two machines comes first in these turns by the times under which they last agreed."""
        agreed = self._agreed.get((min(node, other), max(node, other)))
        return None if agreed is None else self._first_by(agreed, node, other, segment, one, two)

    def _first_by(
        self, agreed: tuple[Turns, Turns], node: int, other: int, segment: Segment, one: Turn, two: Turn
    ) -> int | None:
        """The same by given times, of the lower node-ID first."""
        first, second = agreed if node < other else (agreed[1], agreed[0])
        mine = next((turn for turn in first.get(segment, ()) if turn.to_come == one.to_come), None)
        theirs = next((turn for turn in second.get(segment, ()) if turn.to_come == two.to_come), None)
        if mine is None or theirs is None or overlap_us(mine, theirs) > TOLERANCE_US:
            return None
        return node if self._is_first(node, other, segment, mine, theirs) else other

    def _first(self, node: int, segment: Segment) -> Turn | None:
        way = self._ways.get(node)
        return None if way is None else next(way.open_turns(segment), None)

    def _before(self, node: int, segment: Segment) -> Iterator[tuple[int, tuple[Turn, Turn]]]:
        """Other machines that come before ``node`` on a segment, each with both turns (mine, theirs)."""
        for other in self._ways:
            if other != node:
                pair = self._pair(node, other, segment)
                if pair is not None and self._is_first(other, node, segment, pair[1], pair[0]):
                    yield other, pair

    def _is_first(self, node: int, other: int, segment: Segment, mine: Turn, theirs: Turn) -> bool:
        """Whether ``node`` passes first: who is in front of the other, else whose turn begins first."""
        if self._is_in_front(node, other, segment, mine, theirs):
            return False
        is_before = (mine.from_us, node) < (theirs.from_us, other)
        return is_before or self._is_in_front(other, node, segment, theirs, mine)

    def _pair(self, node: int, other: int, segment: Segment) -> tuple[Turn, Turn] | None:
        """The next turns of two machines, with the times under which they agreed last."""
        mine, theirs = self._ways[node], self._ways[other]
        if self._first(node, segment) is None or self._first(other, segment) is None:
            return None
        low, high = min(node, other), max(node, other)
        agreed = self._agreed.get((low, high))
        if agreed is not None:
            first, second = agreed if node == low else (agreed[1], agreed[0])
            one, two = next(mine.open_turns(segment, first), None), next(theirs.open_turns(segment, second), None)
            if one is not None and two is not None:
                return one, two
        one, two = self._first(node, segment), self._first(other, segment)
        return (one, two) if one is not None and two is not None else None

    def _agree(self, node: int, other: int, now_us: int, *, keep: bool) -> None:
        """Take the present times as agreed where the two plans have no conflict; else keep the last ones, if any."""
        low, high = min(node, other), max(node, other)
        one, two = self._ways[low], self._ways[high]
        if not conflict(one, two):
            self._agreed[low, high] = (one.turns, two.turns)
        elif not keep or self._have_crossed(node, other, now_us):
            self._agreed.pop((low, high), None)

    def _have_crossed(self, teller: int, other: int, now_us: int) -> bool:
        """Whether two plans were told at one time, each around the other's last one, and each has the other first.

        Then each of the two knows another pair of plans as the last without conflict, and they would come behind each
        other for ever: what they want at one time has no order, for whoever listens too.
        """
        new, known = self._ways[teller], self._ways[other]
        agreed = self._agreed.get((min(teller, other), max(teller, other)))
        if agreed is None or not known.before or now_us > known.told_us + CROSSED_US:
            return False
        if next(meet(new, known, known.before), None) is not None:
            return False
        around = (new.turns, known.before) if teller < other else (known.before, new.turns)
        for segment, mine, theirs in meet(new, known):
            firsts = {self._first_by(pair, teller, other, segment, mine, theirs) for pair in (agreed, around)}
            if len(firsts - {None}) > 1:
                return True
        return False

    def _has_passed(self, node: int, segment: Segment) -> bool:
        """Whether a machine's plan, or a token that it gave back, tells that it was here; it may come again later."""
        way = self._ways.get(node)
        if way is None:
            return False
        return segment in way.left or sum(1 for _ in way.open_turns(segment)) < len(way.turns.get(segment, ()))

    def _behind(self, leg: Leg, progress: Progress) -> set[Segment]:
        """Segments of a moving leg that the body, clearance included, has left; its rear begins behind its start."""
        if leg.action is not LegAction.TRAVEL or leg.track != progress.track or leg.track not in self.site.tracks:
            return set()
        step = 1 if leg.to_index > leg.from_index else -1
        pitch_mm = self.site.tracks[leg.track].pitch_mm
        rear_mm = progress.index * pitch_mm + progress.offset_mm - step * body_mm(self.site) // 2
        return {
            Segment(leg.track, index)
            for index in range(leg.from_index - step * self._reach[leg.track], leg.to_index, step)
            if (rear_mm - index * pitch_mm) * step >= pitch_mm // 2
        }


def _is_at_end(leg: Leg, progress: Progress) -> bool:
    """Whether a machine stands where a leg by which it drives leads."""
    stands_at_mark = abs(progress.offset_mm) <= MARK_TOLERANCE_MM and not progress.speed_mm_s
    is_there = (progress.track, progress.index) == (leg.track, leg.to_index)
    return leg.action is LegAction.TRAVEL and is_there and stands_at_mark


def _step(leg: Leg) -> int:
    return 1 if leg.to_index > leg.from_index else -1
