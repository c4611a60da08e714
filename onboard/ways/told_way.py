"""One machine's plan as it was told: when it began, its turns on segments, and how far it has come by its own words.

The wire does not repeat when the leg in hand began.

A plan that is told anew drops the legs that are over, so a moving leg is known by how many more come behind it.
All times are bus time in us.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, pairwise, takewhile
from typing import NamedTuple

from onboard.contract.codes import LegAction
from onboard.contract.messages import Itinerary, Leg
from onboard.core.serial import BUS_MS_MODULUS, away, from_bus_ms
from onboard.core.site import Segment
from onboard.ways.occupancy import LegWindows, hop_origin, is_hop, leg_begins_us
from onboard.ways.site import WaySite

#: Windows told in whole milliseconds may overlap by their rounding; so much is no conflict, us.
TOLERANCE_US = 10_000


class BegunItinerary(NamedTuple):
    """A firm itinerary and when its first leg began (bus us)."""

    itinerary: Itinerary
    first_begin_us: int


def next_plan(known: BegunItinerary | None, in_hand: int, itinerary: Itinerary, now_us: int) -> BegunItinerary:
    """The plan that ``itinerary`` tells after ``known``: a first leg that was planned before keeps its begin.

    An itinerary names the ends of its legs and its award; a leg under way began long after that. Legs of ``known``
    before number ``in_hand`` are over: a first leg like one of these is of the next trip by the same way.
    """
    award_us = from_bus_ms(itinerary.stamp.award_ms, now_us)
    if known is None or not itinerary.legs:
        return BegunItinerary(itinerary, award_us)
    begins_us = leg_begins_us(known.itinerary, now_us, known.first_begin_us)
    for leg, begin_us in [*zip(known.itinerary.legs, begins_us, strict=True)][in_hand:]:
        if _way(leg) == _way(itinerary.legs[0]):
            return BegunItinerary(itinerary, min(begin_us, from_bus_ms(itinerary.legs[0].end_ms, now_us)))
    return BegunItinerary(itinerary, award_us)


def moves(leg: Leg) -> bool:
    """Whether a leg is more than standing: waits come and go as a plan is delayed."""
    return leg.action is not LegAction.STAND


def retreat_moves(itinerary: Itinerary) -> int:
    """How many moving legs a plan has behind its last work; all, where it has none."""
    return sum(moves(leg) for leg in itinerary.legs[worked(itinerary) :])


def has_work(itinerary: Itinerary) -> bool:
    """Whether a plan still carries or fetches."""
    return worked(itinerary) > 0


def worked(itinerary: Itinerary) -> int:
    """How many legs there are up to the last work."""
    return max((number for number, leg in enumerate(itinerary.legs, 1) if leg.action is LegAction.WORK), default=0)


class Turn(NamedTuple):
    """Occupation of a segment during one leg, ``to_come`` moving legs before the plan's end."""

    to_come: int
    from_us: int
    to_us: int

    def later(self, by_us: int) -> "Turn":
        """The same turn so much later."""
        return Turn(self.to_come, self.from_us + by_us, self.to_us + by_us)


Turns = dict[Segment, list[Turn]]


def turns_of(site: WaySite, itinerary: Itinerary, windows: LegWindows) -> Turns:
    """The turns of a plan on each segment, in order; a leg that holds one without a break has one turn there."""
    legs = [leg for leg in itinerary.legs if leg.track in site.tracks]
    to_come = sum(moves(leg) for leg in legs)
    found: Turns = {}
    for number, held in enumerate(windows):
        if number < len(legs):
            to_come -= moves(legs[number])
        for window in held:
            turns = found.setdefault(window.segment, [])
            if turns and turns[-1].to_come == to_come:
                turns[-1] = turns[-1]._replace(to_us=max(turns[-1].to_us, window.to_us))
            else:
                turns.append(Turn(to_come, window.from_us, window.to_us))
    return found


def overlap_us(one: Turn, two: Turn) -> int:
    """For how long two turns take their segment both; negative: so far apart."""
    return min(one.to_us, two.to_us) - max(one.from_us, two.from_us)


@dataclass
class ToldWay:
    """One machine's plan: its turns, and how far it has come.

    ``in_hand`` is how many moving legs come behind leg number ``leg``, the one in hand; in that leg its body is in
    ``body`` and has left the segments ``left``. ``retreat`` moving legs come behind its last work. ``start`` is where
    the first leg begins, None where a hop does not tell.
    """

    itinerary: Itinerary
    turns: Turns
    moves: tuple[Leg, ...]
    in_hand: int
    retreat: int
    leg: int = 0
    start: Segment | None = None
    body: Segment | None = None
    left: set[Segment] = field(default_factory=set)
    #: When it was told, bus us, and the times that it had before, where the same trip goes on.
    told_us: int = 0
    before: Turns = field(default_factory=dict)

    @classmethod
    def of(cls, site: WaySite, told: Itinerary, windows: LegWindows, now_us: int) -> "ToldWay":
        """A plan of which nothing is over yet, with the windows of its legs."""
        going = tuple(leg._replace(end_ms=0) for leg in told.legs if moves(leg))
        way = cls(told, turns_of(site, told, windows), going, 0, retreat_moves(told), told_us=now_us)
        if told.legs:
            first = told.legs[0]
            way.start = hop_origin(site, first) if is_hop(first) else Segment(first.track, first.from_index)
            way.in_hand = way.to_come(0)
        return way

    @property
    def place(self) -> Segment | None:
        """Where its body is, by its own word: before a hop, and while it turns, where that begins.

        None where it has not said so yet, and its plan begins with a hop from one of several tracks.
        """
        leg = self.itinerary.legs[self.leg]
        if self.body is not None and (self.body.track == leg.track or is_hop(leg)):
            return self.body
        return self.start if self.leg == 0 else Segment(leg.track, leg.from_index)

    @property
    def index(self) -> int:
        """How far it has come on the track of the leg in hand."""
        leg, place = self.itinerary.legs[self.leg], self.place
        return place.index if place is not None and place.track == leg.track else leg.from_index

    def open_turns(self, segment: Segment, turns: Turns | None = None) -> Iterator[Turn]:
        """Turns on a segment that are not over, in order; with other times where ``turns`` are given."""
        for turn in (self.turns if turns is None else turns).get(segment, ()):
            if turn.to_come < self.in_hand or (turn.to_come == self.in_hand and segment not in self.left):
                yield turn

    def ends_as(self, told: "ToldWay") -> bool:
        """Whether a plan ``told`` anew has what is left of this one: who makes the same trip once more begins again."""
        count = len(told.moves)
        return count <= self.in_hand + 1 and self.moves[len(self.moves) - count :] == told.moves

    def shared(self, told: "ToldWay") -> tuple[int, int]:
        """How many moving legs this has from that on with which ``told`` begins, and how many of these that has too."""
        for start in range(max(0, len(self.moves) - self.in_hand - 1), len(self.moves)):
            if self.moves[start : start + 1] == told.moves[:1]:
                pairs = zip(self.moves[start:], told.moves, strict=False)
                return len(self.moves) - start, sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
        return 0, 0

    def go_on(self, known: "ToldWay", more: int) -> None:
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

    def goes_on(self, until: tuple[LegAction, ...]) -> Iterator[tuple[Segment | None, int]]:
        """Its place, then where runs and hops lead ``until`` another leg, each with ``to_come`` of what leads there."""
        here = self.place
        yield here, self.in_hand
        for number in range(self.leg, len(self.itinerary.legs)):
            leg = self.itinerary.legs[number]
            if leg.action in until:
                return
            if leg.action is LegAction.TRAVEL:
                for index in self._indices(number):
                    if Segment(leg.track, index) != here:
                        here = Segment(leg.track, index)
                        yield here, self.to_come(number)

    def _indices(self, number: int) -> range:
        """Indices along a run or a hop, of the one in hand what is left."""
        leg = self.itinerary.legs[number]
        step = 1 if leg.to_index > leg.from_index else -1
        return range(self.index if number == self.leg else leg.from_index, leg.to_index + step, step)

    def stays(self, segment: Segment, first: int, last: int) -> bool:
        """Whether it is in a segment without a break from its turn ``first`` moving legs before the end to ``last``."""
        stay = [turn for turn in self.turns.get(segment, ()) if last <= turn.to_come <= first]
        ends = [stay[0].to_come, stay[-1].to_come] if stay else []
        return ends == [first, last] and all(one.to_us >= two.from_us for one, two in pairwise(stay))

    def next_move(self) -> int | None:
        """Number of its next moving leg, the one in hand where that moves; None where there is none."""
        legs = self.itinerary.legs
        return next((number for number in range(self.leg, len(legs)) if moves(legs[number])), None)

    def to_come(self, leg: int) -> int:
        """How many moving legs come behind leg number ``leg``."""
        return sum(moves(one) for one in self.itinerary.legs[leg + 1 :])


def ahead(one: ToldWay, two: ToldWay) -> dict[int, int]:
    """Legs of ``two``, from where it is, that ``one`` comes behind it on the same way; each with that of ``one``.

    By their ``to_come``. Empty where ``one`` works or rides before it comes by, or goes on elsewhere from there.
    """
    mine = [*one.goes_on((LegAction.WORK, LegAction.RIDE))]
    there = next((number for number, (segment, _) in enumerate(mine) if segment and segment == two.place), len(mine))
    found: dict[int, int] = {}
    theirs = islice(two.goes_on((LegAction.RIDE,)), 1, None)
    for (segment, my_leg), (other, their_leg) in zip(mine[there + 1 :], theirs, strict=False):
        if segment != other:
            break
        found.setdefault(their_leg, my_leg)
    return found


def conflict(one: ToldWay, two: ToldWay) -> bool:
    """Whether two plans want one segment at one time, in what is not over."""
    return next(meet(one, two), None) is not None


def meet(one: ToldWay, two: ToldWay, other_turns: Turns | None = None) -> Iterator[tuple[Segment, Turn, Turn]]:
    """Where two plans want one segment at one time, in what is not over: the turns of both, in no order of segments.

    With ``other_turns`` as the times of the second.
    """
    turns = two.turns if other_turns is None else other_turns
    for segment in one.turns.keys() & turns.keys():
        for mine in one.open_turns(segment):
            for theirs in two.open_turns(segment, turns):
                if overlap_us(mine, theirs) > TOLERANCE_US:
                    yield segment, mine, theirs


def reread_us(time_us: int, near_us: int) -> int:
    """The time nearest to ``near_us`` that is told on the wire as ``time_us`` is: what was read while a clock lied."""
    return near_us + away(time_us, near_us, BUS_MS_MODULUS * 1000)


def _way(leg: Leg) -> tuple[int, ...]:
    return leg.action, leg.track, leg.from_index, leg.to_index, leg.side
