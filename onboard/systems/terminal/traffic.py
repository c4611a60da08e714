"""Everybody's plans as one temporal network, and the earliest dates in it (rows M12 to M22, M30 to M34).

A plan of n steps has n + 1 dates: step i begins at date i and ends at date i + 1, so the end of one *is* the beginning
of the next (M12). Only lower bounds count: the earliest date of each is the longest way to it. Robots follow each other
on an entity in the order of its list; a new plan says after whom it comes, so all mirrors keep the same lists.
"""

from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

from onboard.contract.messages import Reference
from onboard.systems.terminal.dates import DateConstraint, Dates, StepDate, earliest
from onboard.systems.terminal.plan import ActionPlan, EntityStay, Load
from onboard.systems.terminal.site import EntityKind, StationKind, Terminal

#: Who does not go on, and was waited for, is planned to be where it is for so long, us. Ours: longer than any plan (31
#: steps of minutes at most), and told in 24 bits of ms (PlanStep, dbc/terminal.dbc).
AWAY_US = 7_200_000_000


class EntityVisit(NamedTuple):
    """A machine's stay in an entity: steps ``first`` to ``last`` of its plan."""

    owner: int
    first: int
    last: int

    @property
    def key(self) -> EntityStay:
        """Its name on the bus."""
        return EntityStay(self.owner, self.first)


@dataclass
class Owned:
    """A plan in execution: ``current`` is its first step that is not over, begun at ``began``."""

    plan: ActionPlan
    current: int = 0
    began: int = 0

    @property
    def is_over(self) -> bool:
        """Whether all steps are done."""
        return self.current >= len(self.plan.steps)


class PlannedPick(NamedTuple):
    """Step ``step`` of a machine's plan picks a box up at a station."""

    owner: int
    step: int
    station: int


class InNeedOfHelp(NamedTuple):
    """Machines that leave where they are, and that end their plans, only once somebody has helped one that is out."""

    here: frozenset[int]
    at_the_end: frozenset[int]


class AnewFor(Enum):
    """Why a plan is made anew."""

    LATE = "a box would be put down after its date (M31)"
    CIRCLE = "plans wait for each other: all dates are lost until one is another (M16)"
    BLOCKED = "a lane of it is blocked, and was waited for (M33)"
    OUT = "who comes before in a list does not go on, and was waited for"


class PlanViolation(NamedTuple):
    """A plan that cannot be kept; ``text`` is for people."""

    owner: int
    why: AnewFor
    text: str


@dataclass
class Traffic:
    """The plans of all machines as one of them believes them to be. ``now`` bounds what is not over yet."""

    site: Terminal
    plans: dict[int, Owned] = field(default_factory=dict)
    #: Stays that are not over, by entity, in the order in which robots come.
    lists: dict[int, list[EntityVisit]] = field(default_factory=dict)
    #: Lanes that are blocked, and since when.
    blocked: dict[int, int] = field(default_factory=dict)
    #: Vehicles that do not go on by themselves, and since when: held, stopped or silent.
    out: dict[int, int] = field(default_factory=dict)
    #: Dates by which tasks are to be put down.
    before: dict[tuple[int, int], int] = field(default_factory=dict)
    #: Boxes under each box of a stack, from the machine's picture of the stations.
    below: dict[int, tuple[int, ...]] = field(default_factory=dict)
    changes: int = 0
    _known: tuple[int, int, Dates] | None = None
    _in_need: tuple[int, tuple[int, ...], InNeedOfHelp] | None = None

    # --- plans and reports -------------------------------------------------------------------------------------

    def take_up(self, plan: ActionPlan, now: int) -> bool:
        """Put a plan in place of its owner's former one; True where it was news."""
        known = self.plans.get(plan.owner)
        if known is not None and known.plan == plan:
            return False
        kept = self._place_in_hand(plan.owner)
        self._take_out(plan.owner)
        if not plan.steps:
            return True
        self.plans[plan.owner] = Owned(plan, 0, plan.begin)
        for number, (first, last) in enumerate(plan.visits()):
            entity = plan.steps[first].entity
            visit = EntityVisit(plan.owner, first, last)
            row = self.lists.setdefault(entity, [])
            if number == 0:
                known_place = kept[1] if kept is not None and kept[0] == entity else None
                row.insert(self._place_in_row(plan.owner, row, plan.steps[0].after, known_place), visit)
            else:
                row.insert(self._place(row, visit, plan), visit)
        self._straighten()
        return True

    def withdraw(self, owner: int) -> None:
        """A machine has no plan any more."""
        self._take_out(owner)

    def report(self, owner: int, version: int, step: int, ended: int) -> bool:
        """A step is over: delete it, its end is the beginning of the next (M30). True where it was news."""
        owned = self.plans.get(owner)
        if owned is None or owned.plan.version != version or not owned.current <= step < len(owned.plan.steps):
            return False
        owned.current, owned.began = step + 1, ended
        for row in self.lists.values():
            row[:] = [visit for visit in row if visit.owner != owner or visit.last > step]
        self.changes += 1
        if owned.is_over:
            self._take_out(owner)
        else:
            self._come_in(owner, owned.current)
            self._straighten()
        return True

    def _come_in(self, owner: int, step: int) -> None:
        """Whoever is in an entity is there before everybody who is not, whatever was planned."""
        row = self.lists.get(self.plans[owner].plan.steps[step].entity, [])
        place = next((n for n, one in enumerate(row) if one.owner == owner and one.first == step), None)
        if place is not None:
            visit = row.pop(place)
            row.insert(min(place, sum(1 for one in row[:place] if self.is_inside(one))), visit)

    def _take_out(self, owner: int) -> None:
        self.changes += 1
        self.plans.pop(owner, None)
        for row in self.lists.values():
            row[:] = [visit for visit in row if visit.owner != owner]

    def _place_in_hand(self, owner: int) -> tuple[int, int] | None:
        """Entity and place in its list of the stay that a machine is in."""
        owned = self.plans.get(owner)
        if owned is None or owned.is_over:
            return None
        entity = owned.plan.steps[owned.current].entity
        row = self.lists.get(entity, [])
        return next(
            (
                (entity, number)
                for number, visit in enumerate(row)
                if visit.owner == owner and visit.first <= owned.current <= visit.last
            ),
            None,
        )

    def _place(self, row: list[EntityVisit], visit: EntityVisit, plan: ActionPlan) -> int:
        """Right after the one named; where that one is gone, by the dates, and after everybody who is there."""
        step = plan.steps[visit.first]
        begin = plan.begin if visit.first == 0 else plan.steps[visit.first - 1].end
        # Whoever comes twice comes first with its first stay.
        own = max((number + 1 for number, other in enumerate(row) if other.owner == plan.owner), default=0)
        inside = max((number + 1 for number, other in enumerate(row) if self.is_inside(other)), default=own)
        inside = max(inside, own)
        for number, other in enumerate(row):
            if other.key == step.after:
                return max(inside, number + 1)
        if step.after.owner in (0, plan.owner):
            return inside
        owned_at = [self._told_begin(other) for other in row]
        return max(inside, sum(1 for told in owned_at if told <= begin))

    def _place_in_row(self, owner: int, row: list[EntityVisit], after: EntityStay, known: int | None) -> int:
        """Whoever is there already says whom it is behind: that is so on the ground. Nobody: in front.

        Where that one is not known, who says that it is behind this machine is: a machine that was off hears of one
        after the other (drawn terminal 29).
        """
        owners = [visit.owner for visit in row]
        if not after.owner:
            return 0
        if after.owner in owners:
            return owners.index(after.owner) + 1
        if known is not None:
            return known
        behind = (n for n, visit in enumerate(row) if self.is_inside(visit) and self._told_after(visit).owner == owner)
        return next(behind, sum(1 for visit in row if self.is_inside(visit)))

    def _told_after(self, visit: EntityVisit) -> EntityStay:
        return self.plans[visit.owner].plan.steps[visit.first].after

    def _told_begin(self, visit: EntityVisit) -> int:
        plan = self.plans[visit.owner].plan
        return plan.begin if visit.first == 0 else plan.steps[visit.first - 1].end

    def is_inside(self, visit: EntityVisit) -> bool:
        """Whether a stay has begun, by the reports heard."""
        owned = self.plans.get(visit.owner)
        return owned is not None and visit.first <= owned.current <= visit.last

    def _straighten(self) -> None:
        """Who is ahead on a lane, or passes a crossing for one first, comes first where both go next.

        That is so on the ground, whatever a mirror that lacks a frame believes of the order.
        """
        for _ in range(len(self.plans)):
            moved = [entity for entity in list(self.lists) if self._straighten_behind(entity)]
            if not moved:
                return

    def _straighten_behind(self, entity: int) -> bool:
        place = self.site.entities[entity]
        if place.kind is not EntityKind.LANE and (place.kind is not EntityKind.CROSSING or place.capacity != 1):
            return False
        moved = False
        for ahead, behind in pairwise(self.lists[entity]):
            first, second = self._next_visit(ahead), self._next_visit(behind)
            if first is None or second is None or first[0] != second[0] or self.is_inside(first[1]):
                continue
            row = self.lists[first[0]]
            if row.index(second[1]) < row.index(first[1]) and not self.is_inside(second[1]):
                row.remove(first[1])
                row.insert(row.index(second[1]), first[1])
                moved = True
        return moved

    def _next_visit(self, visit: EntityVisit) -> tuple[int, EntityVisit] | None:
        """Where a machine goes from a stay, and its stay there."""
        steps = self.plans[visit.owner].plan.steps
        if visit.last + 1 >= len(steps):
            return None
        entity = steps[visit.last + 1].entity
        following = (one for one in self.lists.get(entity, ()) if one.owner == visit.owner)
        found = next((one for one in following if one.first == visit.last + 1), None)
        return None if found is None else (entity, found)

    # --- dates -------------------------------------------------------------------------------------------------

    def dates(self, now: int) -> Dates:
        """The earliest dates; remembered until something changes."""
        if self._known is None or self._known[:2] != (self.changes, now):
            self._known = (self.changes, now, earliest(*self._network(now)))
        return self._known[2]

    def _network(self, now: int) -> tuple[dict[StepDate, int], list[DateConstraint]]:
        floors: dict[StepDate, int] = {}
        edges: list[DateConstraint] = []
        for owner, owned in self.plans.items():
            count = len(owned.plan.steps)
            for step in range(owned.current, count + 1):
                floors[StepDate(owner, step)] = owned.began if step == owned.current else now
            edges += [
                DateConstraint(StepDate(owner, step), StepDate(owner, step + 1), owned.plan.steps[step].duration)
                for step in range(owned.current, count)
            ]
            self._add_blocked(owned, floors, now)
            if self.out:
                self._add_out(owned, floors, now)
        for entity, row in self.lists.items():
            edges += self._list_edges(entity, row)
        edges += self._stack_edges()
        return floors, edges

    def _add_blocked(self, owned: Owned, floors: dict[StepDate, int], now: int) -> None:
        """Nobody knows how long a lane stays blocked: so long as waiting for it is patience."""
        for step in range(owned.current, len(owned.plan.steps)):
            since = self.blocked.get(owned.plan.steps[step].entity)
            if since is not None:
                node = StepDate(owned.plan.owner, step + 1)
                floors[node] = max(floors[node], since + self.site.patience_us, now)

    def _add_out(self, owned: Owned, floors: dict[StepDate, int], now: int) -> None:
        """Nobody knows when a person comes: for so long as one waits for a lane it may be soon, and then not at all."""
        since = self.out.get(owned.plan.owner)
        if since is not None and not owned.is_over:
            node, patience = StepDate(owned.plan.owner, owned.current + 1), self.site.patience_us
            floors[node] = max(floors[node], since + patience if now < since + patience else now + AWAY_US)

    def _begin(self, visit: EntityVisit) -> StepDate:
        return StepDate(visit.owner, max(visit.first, self.plans[visit.owner].current))

    def _list_edges(self, entity: int, row: list[EntityVisit]) -> list[DateConstraint]:
        place, gap = self.site.entities[entity], self.site.gap_us
        edges: list[DateConstraint] = []
        is_lane = place.kind is EntityKind.LANE
        for number, visit in enumerate(row):
            end = StepDate(visit.owner, visit.last + 1)
            if is_lane and number + 1 < len(row):
                behind = row[number + 1]
                edges.append(DateConstraint(end, StepDate(behind.owner, behind.last + 1), gap))
                if not self.is_inside(behind):
                    edges.append(DateConstraint(self._begin(visit), self._begin(behind), gap))
            follower = number + place.capacity
            if place.capacity and follower < len(row) and not self.is_inside(row[follower]):
                edges.append(DateConstraint(end, self._begin(row[follower]), gap))
        return edges

    def _stack_edges(self) -> list[DateConstraint]:
        """Upper box first (M17)."""
        gap = self.site.gap_us
        return [
            DateConstraint(StepDate(upper.owner, upper.step + 1), StepDate(lower.owner, lower.step), gap)
            for upper, lower in self._stacked()
        ]

    def _stacked(self) -> list[tuple[PlannedPick, PlannedPick]]:
        """Each two boxes of one stack that plans are to fetch, the upper one first."""
        picks = {}
        for owner, owned in self.plans.items():
            for load in owned.plan.loads:
                if owned.current <= load.pick < len(owned.plan.steps):
                    picks[load.box] = PlannedPick(owner, load.pick, owned.plan.steps[load.pick].entity)
        found = []
        for box, upper in picks.items():
            if self.site.entities[upper.station].station is not StationKind.STACK:
                continue
            for lower in self.below.get(box, ()):
                if lower in picks and picks[lower].station == upper.station:
                    found += [(upper, picks[lower])]
        return found

    def stands_too_early(self, owner: int) -> bool:
        """Whether a machine stands at a stack for a box that is under one that another's plan fetches there first."""
        owned = self.plans[owner]
        last = next(last for _, last in owned.plan.visits() if last >= owned.current)
        return any(lower.owner == owner != upper.owner and lower.step <= last for upper, lower in self._stacked())

    # --- what follows ------------------------------------------------------------------------------------------

    def begin_and_end(self, visit: EntityVisit, now: int) -> tuple[int, int]:
        """Earliest dates at which a stay begins and ends."""
        dates = self.dates(now).at
        return dates[self._begin(visit)], dates[StepDate(visit.owner, visit.last + 1)]

    def end_of(self, owner: int, now: int) -> int:
        """When a machine's plan ends at the earliest; ``now`` where it has none."""
        owned = self.plans.get(owner)
        return now if owned is None else self.dates(now).at[StepDate(owner, len(owned.plan.steps))]

    def waits_for_good(self, owner: int, now: int) -> bool:
        """Whether a machine's plan comes to its end only if somebody helps one that does not go on."""
        return self.is_waited_for(now) and owner in self._in_need_of_help(now).at_the_end

    def _waited_for(self, now: int) -> tuple[int, ...]:
        return tuple(owner for owner, since in self.out.items() if now >= since + self.site.patience_us)

    def is_waited_for(self, now: int) -> bool:
        """Whether anybody does not go on for longer than one waits for a lane."""
        return bool(self._waited_for(now))

    def stuck(self, now: int) -> frozenset[int]:
        """Machines that do not leave where they are before somebody has helped: who is out, and who is behind it."""
        return self._in_need_of_help(now).here if self.is_waited_for(now) else frozenset()

    def _in_need_of_help(self, now: int) -> InNeedOfHelp:
        """Remembered: what waits for who is out is put off as time goes on, and nothing else comes to be."""
        of = (self.changes, self._waited_for(now))
        if self._in_need is None or self._in_need[:2] != of:
            at = self.dates(now).at
            late = [node for node, date in at.items() if is_for_good(date, now)]
            here = frozenset(node.owner for node in late if node.step == self.plans[node.owner].current + 1)
            ends = frozenset(node.owner for node in late if node.step == len(self.plans[node.owner].plan.steps))
            self._in_need = (*of, InNeedOfHelp(here, ends))
        return self._in_need[2]

    def is_nobody_left(self, now: int) -> bool:
        """Whether no vehicle goes on, out for longer than one waits for a lane or behind such a one."""
        if not self.is_waited_for(now):
            return False
        until, stuck = now - self.site.patience_us, self.stuck(now)
        return all(node in stuck or self.out.get(node, now) <= until for node in self.site.vehicles)

    def carrying(self, task: Reference) -> Owned | None:
        """The plan that carries out a task."""
        return next((one for one in self.plans.values() if any(load.task == task for load in one.plan.loads)), None)

    def date_of(self, load: Load) -> int:
        """By when a load is to be put down, 0 for no date."""
        return load.before or self.before.get(load.task, 0)

    def violations(self, now: int) -> list[PlanViolation]:
        """Plans that cannot be kept (M16, M31): only these are to be made anew, the later ones of a circle first."""
        dates = self.dates(now)
        found = []
        if dates.circle:
            return [PlanViolation(self._breaker(dates.circle, now), AnewFor.CIRCLE, "plans wait for each other")]
        for owner, owned in self.plans.items():
            for load in owned.plan.loads:
                date = self.date_of(load)
                if date and load.put >= owned.current and dates.at[StepDate(owner, load.put + 1)] >= date:
                    found.append(PlanViolation(owner, AnewFor.LATE, f"box {load.box} would be put down too late"))
                    break
        return found

    def _breaker(self, circle: frozenset[int], now: int) -> int:
        """Whose plan is to be made anew to end a circle: the latest without which there is none, else the latest.

        Before them who stands where another is to fetch first: no plan of that one's ends the circle.
        """
        begun = {owner: self.plans[owner].plan.begin for owner in circle}
        ranked = sorted(circle, key=lambda owner: (self.stands_too_early(owner), begun[owner], owner), reverse=True)
        for owner in ranked:
            trial, owned = copy_of(self), self.plans[owner]
            _, last = next(visit for visit in owned.plan.visits() if visit[1] >= owned.current)
            steps = owned.plan.steps[owned.current : last + 1]
            trial.take_up(ActionPlan(owner, owned.plan.version, owned.began, steps), now)
            if not trial.dates(now).circle:
                return owner
        return ranked[0]

    def through(self, lane: int) -> list[int]:
        """Machines that plan to enter a lane and are not in it."""
        return sorted({visit.owner for visit in self.lists.get(lane, ()) if not self.is_inside(visit)})


def copy_of(traffic: Traffic) -> Traffic:
    """A picture to try things on."""
    return Traffic(
        traffic.site,
        {owner: replace(owned) for owner, owned in traffic.plans.items()},
        {entity: list(row) for entity, row in traffic.lists.items()},
        dict(traffic.blocked),
        dict(traffic.out),
        dict(traffic.before),
        dict(traffic.below),
    )


def is_for_good(end: int, now: int) -> bool:
    """Whether a date is one that only comes if somebody helps a machine that does not go on."""
    return end - now >= AWAY_US
