"""Who passes a segment before whom: the order in which tokens are granted (design, section 5).

Firm plans without conflict give an order of passing on every segment. It is agreed where two machines' plans, as last
told, nowhere want one segment at one time; while a delay of one has not been answered by the other they do, and then
the order is the one last agreed. What a machine has passed no longer counts: its own words (the leg in hand, where its
body is) and the tokens that it gave back tell, never the clock. So a machine that is late, or dead, keeps its place in
the order until it tells another plan, and a wrong order costs time, never safety.

A plan that is told anew drops the legs that are over, so a moving leg is known by how many more come behind it.
All times are bus time in us. Pure: plans, progress and grants in, an order out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, takewhile
from typing import NamedTuple

from onboard.contract.codes import LegAction, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp
from onboard.core.serial import is_newer, ranks_before
from onboard.core.site import Segment
from onboard.ways.occupancy import body_mm, leg_windows, reach_segments
from onboard.ways.passing import TOLERANCE_US, BegunItinerary
from onboard.ways.reservations import FOREVER
from onboard.ways.retreats import has_work, is_aged, moves, retreat_moves
from onboard.ways.site import WaySite


class Turn(NamedTuple):
    """Occupation of a segment during one leg, ``to_come`` moving legs before the plan's end."""

    to_come: int
    from_us: int
    to_us: int


Turns = dict[Segment, list[Turn]]


class Meeting(NamedTuple):
    """Two machines want one segment at one time: their turns, and who comes first by what they last agreed, or None."""

    segment: Segment
    mine: Turn
    theirs: Turn
    first: int | None


@dataclass
class _Way:
    """One machine's plan: its turns, and how far it has come.

    ``in_hand`` is how many moving legs come behind leg number ``leg``, the one in hand; in that leg its body is at
    index ``body`` and has left the segments ``left``. ``retreat`` moving legs come behind its last work.
    """

    itinerary: Itinerary
    turns: Turns
    moves: tuple[Leg, ...]
    in_hand: int
    retreat: int
    leg: int = 0
    body: int | None = None
    left: set[Segment] = field(default_factory=set)

    @property
    def place(self) -> Segment:
        """Where its body is, by its own word."""
        leg = self.itinerary.legs[self.leg]
        return Segment(leg.track, leg.from_index if self.body is None else self.body)

    def open_turns(self, segment: Segment, turns: Turns | None = None) -> Iterator[Turn]:
        """Turns on a segment that are not over, in order; with other times where ``turns`` are given."""
        for turn in (self.turns if turns is None else turns).get(segment, ()):
            if turn.to_come < self.in_hand or (turn.to_come == self.in_hand and segment not in self.left):
                yield turn

    def ends_as(self, told: "_Way") -> bool:
        """Whether a plan ``told`` anew has what is left of this one: who makes the same trip once more begins again."""
        count = len(told.moves)
        return count <= self.in_hand + 1 and self.moves[len(self.moves) - count :] == told.moves

    def go_on(self, known: "_Way", more: int) -> None:
        """With the leg that was in hand in the plan told before, of which this one has ``more`` moving legs behind it.

        A wait before it only tells when it began.
        """
        legs = range(len(self.itinerary.legs))
        in_hand = known.in_hand + more
        leg = next((leg for leg in legs if self.to_come(leg) == in_hand), None)
        if leg is not None:
            self.in_hand, self.leg, self.body, self.left = in_hand, leg, known.body, known.left

    def line(self, segment: Segment, step: int) -> Iterator[int]:
        """``to_come`` of the legs by which it passes a segment, as far as it goes on in one direction from here."""
        for number in range(self.leg, len(self.itinerary.legs)):
            leg = self.itinerary.legs[number]
            if leg.action is LegAction.TRAVEL and leg.track == segment.track:
                if (leg.to_index - leg.from_index) * step <= 0:
                    return
                if segment.index in range(leg.from_index, leg.to_index + step, step):
                    yield self.to_come(number)
            elif leg.action not in (LegAction.STAND, LegAction.WORK):
                return
            elif leg.from_index == segment.index:
                yield self.to_come(number)

    def stays(self, segment: Segment, first: int, last: int) -> bool:
        """Whether it is in a segment without a break from its turn ``first`` moving legs before the end to ``last``."""
        stay = [turn for turn in self.turns.get(segment, ()) if last <= turn.to_come <= first]
        ends = [stay[0].to_come, stay[-1].to_come] if stay else []
        return ends == [first, last] and all(one.to_us >= two.from_us for one, two in pairwise(stay))

    def to_come(self, leg: int) -> int:
        """How many moving legs come behind leg number ``leg``."""
        return sum(moves(one) for one in self.itinerary.legs[leg + 1 :])


@dataclass
class PassingOrder:
    """The order of passing on all segments, as far as one machine has heard."""

    site: WaySite
    _ways: dict[int, _Way] = field(default_factory=dict)
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

    def on_plan(self, plan: BegunItinerary, now_us: int) -> None:
        """A firm plan under a new version, or a released one, which has no turns."""
        node = plan.itinerary.sender
        known = self._ways.get(node)
        way = self._way(plan, now_us)
        continued = known is not None and known.ends_as(way)
        before, same = (0, 0) if known is None or continued else _shared(known, way)
        if known is not None and (continued or same):
            way.go_on(known, 0 if continued else len(way.moves) - before)
        self._ways[node] = way
        if same:
            self._lead_on(node, before, same, len(way.moves))
        for other in self._ways:
            if other != node:
                self._agree(node, other, keep=continued or same > 0)

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
        if leg.track == progress.track:
            way.body = progress.index
            way.left |= self._behind(leg, progress)

    def on_return(self, node: int, segment: Segment) -> None:
        """A machine gave a segment's token back: it has left it, unless it lies ahead of it in the leg in hand.

        A grant that was lost and is said again may come when the machine is on its way back already.
        """
        way = self._ways.get(node)
        if way is None or not way.itinerary.legs:
            return
        leg = way.itinerary.legs[way.leg]
        if leg.action is LegAction.TRAVEL and leg.track == segment.track:
            body = leg.from_index if way.body is None else way.body
            step = 1 if leg.to_index > leg.from_index else -1
            if (segment.index - body) * step > 0:
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
            for segment, one, two in sorted(_meet(mine, theirs), key=lambda met: met[0])
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

    def in_front(self, node: int, other: int, meeting: Meeting) -> int:
        """Who of two that meet passes first by where it is; NOBODY where that does not tell."""
        if self._is_in_front(node, other, meeting.segment, meeting.mine, meeting.theirs):
            return other
        is_mine = self._is_in_front(other, node, meeting.segment, meeting.theirs, meeting.mine)
        return node if is_mine else NOBODY

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
        theirs, new = self._ways.get(other), self._way(plan, now_us)
        pairs = [] if theirs is None else [(one, two) for _, one, two in _meet(new, theirs)]
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

    def _first_yields(self, one: _Way, two: _Way, pairs: Sequence[tuple[Turn, Turn]]) -> bool | None:
        """Whether the first of two machines yields, the second (False), or neither by this rule (None)."""
        first = all(self._is_voluntary(one, turn, two) for turn, _ in pairs)
        second = all(self._is_voluntary(two, turn, one) for _, turn in pairs)
        if first and second and has_work(two.itinerary):
            return not has_work(one.itinerary) or ranks_before(one.itinerary.stamp, two.itinerary.stamp)
        if first and second and has_work(one.itinerary):
            return False
        return None if first == second else first

    def _is_voluntary(self, way: _Way, turn: Turn, other: _Way) -> bool:
        """Whether a turn is of a way back that is not begun and yields to the ``other``."""
        if turn.to_come >= min(way.retreat, way.in_hand) or self._clears(way):
            return False
        return not is_aged(way.itinerary.stamp, other.itinerary.stamp)

    def _clears(self, way: _Way) -> bool:
        """Whether a move without work has the stamp of work: it clears the way for that."""
        if has_work(way.itinerary):
            return False
        stamp = way.itinerary.stamp
        return any(one.itinerary.stamp == stamp and has_work(one.itinerary) for one in self._ways.values())

    # --- inner works -------------------------------------------------------------------------------------------

    def _way(self, plan: BegunItinerary, now_us: int) -> _Way:
        itinerary = plan.itinerary
        way = _Way(itinerary, _turns(self.site, plan, now_us), _moves(itinerary), 0, retreat_moves(itinerary))
        way.in_hand = way.to_come(0) if itinerary.legs else 0
        return way

    def _run_through(self, node: int, there: Segment | None) -> int | None:
        """Number of the leg of the next run of ``node``, where that leads through ``there``; else None."""
        way = self._ways.get(node)
        if way is None or there is None:
            return None
        legs = way.itinerary.legs
        number = next((number for number in range(way.leg, len(legs)) if moves(legs[number])), None)
        if number is None or legs[number].action is not LegAction.TRAVEL or legs[number].track != there.track:
            return None
        run, step = legs[number], _step(legs[number])
        here = way.body if way.body is not None and number == way.leg else run.from_index
        return number if there.index in range(here + step, run.to_index + step, step) else None

    def _is_in_front(self, node: int, other: int, segment: Segment, mine: Turn, theirs: Turn) -> bool:
        """Whether ``other`` passes before ``node`` by where it is: in my next run, from where it goes on or leaves.

        Whatever was agreed, no plan leads through a body. Who stands there for ever gives way. I come behind it with
        all that I do in or after that run, and behind all that it does in a segment until it leaves: out of one before
        it, or through it again, that I came into behind it, would be a circle.
        """
        there = self.place(other)
        number = self._run_through(node, there)
        if there is None or number is None or theirs.to_us >= FOREVER or segment.track != there.track:
            return False
        way, run = self._ways[node], self._ways[node].itinerary.legs[number]
        step = _step(run)
        if segment.index not in range(there.index, run.to_index + step, step):
            return False
        if mine.to_come > way.to_come(number) or self._run_through(other, self.place(node)) is not None:
            return False
        before = self._ways[other]
        return any(before.stays(segment, first, theirs.to_come) for first in before.line(segment, step))

    def _agreed_first(self, node: int, other: int, segment: Segment, one: Turn, two: Turn) -> int | None:
        """Who of two machines comes first in these turns by the times under which they last agreed."""
        agreed = self._agreed.get((min(node, other), max(node, other)))
        if agreed is None:
            return None
        first, second = agreed if node < other else (agreed[1], agreed[0])
        mine = next((turn for turn in first.get(segment, ()) if turn.to_come == one.to_come), None)
        theirs = next((turn for turn in second.get(segment, ()) if turn.to_come == two.to_come), None)
        if mine is None or theirs is None or _overlap_us(mine, theirs) > TOLERANCE_US:
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

    def _agree(self, node: int, other: int, *, keep: bool) -> None:
        """Take the present times as agreed where the two plans have no conflict; else keep the last ones, if any."""
        low, high = min(node, other), max(node, other)
        one, two = self._ways[low], self._ways[high]
        if not _conflict(one, two):
            self._agreed[low, high] = (one.turns, two.turns)
        elif not keep:
            self._agreed.pop((low, high), None)

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


def _shared(known: _Way, way: _Way) -> tuple[int, int]:
    """How many moving legs of ``known``, from that with which ``way`` begins, and how many of these ``way`` has too."""
    for start in range(max(0, len(known.moves) - known.in_hand - 1), len(known.moves)):
        if known.moves[start : start + 1] == way.moves[:1]:
            pairs = zip(known.moves[start:], way.moves, strict=False)
            return len(known.moves) - start, sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    return 0, 0


def _moves(itinerary: Itinerary) -> tuple[Leg, ...]:
    return tuple(leg._replace(end_ms=0) for leg in itinerary.legs if moves(leg))


def _turns(site: WaySite, plan: BegunItinerary, now_us: int) -> Turns:
    legs = [leg for leg in plan.itinerary.legs if leg.track in site.tracks]
    to_come = sum(moves(leg) for leg in legs)
    found: Turns = {}
    for number, windows in enumerate(leg_windows(site, plan.itinerary, now_us, plan.first_begin_us)):
        if number < len(legs):
            to_come -= moves(legs[number])
        for window in windows:
            turns = found.setdefault(window.segment, [])
            if turns and turns[-1].to_come == to_come:
                turns[-1] = turns[-1]._replace(to_us=max(turns[-1].to_us, window.to_us))
            else:
                turns.append(Turn(to_come, window.from_us, window.to_us))
    return found


def _conflict(one: _Way, two: _Way) -> bool:
    """Whether two plans want one segment at one time, in what is not over."""
    return next(_meet(one, two), None) is not None


def _meet(one: _Way, two: _Way) -> Iterator[tuple[Segment, Turn, Turn]]:
    """Where two plans want one segment at one time, in what is not over: the turns of both, in no order of segments."""
    for segment in one.turns.keys() & two.turns.keys():
        for mine in one.open_turns(segment):
            for theirs in two.open_turns(segment):
                if _overlap_us(mine, theirs) > TOLERANCE_US:
                    yield segment, mine, theirs


def _step(leg: Leg) -> int:
    return 1 if leg.to_index > leg.from_index else -1


def _overlap_us(one: Turn, two: Turn) -> int:
    return min(one.to_us, two.to_us) - max(one.from_us, two.from_us)
