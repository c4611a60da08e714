"""Making plans (rows M23 to M27): one way at a time through the gaps that everybody's plans leave, earliest end first.

A plan found in the gaps delays nobody. Where none is free, the last resort is to come where it delays others and the
lists stay without a circle. Nothing here is optimal over all plans, on purpose (M26).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from onboard.contract.messages import Reference
from onboard.contract.terminal import Action
from onboard.systems.terminal.dates import StepDate
from onboard.systems.terminal.plan import (
    MAX_STEPS,
    NO_STEP,
    NOBODY_BEFORE,
    ActionPlan,
    ActionStep,
    Load,
    drive_steps,
    handling_steps,
)
from onboard.systems.terminal.routes import routes
from onboard.systems.terminal.site import EntityKind, StationKind, Terminal
from onboard.systems.terminal.traffic import EntityVisit, Traffic, copy_of

_EVER = 1 << 62


class BoxTransport(NamedTuple):
    """One transport: a box from station to station; ``source`` 0 where it is aboard already."""

    box: int
    task: Reference
    source: int
    target: int
    before: int = 0


class Room(NamedTuple):
    """A gap in an entity's list: come in ``[enter_low, enter_high]``, leave in ``[leave_low, leave_high]``."""

    place: int
    enter_low: int
    enter_high: int
    leave_low: int
    leave_high: int


class _Stay(NamedTuple):
    """One visit of a way: its entity and its steps."""

    entity: int
    steps: tuple[ActionStep, ...]
    box: int

    @property
    def puts(self) -> bool:
        """Whether a box is put down."""
        return any(step.action is Action.PUT_DOWN for step in self.steps)


@dataclass(frozen=True, slots=True)
class _Reached:
    """A stay begun at ``enter`` in gap ``room``; the one before it, to go back along the way."""

    enter: int
    room: Room
    before: "_Reached | None"


class FoundPlan(NamedTuple):
    """A plan, and whether it delays others."""

    plan: ActionPlan
    pushes: bool


@dataclass
class PlanSearch:
    """Plans of one machine over its mirror. ``now`` in the unit of the site's durations."""

    site: Terminal
    traffic: Traffic
    owner: int
    now: int
    avoid: frozenset[int] = frozenset()

    def best(
        self, here: int, began: int, job: BoxTransport, *, version: int, kept: ActionPlan | None = None
    ) -> FoundPlan | None:
        """The plan that ends first for a machine that is in ``here`` since ``began`` and has nothing to do but ``job``.

        ``kept`` are the steps that come first, of the plan in hand. None where no way leads there.
        """
        found: list[FoundPlan] = []
        if kept is not None and self._buries(kept, job.source):
            return None
        for steps in self._ways(here, job):
            if len(steps) + (len(kept.steps) if kept is not None else 0) > MAX_STEPS:
                continue
            one = self._fit(steps, began, job, version, kept)
            if one is not None:
                found.append(one)
        return min(found, key=lambda one: (one.pushes, one.plan.end), default=None)

    def _buries(self, kept: ActionPlan, source: int) -> bool:
        """Whether the plan in hand ends with a box on the stack from which the next one is to be fetched: above it."""
        return self._is_stack(source) and any(kept.steps[load.put].entity == source for load in kept.loads)

    def _is_stack(self, entity: int) -> bool:
        return bool(entity) and self.site.entities[entity].station is StationKind.STACK

    # --- ways --------------------------------------------------------------------------------------------------

    def _ways(self, here: int, job: BoxTransport) -> Iterator[list[ActionStep]]:
        """Several routes to the loading station, several on to the unloading station."""
        site, count = self.site, self.site.routes
        if not job.source:
            for way in routes(site, here, job.target, count, self.avoid):
                yield self._unload(way, job, 0)
            return
        area = site.entities[job.source].area
        for first in routes(site, here, job.source, count, self.avoid):
            load = drive_steps(site, first) + handling_steps(site, job.source, Action.PICK_UP)
            for second in routes(site, area, job.target, count, self.avoid):
                yield load + self._unload(second, job, job.source)

    def _unload(self, way: tuple[int, ...], job: BoxTransport, before: int) -> list[ActionStep]:
        return drive_steps(self.site, way, before) + handling_steps(self.site, job.target, Action.PUT_DOWN)

    # --- gaps --------------------------------------------------------------------------------------------------

    def rooms(self, entity: int, box: int = 0, *, puts: bool = False) -> list[Room]:
        """All gaps of an entity's list that delay nobody, in order, to fetch ``box`` there, or to put one down."""
        place, gap = self.site.entities[entity], self.site.gap_us
        row = [visit for visit in self.traffic.lists.get(entity, ()) if visit.owner != self.owner]
        if not place.capacity and place.kind is not EntityKind.LANE:
            return [Room(len(row), -_EVER, _EVER, -_EVER, _EVER)]
        times = [self.traffic.begin_and_end(visit, self.now) for visit in row]
        low, high = self._stack_places(row, box, puts=puts)
        found = []
        for number in range(low, min(high, len(row)) + 1):
            room = self._room(number, times, place.capacity, gap, is_lane=place.kind is EntityKind.LANE)
            if room is not None:
                found.append(room)
        return found

    @staticmethod
    def _room(number: int, times: list[tuple[int, int]], capacity: int, gap: int, *, is_lane: bool) -> Room | None:
        enter_low = leave_low = -_EVER
        enter_high = leave_high = _EVER
        if number:
            enter_low = times[number - 1][0] + (gap if is_lane else 0)
            leave_low = times[number - 1][1] + gap if is_lane else -_EVER
        if number < len(times):
            enter_high = times[number][0] - (gap if is_lane else 0)
            leave_high = times[number][1] - gap if is_lane else _EVER
        if capacity:
            if number >= capacity:
                enter_low = max(enter_low, times[number - capacity][1] + gap)
            if number + capacity - 1 < len(times):
                leave_high = min(leave_high, times[number + capacity - 1][0] - gap)
            for other in range(max(0, number - capacity + 1), number):
                follower = other + capacity - 1
                if number <= follower < len(times) and times[follower][0] < times[other][1] + gap:
                    return None
        return Room(number, enter_low, enter_high, leave_low, leave_high)

    def _stack_places(self, row: list[EntityVisit], box: int, *, puts: bool) -> tuple[int, int]:
        """Behind whoever takes a box from above this one, before whoever takes one from below or puts one on it.

        Who ``puts`` one on a stack comes behind all who fetch from it.
        """
        low, high = 0, len(row)
        for number, visit in enumerate(row):
            owned = self.traffic.plans[visit.owner]
            is_stack = self._is_stack(owned.plan.steps[visit.first].entity)
            for load in owned.plan.loads:
                picks = visit.first <= load.pick <= visit.last
                if picks and box and box in self.traffic.below.get(load.box, ()):
                    low = max(low, number + 1)
                elif picks and box and load.box in self.traffic.below.get(box, ()):
                    high = min(high, number)
                elif picks and puts and is_stack:
                    low = max(low, number + 1)
                elif box and is_stack and visit.first <= load.put <= visit.last:
                    high = min(high, number)
        return low, high

    # --- fitting -----------------------------------------------------------------------------------------------

    def _fit(
        self, steps: list[ActionStep], began: int, job: BoxTransport, version: int, kept: ActionPlan | None
    ) -> FoundPlan | None:
        stays = _stays(steps, job.box)
        last = self._through(stays, began, is_kept=kept is not None)
        if last is not None:
            return FoundPlan(self._plan(steps, stays, last, job, version, kept), pushes=False)
        plan = self._push(steps, stays, began, job, version, kept)
        return FoundPlan(plan, pushes=True) if plan is not None else None

    def _through(self, stays: list[_Stay], began: int, *, is_kept: bool) -> _Reached | None:
        """The earliest way through the gaps: for each gap of each stay, the earliest coming in."""
        reached = [_Reached(began, room, None) for room in self._first_rooms(stays[0], is_kept=is_kept)]
        for stay, after in zip(stays, [*stays[1:], None], strict=True):
            if after is None:
                break
            rooms = self.rooms(after.entity, after.box, puts=after.puts)
            following: dict[int, _Reached] = {}
            for one in reached:
                leave = max(self._leave(stay, one.enter), one.room.leave_low, self.now)
                for room in rooms:
                    enter = max(leave, room.enter_low)
                    known = following.get(room.place)
                    fits = enter <= min(one.room.leave_high, room.enter_high)
                    if fits and (known is None or enter < known.enter):
                        following[room.place] = _Reached(enter, room, one)
            reached = list(following.values())
        ends = [(max(self._leave(stays[-1], one.enter), one.room.leave_low), one) for one in reached]
        fitting = [(end, one.room.place, one) for end, one in ends if end <= one.room.leave_high]
        return min(fitting, key=lambda each: each[:2])[2] if fitting else None

    def _first_rooms(self, stay: _Stay, *, is_kept: bool) -> list[Room]:
        """Where a machine is, it is: its place in the list is its own; behind it others may wait already."""
        row = self.traffic.lists.get(stay.entity, [])
        mine = next((n for n, one in enumerate(row) if one.owner == self.owner and self.traffic.is_inside(one)), None)
        if is_kept or mine is None:
            return [Room(len(row), -_EVER, _EVER, -_EVER, _EVER)]
        if self.site.entities[stay.entity].kind is not EntityKind.LANE:
            return [Room(mine, -_EVER, _EVER, -_EVER, _EVER)]
        ends = [self.traffic.begin_and_end(one, self.now)[1] for one in row]
        low = max(ends[:mine], default=-_EVER) + self.site.gap_us
        return [Room(mine, -_EVER, _EVER, low, min(ends[mine + 1 :], default=_EVER) - self.site.gap_us)]

    def _leave(self, stay: _Stay, enter: int) -> int:
        """When a stay can end at the earliest."""
        return self._dates(stay, enter)[-1]

    def _dates(self, stay: _Stay, enter: int) -> list[int]:
        """When each step of a stay ends at the earliest; what lies above the box is to be gone before it is taken."""
        dates = []
        at = enter
        for step in stay.steps:
            if step.action is Action.PICK_UP:
                at = max(at, self._free_above(stay.box))
            at += step.duration
            dates.append(at)
        return dates

    def _free_above(self, box: int) -> int:
        at = -_EVER
        for owner, owned in self.traffic.plans.items():
            for load in owned.plan.loads:
                if owner != self.owner and owned.current <= load.pick < NO_STEP and self._is_above(load.box, box):
                    at = max(at, self.traffic.dates(self.now).at[StepDate(owner, load.pick + 1)] + self.site.gap_us)
        return at

    def _is_above(self, upper: int, lower: int) -> bool:
        return lower in self.traffic.below.get(upper, ())

    def _plan(
        self,
        steps: list[ActionStep],
        stays: list[_Stay],
        last: _Reached,
        job: BoxTransport,
        version: int,
        kept: ActionPlan | None,
    ) -> ActionPlan:
        """The plan along the gaps, each stay ending when the next begins, with its predecessor on every list."""
        chain: list[_Reached] = []
        one: _Reached | None = last
        while one is not None:
            chain.insert(0, one)
            one = one.before
        dated: list[ActionStep] = []
        for number, (stay, at) in enumerate(zip(stays, chain, strict=True)):
            ends = self._dates(stay, at.enter)
            ends[-1] = max(ends[-1], at.room.leave_low)
            if number + 1 < len(chain):
                ends[-1] = chain[number + 1].enter
            row = [visit for visit in self.traffic.lists.get(stay.entity, ()) if visit.owner != self.owner]
            after = row[at.room.place - 1].key if 0 < at.room.place <= len(row) else NOBODY_BEFORE
            for step, end in zip(stay.steps, ends, strict=True):
                dated.append(step._replace(end=end, after=after))
        return self._joined(dated, chain[0].enter, job, version, kept)

    def _joined(
        self, dated: list[ActionStep], began: int, job: BoxTransport, version: int, kept: ActionPlan | None
    ) -> ActionPlan:
        before = len(kept.steps) if kept is not None else 0
        picks = [number for number, step in enumerate(dated) if step.action is Action.PICK_UP]
        puts = [number for number, step in enumerate(dated) if step.action is Action.PUT_DOWN]
        load = Load(job.box, job.task, before + picks[0] if picks else NO_STEP, before + puts[0], job.before)
        if kept is None:
            return ActionPlan(self.owner, version, began, tuple(dated), (load,))
        return replace(kept, version=version, steps=(*kept.steps, *dated), loads=(*kept.loads, load))

    def _push(
        self,
        steps: list[ActionStep],
        stays: list[_Stay],
        began: int,
        job: BoxTransport,
        version: int,
        kept: ActionPlan | None,
    ) -> ActionPlan | None:
        """Where others are delayed: before those only who follow on the lane in hand, behind all, or before all.

        Who does not go on is passed by all. None where each of these makes a circle.
        """
        followers, stuck = self._followers(stays[0].entity), self.traffic.stuck(self.now)
        for ahead_of in (followers | stuck, stuck, frozenset(self.traffic.plans)):
            dated: list[ActionStep] = []
            at = began
            for stay in stays:
                row = [visit for visit in self.traffic.lists.get(stay.entity, ()) if visit.owner != self.owner]
                low, high = self._stack_places(row, stay.box, puts=stay.puts)
                first = (n for n, one in enumerate(row) if one.owner in ahead_of and not self.traffic.is_inside(one))
                place = min(high, max(next(first, len(row)), low if stay.puts else 0))
                if stay is stays[0] and kept is None:
                    place = self._first_rooms(stay, is_kept=False)[0].place
                after = row[place - 1].key if place else NOBODY_BEFORE
                for step in stay.steps:
                    at = max(at + step.duration, self.now)
                    dated.append(step._replace(end=at, after=after))
            plan = self._dated(self._joined(dated, began, job, version, kept))
            if plan is not None:
                return plan
        return None

    def _followers(self, entity: int) -> frozenset[int]:
        """Machines behind this one on the lane that it is in."""
        row = self.traffic.lists.get(entity, [])
        if self.site.entities[entity].kind is not EntityKind.LANE:
            return frozenset()
        mine = next((n for n, one in enumerate(row) if one.owner == self.owner), len(row))
        return frozenset(one.owner for one in row[mine + 1 :])

    def _dated(self, plan: ActionPlan) -> ActionPlan | None:
        """A plan with the dates that follow when it is put between the others; None where they would never end."""
        trial = copy_of(self.traffic)
        trial.take_up(plan, self.now)
        dates = trial.dates(self.now)
        if dates.circle:
            return None
        ends = [dates.at[StepDate(self.owner, number + 1)] for number in range(len(plan.steps))]
        return replace(plan, steps=tuple(step._replace(end=end) for step, end in zip(plan.steps, ends, strict=True)))


def _stays(steps: list[ActionStep], box: int) -> list[_Stay]:
    """The steps in groups of one entity each; the box is named where it is picked up."""
    found: list[_Stay] = []
    for number, step in enumerate(steps):
        if number and steps[number - 1].entity == step.entity:
            found[-1] = found[-1]._replace(steps=(*found[-1].steps, step))
        else:
            found.append(_Stay(step.entity, (step,), 0))
        if step.action is Action.PICK_UP:
            found[-1] = found[-1]._replace(box=box)
    return found


def remaining(traffic: Traffic, owner: int, now: int) -> ActionPlan | None:
    """What is left of a machine's plan, as a plan of its own that begins with the step in hand; None where nothing is.

    Each step comes after whom it comes after now, so the lists stay as they are.
    """
    owned = traffic.plans.get(owner)
    if owned is None:
        return None
    old, skip = owned.plan, owned.current
    dates = traffic.dates(now).at
    steps, end = [], owned.began
    for number in range(skip, len(old.steps)):
        step = old.steps[number]
        # On a circle there are no dates; a plan that is told then still follows itself in time.
        end = max(dates[StepDate(owner, number + 1)], end + step.duration)
        row = traffic.lists.get(step.entity, [])
        place = next((n for n, one in enumerate(row) if one.owner == owner and one.first <= number <= one.last), 0)
        after = row[place - 1].key if place else NOBODY_BEFORE
        if after.owner == owner:
            after = after._replace(step=max(0, after.step - skip))
        steps.append(step._replace(end=end, after=after))
    loads = tuple(
        load._replace(pick=load.pick - skip if skip <= load.pick < NO_STEP else NO_STEP, put=load.put - skip)
        for load in old.loads
        if load.put >= skip
    )
    return ActionPlan(owner, old.version, owned.began, tuple(steps), loads)
