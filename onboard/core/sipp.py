"""Safe-interval path planning (SIPP; Phillips and Likhachev 2011) with whole rest-to-rest runs as edges.

A state is (phase, segment, safe interval), reached standing at the earliest possible time; waiting inside the interval
is free. An edge is one run to any other segment of the track with its exact windows, departing as early as all swept
segments are safe, so following another machine with a headway comes out by itself. Phases are the visits still to be
made; after the last one the route must end in a refuge that is safe for ever.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import NamedTuple

from onboard.core.codes import LegAction
from onboard.core.kinematics import ceil_ms, run_duration_us
from onboard.core.occupancy import Sweep, leg_sweeps, standing_segments
from onboard.core.reservations import FOREVER, Interval, Reservations
from onboard.core.site import Segment, Site, TrackKind


class Visit(NamedTuple):
    """Stand at ``segment`` for ``dwell_us``, beginning not before ``not_before_us`` (bus time)."""

    segment: Segment
    dwell_us: int
    not_before_us: int = 0


class RouteLeg(NamedTuple):
    """One leg ``[begin_us, end_us)``, both whole milliseconds; WORK is a visit's dwell, STAND a wait."""

    action: LegAction
    track: int
    from_index: int
    to_index: int
    begin_us: int
    end_us: int


class Route(NamedTuple):
    """A plan: its legs, when each visit ends, when the last one ends, and what the search cost."""

    legs: tuple[RouteLeg, ...]
    visit_ends_us: tuple[int, ...]
    finish_us: int
    expansions: int


class NoRoute(NamedTuple):
    """No plan within the bound of expansions, and why."""

    reason: str
    expansions: int


class _State(NamedTuple):
    phase: int
    segment: Segment
    interval: Interval


class _Node(NamedTuple):
    """A state reached at ``time_us`` from ``parent`` by a move that began at ``begin_us``."""

    state: _State
    time_us: int
    parent: "_Node | None"
    action: LegAction
    begin_us: int
    visit_ends_us: tuple[int, ...]


def free_flow_us(site: Site, start: Segment, start_us: int, visits: tuple[Visit, ...]) -> int:
    """When the last visit would end with nobody in the way: a bound of every route. FOREVER where out of reach."""
    time_us, here = ceil_ms(start_us), start
    for visit in visits:
        run_us = _direct_us(site, here, visit.segment)
        if run_us >= FOREVER:
            return FOREVER
        time_us = ceil_ms(max(time_us + run_us, visit.not_before_us) + visit.dwell_us)
        here = visit.segment
    return time_us


def _direct_us(site: Site, origin: Segment, goal: Segment) -> int:
    """Shortest time between two segments: one run on a track, and the short runs through a spur's mouth."""
    if origin.track == goal.track:
        pitch_mm = site.tracks[origin.track].pitch_mm
        return run_duration_us(abs(origin.index - goal.index) * pitch_mm, site.carrier)
    best_us = FOREVER
    for mouth, inside in _mouths(site, origin):
        if inside.track == goal.track and mouth.track == origin.track:
            hop_us = run_duration_us(site.tracks[inside.track].pitch_mm, site.carrier)
            best_us = min(best_us, _direct_us(site, origin, mouth) + hop_us + _direct_us(site, inside, goal))
    if site.tracks[origin.track].kind is TrackKind.SPUR:
        for mouth in site.tracks[origin.track].joins:
            hop_us = run_duration_us(site.tracks[origin.track].pitch_mm, site.carrier)
            best_us = min(
                best_us, _direct_us(site, Segment(origin.track, 1), origin) + hop_us + _direct_us(site, mouth, goal)
            )
    return best_us


def _mouths(site: Site, segment: Segment) -> Iterator[tuple[Segment, Segment]]:
    """Pairs (alley segment, first spur segment) of all spurs on the track of ``segment``."""
    for track in site.tracks.values():
        if track.kind is TrackKind.SPUR:
            for mouth in track.joins:
                if mouth.track == segment.track:
                    yield mouth, Segment(track.number, 1)


@dataclass
class _Search:
    site: Site
    reservations: Reservations
    owner: int
    start_us: int
    visits: tuple[Visit, ...]
    refuges: frozenset[Segment]
    gaps: dict[Segment, list[Interval]] = field(default_factory=dict)
    standing: dict[Segment, list[Interval]] = field(default_factory=dict)

    # --- safe intervals ----------------------------------------------------------------------------------------

    def safe(self, segment: Segment) -> list[Interval]:
        """Gaps of one segment, looked up once per search."""
        found = self.gaps.get(segment)
        if found is None:
            found = self.gaps[segment] = self.reservations.safe_intervals(segment, self.owner, self.start_us)
        return found

    def safe_standing(self, segment: Segment) -> list[Interval]:
        """When a body may stand at a segment: all that it touches there must be free."""
        found = self.standing.get(segment)
        if found is None:
            touched = standing_segments(self.site, segment)
            found = self.safe(touched[0])
            for other in touched[1:]:
                found = _intersect(found, self.safe(other))
            self.standing[segment] = found
        return found

    # --- moves -------------------------------------------------------------------------------------------------

    def runs(self, node: _Node) -> Iterator[tuple[Segment, int, list[tuple[Segment, Sweep]]]]:
        """All runs from a segment: (destination, duration, swept segments with their times)."""
        here = node.state.segment
        track = self.site.tracks[here.track]
        for index in range(1, track.length + 1):
            if index == here.index:
                continue
            step = 1 if index > here.index else -1
            count = abs(index - here.index)
            swept = [
                (Segment(here.track, here.index + step * sweep.offset), sweep)
                for sweep in leg_sweeps(self.site, here.track, count)
                if 1 <= here.index + step * sweep.offset <= track.length
            ]
            yield Segment(here.track, index), run_duration_us(count * track.pitch_mm, self.site.carrier), swept
        yield from self._hops(here)

    def _hops(self, here: Segment) -> Iterator[tuple[Segment, int, list[tuple[Segment, Sweep]]]]:
        """Short runs through the mouth of a spur: both segments are occupied for the whole run."""
        for track in self.site.tracks.values():
            if track.kind is not TrackKind.SPUR:
                continue
            inside = Segment(track.number, 1)
            hop_us = run_duration_us(track.pitch_mm, self.site.carrier)
            both = Sweep(0, 0, hop_us)
            for mouth in track.joins:
                if here == mouth:
                    yield inside, hop_us, [(mouth, both), (inside, both)]
                elif here == inside:
                    yield mouth, hop_us, [(inside, both), (mouth, both)]

    def departure_us(self, not_before_us: int, latest_us: int, swept: list[tuple[Segment, Sweep]]) -> int | None:
        """Earliest whole millisecond from which every swept window lies in one safe interval, or None.

        Each correction moves the departure to the start of a later gap, so the loop ends.
        """
        depart_us = not_before_us
        settled = False
        while not settled:
            settled = True
            for segment, sweep in swept:
                gap = _gap_for(self.safe(segment), depart_us + sweep.enter_us, depart_us + sweep.leave_us)
                if gap is None:
                    return None
                if gap.from_us > depart_us + sweep.enter_us:
                    depart_us = ceil_ms(gap.from_us - sweep.enter_us)
                    settled = False
                if depart_us > latest_us:
                    return None
        return depart_us

    def successors(self, node: _Node) -> Iterator[_Node]:
        """Dwell where the next visit is, and every run."""
        phase, here, interval = node.state
        if phase < len(self.visits) and self.visits[phase].segment == here:
            visit = self.visits[phase]
            begin_us = max(node.time_us, ceil_ms(visit.not_before_us))
            end_us = ceil_ms(begin_us + visit.dwell_us)
            if end_us <= interval.to_us:
                ends = (*node.visit_ends_us, end_us)
                yield _Node(_State(phase + 1, here, interval), end_us, node, LegAction.WORK, begin_us, ends)
        for destination, duration_us, swept in self.runs(node):
            for gap in self.safe_standing(destination):
                if gap.to_us <= node.time_us + duration_us:
                    continue
                not_before_us = max(node.time_us, ceil_ms(gap.from_us - duration_us))
                latest_us = min(interval.to_us - 1, gap.to_us - duration_us - 1)
                depart_us = self.departure_us(not_before_us, latest_us, swept)
                if depart_us is None:
                    continue
                arrival_us = depart_us + duration_us
                state = _State(phase, destination, gap)
                yield _Node(state, arrival_us, node, LegAction.TRAVEL, depart_us, node.visit_ends_us)

    # --- the search --------------------------------------------------------------------------------------------

    def priority(self, node: _Node) -> tuple[int, int]:
        """Earliest finish that is still possible, then earliest rest in a refuge: both lower bounds."""
        phase, here, _ = node.state
        if phase < len(self.visits):
            return free_flow_us(self.site, here, node.time_us, self.visits[phase:]), node.time_us
        return node.visit_ends_us[-1] if node.visit_ends_us else self.start_us, node.time_us

    def is_goal(self, node: _Node) -> bool:
        """All visits made, and a refuge that is safe for ever."""
        phase, here, interval = node.state
        return phase == len(self.visits) and here in self.refuges and interval.to_us >= FOREVER


def plan_route(
    site: Site,
    reservations: Reservations,
    owner: int,
    start: Segment,
    start_us: int,
    visits: tuple[Visit, ...],
    refuges: frozenset[Segment],
    max_expansions: int,
) -> Route | NoRoute:
    """The route with the earliest end of the last visit, from standing at ``start`` at bus time ``start_us``.

    Bounded by ``max_expansions``, never by wall time; ties are broken in the order of discovery, which is fixed.
    """
    start_us = ceil_ms(start_us)
    search = _Search(site, reservations, owner, start_us, visits, refuges)
    first = next((gap for gap in search.safe_standing(start) if gap.from_us <= start_us < gap.to_us), None)
    if first is None:
        return NoRoute(f"the start {start} is reserved by another machine", 0)
    root = _Node(_State(0, start, first), start_us, None, LegAction.STAND, start_us, ())
    queue = [(search.priority(root), 0, root)]
    done: set[_State] = set()
    pushed = expansions = 0
    while queue:
        _, _, node = heappop(queue)
        if node.state in done:
            continue
        done.add(node.state)
        if search.is_goal(node):
            finish_us = node.visit_ends_us[-1] if node.visit_ends_us else node.time_us
            return Route(tuple(_legs(node)), node.visit_ends_us, finish_us, expansions)
        if expansions >= max_expansions:
            return NoRoute("the search's bound of expansions is reached", expansions)
        expansions += 1
        for following in search.successors(node):
            if following.state not in done:
                pushed += 1
                heappush(queue, (search.priority(following), pushed, following))
    return NoRoute("no order of waits and runs leads to the goal and a refuge", expansions)


def _legs(node: _Node) -> list[RouteLeg]:
    """The legs from the start to ``node``, waits made explicit."""
    legs: list[RouteLeg] = []
    while node.parent is not None:
        before = node.parent
        here, there = before.state.segment, node.state.segment
        hop = here.track != there.track
        legs.append(
            RouteLeg(
                node.action, there.track, there.index if hop else here.index, there.index, node.begin_us, node.time_us
            )
        )
        if node.begin_us > before.time_us:
            legs.append(RouteLeg(LegAction.STAND, here.track, here.index, here.index, before.time_us, node.begin_us))
        node = before
    return legs[::-1]


def _gap_for(gaps: list[Interval], enter_us: int, leave_us: int) -> Interval | None:
    """The first gap that can hold a window of this length at ``enter_us`` or later."""
    length_us = leave_us - enter_us
    for gap in gaps:
        if gap.to_us >= leave_us and gap.to_us - max(gap.from_us, enter_us) >= length_us:
            return gap
    return None


def _intersect(first: list[Interval], second: list[Interval]) -> list[Interval]:
    """Common parts of two sorted lists of intervals."""
    common = []
    for one in first:
        for two in second:
            start_us, end_us = max(one.from_us, two.from_us), min(one.to_us, two.to_us)
            if start_us < end_us:
                common.append(Interval(start_us, end_us))
    return common
