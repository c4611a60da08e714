"""Giving way: what another machine's plan means for mine (rows P38, P44; design, section 5).

Wherever the two plans want one segment at one time:
- where an order was agreed before, a delay has upset it: who comes first goes on, the other comes later by what is
  missing (an action dependency graph as of Hoenig et al., "Persistent and Robust Execution of MAPF Schedules in
  Warehouses", 2019: an order taken from plans without conflict has no cycle, so nobody waits for ever);
- where none was, the plans were made at the same time, or one counts on the other's way back, which yields to work
  (``onboard.ways.retreats``); who only stands there gives way; else who holds the segment's token goes on, else who has
  the lower stamp. The other plans its way anew, under its old stamp, so that nobody is displaced for ever; who has
  no work clears the way of who comes, and takes its stamp.
"""

from dataclasses import dataclass
from enum import Enum

from onboard.contract.codes import LegAction
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Stamp
from onboard.core.authority import segment_token
from onboard.core.site import Segment
from onboard.systems.car_park.program import CarStep, Program, ends_at
from onboard.systems.car_park.standoff import Standoff
from onboard.ways.kinematics import run_duration_us
from onboard.ways.mirror import WayFleet
from onboard.ways.occupancy import standing_segments
from onboard.ways.passing_order import Meeting
from onboard.ways.reservations import FOREVER
from onboard.ways.site import WaySite
from onboard.ways.told_way import TOLERANCE_US, Turn, has_work

#: Nobody comes behind what another plans to do later than so long from now, us: no work that is done takes so long, and
#: plans that are put off by each other for ever would end where no leg can be told any more (4.6 h, 24 bits of ms).
FARTHEST_US = 3_600_000_000


class YieldDecision(Enum):
    """What a machine does about another's plan."""

    NOTHING = "nothing"
    LATER = "later"
    ANEW = "anew"


@dataclass
class GivingWay:
    """Looks at each plan that is heard and changes the program's times where it has to. The way is the robot's part."""

    fleet: WayFleet
    program: Program
    standoff: Standoff
    #: To whose work, by its stamp, my way back was told again last.
    _answered: tuple[int, Stamp] | None = None

    def heed(self, sender: int, now_us: int) -> YieldDecision:
        """What the newest plan of ``sender`` means; at LATER the program is told again, mostly with other times."""
        first = self.standoff.goes_first(sender, now_us)
        if first == sender:
            return self.fall_back(sender, now_us)
        meetings = self._meetings(sender, now_us)
        unordered = [meeting for meeting in meetings if meeting.first is None and first == NOBODY]
        yields = self.fleet.mirror.order.who_yields(self.fleet.node_id, sender, unordered) if unordered else NOBODY
        # One decision for all that they want at one time: by each slot's own both would turn, and again for that.
        decisive = min(unordered, key=_begin, default=None)
        if decisive is not None and self._has_to_turn(decisive, sender, yields):
            return YieldDecision.ANEW
        answer = self._come_behind(sender, [meeting for meeting in meetings if meeting.first == sender], now_us)
        if answer is YieldDecision.NOTHING and unordered and self._is_counted_on(sender):
            # It may have counted on my way back to yield; that is begun, and it hears so.
            self.program.shift(0)
            return YieldDecision.LATER
        return answer

    def _is_counted_on(self, sender: int) -> bool:
        """Whether ``sender`` has to hear that I go on: once for its work, or two would answer each other for ever."""
        plan = self.fleet.mirror.itineraries.get(sender)
        if plan is None or not has_work(plan) or self.program.works() or self._answered == (sender, plan.stamp):
            return False
        self._answered = sender, plan.stamp
        return True

    def stamp_for(self, sender: int, now_us: int) -> Stamp:
        """Under which stamp I make room for ``sender``: its own where I only stand in its way, without work."""
        plan = self.fleet.mirror.itineraries.get(sender)
        stands = any(_stands(one.mine) and not _stands(one.theirs) for one in self._meetings(sender, now_us))
        if plan is None or not stands or not has_work(plan) or self.program.works():
            return self.program.stamp
        return plan.stamp

    def fall_back(self, sender: int, now_us: int) -> YieldDecision:
        """Where no other way was found: come behind ``sender`` on the way that I have."""
        meetings = self._meetings(sender, now_us)
        behind = [meeting for meeting in meetings if meeting.first != self.fleet.node_id]
        return self._come_behind(sender, behind, now_us)

    def _meetings(self, sender: int, now_us: int) -> list[Meeting]:
        found = self.fleet.mirror.order.meetings(self.fleet.node_id, sender)
        return [meeting for meeting in found if min(meeting.mine.to_us, meeting.theirs.to_us) > now_us]

    def _has_to_turn(self, meeting: Meeting, sender: int, yields: int) -> bool:
        if yields == NOBODY and _stands(meeting.mine) != _stands(meeting.theirs):
            return _stands(meeting.mine)
        in_front = self.fleet.mirror.order.in_front(self.fleet.node_id, sender, meeting)
        if in_front != NOBODY:
            # Whatever rights there are: no plan leads through a body.
            return in_front == sender
        holder = self.fleet.tokens.holder_of(segment_token(meeting.segment))
        if holder in (self.fleet.node_id, sender):
            # A right in hand outranks stamps: whoever has it is about to be there.
            return holder == sender
        if yields != NOBODY:
            return yields == self.fleet.node_id
        return self.fleet.mirror.order.ranks_before(sender, self.fleet.node_id)

    def _come_behind(self, sender: int, meetings: list[Meeting], now_us: int) -> YieldDecision:
        """Move each of my steps so far that it begins when the others' turns are over; work in hand stays as it is."""
        ends_us: dict[int, list[Meeting]] = {}
        for meeting in meetings:
            if meeting.theirs.to_us < now_us + FARTHEST_US:
                ends_us.setdefault(meeting.mine.to_come, []).append(meeting)
        planned = {_to_come(self.program.remaining, number): step for number, step in _moving(self.program.remaining)}
        answer = YieldDecision.NOTHING
        for to_come in sorted(ends_us, reverse=True):
            step = planned.get(to_come)
            if step is None:
                continue
            number = next(
                n for n, _ in _moving(self.program.remaining) if _to_come(self.program.remaining, n) == to_come
            )
            now = self.program.remaining[number]
            if number == 0 and now.action is LegAction.WORK:
                # I am there: to stay for longer than the work takes helps nobody, and all would plan around that.
                continue
            if number == 0:
                lacking_us = max(meeting.theirs.to_us - meeting.mine.from_us for meeting in ends_us[to_come])
                by_us = lacking_us - _slack_us(self.fleet.site, now)
            else:
                lacking_us = self.fleet.mirror.order.behind_us(self.fleet.node_id, sender, ends_us[to_come])
                by_us = lacking_us - (now.begin_us - step.begin_us)
            if by_us > TOLERANCE_US:
                self.program.delay(self._not_in_the_way(number, by_us, sender), by_us)
                answer = YieldDecision.LATER
        return answer

    def _not_in_the_way(self, number: int, by_us: int, sender: int) -> int:
        """Of step ``number`` and those before it the last before which to wait so long is not in the way of ``sender``.

        Who came out of a spur to wait in front of it for who is to pass would be waited for there, and so on for ever.
        """
        remaining, order = self.program.remaining, self.fleet.mirror.order
        for before, _ in reversed(_moving(remaining[: number + 1])):
            if before == 0:
                break
            place = ends_at(self.fleet.site, remaining[before - 1])
            begin_us = remaining[before].begin_us
            if not order.wants(sender, standing_segments(self.fleet.site, place), begin_us, begin_us + by_us):
                return before
        return number


def _begin(meeting: Meeting) -> tuple[int, Segment]:
    """From when two machines want a segment both: the same for either."""
    return max(meeting.mine.from_us, meeting.theirs.from_us), meeting.segment


def _stands(turn: Turn) -> bool:
    return turn.to_us >= FOREVER


def _moving(steps: list[CarStep]) -> list[tuple[int, CarStep]]:
    return [(number, step) for number, step in enumerate(steps) if step.action is not LegAction.STAND]


def _to_come(steps: list[CarStep], number: int) -> int:
    return len(_moving(steps[number + 1 :]))


def _slack_us(site: WaySite, step: CarStep) -> int:
    """How much later than at once a run in hand may still enter what lies ahead, by its planned end."""
    if step.action is not LegAction.TRAVEL:
        return 0
    if step.from_index == step.to_index:
        # A hop through the mouth of a spur holds both ends from its beginning.
        return 0
    length_mm = abs(step.to_index - step.from_index) * site.tracks[step.track].pitch_mm
    return max(0, step.end_us - step.begin_us - run_duration_us(length_mm, site.carrier))
