"""The mobile robot's task-generation function: what would this task cost *me*, around everybody's plans?

It is asked twice (row P20): for an estimate when a call is heard, and for the operating sequence once awarded. Its cost
is the finishing time (row P41): when the car stands where it shall stand and the shuttle is home. It depends on the
others' present and foreseen tasks (rows P21, P28), unlike that of a lathe. Where the destination is open, the robot
chooses the place itself and evaluates all its solutions (row P46).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from onboard.contract.codes import Criterion, Grade, LegAction, Operation
from onboard.contract.messages import CallForProposals, Itinerary, Stamp
from onboard.core.negotiation import CallKey, NeededAnswers, Proposal
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.ahead import Ahead, Checked, key_of
from onboard.systems.car_park.alternatives import Alternative, Solution, can_be_told
from onboard.systems.car_park.charging import Charging
from onboard.systems.car_park.clearance import MAX_EXPANSIONS, Clearance, Seen
from onboard.systems.car_park.free_places import FreePlaces
from onboard.systems.car_park.place_costs import PlaceCosts
from onboard.systems.car_park.program import (
    MAX_STEPS,
    STAMP_AHEAD_US,
    CarHandling,
    CarStep,
    Program,
    StationWork,
    steps_of,
    to_itinerary,
    waiting_at,
)
from onboard.systems.car_park.site import CarPark, class_of_end, end_at, one_a_segment, open_class
from onboard.ways.effort import Effort, Search
from onboard.ways.kinematics import run_duration_us
from onboard.ways.mirror import WayMirror
from onboard.ways.reservations import FOREVER, Reservations
from onboard.ways.sipp import NoRoute, Route, Visit, free_flow_ends, free_flow_us, planning
from onboard.ways.told_way import TOLERANCE_US, BegunItinerary

#: From the deadline to the first motion: award frame, journal writes and the first tokens (measured in tests).
AWARD_LATENCY_US = 150_000
#: Tokens, orders and sensor frames around one handling of a car, beside the motions themselves (measured).
HANDLING_OVERHEAD_US = 400_000
#: A customer has left the compartment this long after the call: walking out takes 4 to 8 s; so that the real
#: days of the tests finish no later than bid.
CUSTOMER_US = 9_500_000
#: From so many places on, the way to taking the car is searched once for all of them: for fewer, a search for each
#: costs less.
FEW_PLACES = 3
#: Whoever only stands in the way is out of it so long after the award: planning, tokens, and a way to another refuge.
YIELDING_US = 45_000_000
#: A way back that begins within so long after the award goes on: its machine may not have heard of it by then.
HEARD_US = 2_000_000
#: Others' ways back are asked to yield for no less than so much: each that yields tells its plan anew.
WORTH_US = 2_000_000
#: What a request for an estimate comes to.
Estimate = Proposal | NeededAnswers | None


@dataclass
class CarParkGeneration:
    """Estimates and operating sequences for one robot. Implements the negotiation's ``Estimator``."""

    site: CarPark
    machine: Machine
    mirror: WayMirror
    program: Program
    tentative: dict[CallKey, Solution] = field(default_factory=dict)
    #: A person has a hand in (row M38): no new tasks.
    is_held: bool = False
    #: What all its searches cost, and whether they are sliced.
    effort: Effort = field(default_factory=Effort)
    clearance: Clearance = field(init=False)
    charging: Charging = field(init=False)
    free: FreePlaces = field(init=False)
    costs: PlaceCosts = field(init=False)
    #: What is worked out for bids that stand best, where searches are sliced.
    ahead: Ahead = field(init=False)

    def __post_init__(self) -> None:
        self.ahead = Ahead(self.effort)
        self.free = FreePlaces(self.site, self.machine.node_id, self.mirror, self.program, self.tentative)
        self.costs = PlaceCosts(self.site)
        self.charging = Charging(self.site, self.mirror, self.machine.node_id)
        self.clearance = Clearance(self.site, self.mirror, self.machine.node_id, self.effort)

    # --- the Estimator -----------------------------------------------------------------------------------------

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Least finishing time (bus ms) that any robot could name, from call and site alone: it stands at the start."""
        least = self.least(call, now_us, None, now_us)
        return to_bus_ms(FOREVER) if least is None else least

    def least(self, call: CallForProposals, now_us: int, origin: Segment | None, from_us: int) -> int | None:
        """The same of one that is at ``origin``, else at the start, from ``from_us`` on; None where there is no way."""
        start_us = max(self._deadline_us(call, now_us) + AWARD_LATENCY_US, from_us)
        bounds = self._lower_bounds(call, self._all_candidates(call), origin, start_us)
        self.effort.steps += len(bounds)
        least_us = min(bounds.values(), default=FOREVER)
        return to_bus_ms(least_us) if least_us < FOREVER else None

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """Least finishing time (bus ms) for me if nobody were in my way; None where I cannot do it at all."""
        if call.criterion is not Criterion.FINISH_TIME or call.operation not in (Operation.PARK, Operation.RETRIEVE):
            return None
        if not self._is_able(now_us) or self._is_behind_itself(call):
            return None
        limits = self.site.cars
        # On the bus a wheelbase is rounded down to 10 mm; the desk has measured it to the millimetre.
        is_measured = call.wheelbase_mm or not call.ready_ms
        if is_measured and not limits.min_wheelbase_mm - 9 <= call.wheelbase_mm <= limits.max_wheelbase_mm:
            return None
        _, segment, start_us = self._start(call, now_us)
        bounds = self._lower_bounds(call, self._candidates(call, now_us), segment, start_us)
        self.effort.steps += len(bounds)
        least_us = min(bounds.values(), default=FOREVER)
        return to_bus_ms(least_us) if least_us < FOREVER else None

    def _is_able(self, now_us: int) -> bool:
        """Whether this robot can take on any task."""
        program = self.program
        is_planned = program.standing is not None and not program.unplanned
        is_free = not self.is_held and len(program.remaining) + 4 <= MAX_STEPS
        return is_planned and is_free and not self._is_trapped() and self.charging.bids(now_us)

    def _is_trapped(self) -> bool:
        """Whether it rides with a lift that does not go on: what it won it would give back, again and again."""
        obstacles = self.mirror.obstacles.machines
        now = self.program.remaining[:1] if obstacles else ()
        return any(one.action is LegAction.RIDE and self.site.stewards[one.track] in obstacles for one in now)

    def _is_behind_itself(self, call: CallForProposals) -> bool:
        """Whether it has to leave a car before in the very bay out of which it would take that of the call."""
        leaves = [work for work in self.program.works() if work.handling is CarHandling.LEAVE]
        return call.operation is Operation.PARK and any(one.station.number == call.from_station for one in leaves)

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        """First request: the best solution as a bid, or None: silence (row P45).

        Where searches are sliced it goes on when it is asked for the answers of nobody.
        """
        if self.effort.slice_steps is None:
            return self.effort.whole(self._estimate(call, now_us, self.mirror.reservations))
        bound = self.lower_bound(call, now_us)
        return None if bound is None else self._go_on(bound, self._estimate_aside(call, now_us), now_us)

    def _go_on(self, bound: int, search: Search[Estimate], now_us: int) -> Estimate:
        over = self.effort.slice(search, now_us)
        if over is None:
            return NeededAnswers(bound, (), lambda _, then_us: self._go_on(bound, search, then_us))
        # Whether it is in time is judged when the time that the slice took is over.
        return NeededAnswers(bound, (), lambda _, then_us: over[0])

    def _estimate(self, call: CallForProposals, now_us: int, reservations: Reservations) -> Search[Estimate]:
        solution, alternatives = yield from self._solve(call, now_us, reservations)
        return None if solution is None else self.answer(call, solution, alternatives, now_us)

    def _estimate_aside(self, call: CallForProposals, now_us: int) -> Search[Estimate]:
        """The same around what all plan now, whatever they plan meanwhile; the bid asks whether it stands."""
        plans, reservations = dict(self.mirror.plans), self.mirror.reservations.copy()
        found = yield from self._estimate(call, now_us, reservations)
        if not isinstance(found, Proposal):
            return found
        (solution,) = found.program
        return found._replace(stands=self._standing(call, solution, (plans, reservations), now_us))

    def reserve(self, call: CallForProposals, proposal: Proposal, now_us: int) -> None:
        """My bid stands best: other bids come behind it, and what takes long to work out for it is begun."""
        (solution,) = proposal.program
        self.tentative[key_of(call)] = solution
        if proposal.stands is not None:
            search = self._renew_aside(call, now_us)
            self.ahead.begin(key_of(call), Checked(solution, proposal.stands), search, now_us)

    def _renew_aside(self, call: CallForProposals, now_us: int) -> Search[Checked | None]:
        seen = dict(self.mirror.plans), self.mirror.reservations.copy()
        solution, _ = yield from self._solve(call, now_us, seen[1], behind_bids=False)
        if solution is None:
            return None
        return Checked(solution, self._standing(call, solution, seen, now_us, behind_bids=False))

    def _standing(
        self, call: CallForProposals, solution: Solution, seen: Seen, now_us: int, *, behind_bids: bool = True
    ) -> Callable[[int], bool]:
        """Whether a solution still holds at a time: this machine, its place and its way are as free as was ``seen``."""
        plan = BegunItinerary(self._offer(call, solution._replace(kept=0)), solution.start_us)
        is_free = self.clearance.still_free(plan, seen, now_us)

        def stands(then_us: int) -> bool:
            if not self._is_able(then_us) or solution.place not in self._candidates(call, then_us):
                return False
            _, origin, start_us = self._free_from(then_us, behind_bids=behind_bids)
            return origin == solution.origin and start_us <= solution.start_us and is_free()

        return stands

    def answer(
        self, call: CallForProposals, solution: Solution, alternatives: list[Alternative], now_us: int
    ) -> Proposal | NeededAnswers:
        """What a solution comes to: a bid."""
        return self.proposal(call, solution, alternatives)

    def renewed(self, call: CallForProposals, promised: Solution, now_us: int) -> Solution | None:
        """Second request, once the call is awarded: what is really carried out, around what is known by now.

        None where there is nothing, and what was promised does not follow on what is in hand by now.
        """
        ahead = self.ahead.end(key_of(call), now_us)
        found = None if ahead is None else self.following(ahead, now_us)
        if found is not None:
            return found
        solution, _ = self.solve(call, now_us, behind_bids=False)
        return solution or self.following(promised, now_us)

    def following(self, promised: Solution, now_us: int) -> Solution | None:
        """What was promised, behind the work in hand; None where it begins elsewhere, or all is too long to be told."""
        kept, origin, _ = self.program.branch(now_us)
        follows = origin == promised.origin and kept + len(promised.steps) <= MAX_STEPS
        return promised._replace(kept=kept) if follows else None

    def proposal(self, call: CallForProposals, solution: Solution, alternatives: list[Alternative]) -> Proposal:
        """A solution as a bid; its itinerary is told with the award, and with the bid only where the site says so."""
        itinerary = self._offer(call, solution) if self.site.tells_offers else None
        return Proposal(to_bus_ms(solution.finish_us), itinerary, (solution,), tuple(alternatives))

    def _offer(self, call: CallForProposals, solution: Solution) -> Itinerary:
        # Legs name only the version: a tentative set must never complete a firm one.
        version = (self.program.version + 128) & 0xFF or 1
        steps = [*self.program.remaining[: solution.kept], *solution.steps]
        return to_itinerary(self.machine.node_id, version, Grade.TENTATIVE, _stamp(call), steps)

    # --- the search --------------------------------------------------------------------------------------------

    def solve(
        self, call: CallForProposals, now_us: int, *, behind_bids: bool = True
    ) -> tuple[Solution | None, list[Alternative]]:
        """All solutions evaluated, the earliest finish first; ties by the site's order of places.

        A bid comes behind what this machine has bid for already (``behind_bids``); a task that is won does not. Others'
        ways back are asked to yield to a task that is won, and to one for which there is no way else: where they were
        for every bid, machines from far away won in place of those that were about to be near.

        Candidates whose bound is no better than the best found are not searched; they are told with that bound. Where
        there is no solution around machines that only stand there, one that counts on their giving way (design,
        section 5: idle machines yield); they hear of it with the firm itinerary.
        """
        return self.effort.whole(self._solve(call, now_us, self.mirror.reservations, behind_bids=behind_bids))

    def _solve(
        self, call: CallForProposals, now_us: int, reservations: Reservations, *, behind_bids: bool = True
    ) -> Search[tuple[Solution | None, list[Alternative]]]:
        reservations = reservations.apart(self.machine.node_id, TOLERANCE_US)
        start = self._start(call, now_us, behind_bids=behind_bids)
        best, alternatives = yield from self._search(call, now_us, start, reservations)
        if alternatives and (best is None or not behind_bids):
            past = yield from self._past_retreats(call, now_us, start, best)
            best, alternatives = past or (best, alternatives)
        if best is None and alternatives:
            asked_us = max(self._deadline_us(call, now_us), now_us) + YIELDING_US
            best, more = yield from self._search(call, now_us, start, reservations.with_way_given(asked_us))
            alternatives += more
            if best is not None and not self.clearance.give_way(best.steps, best.start_us, now_us):
                best = None
        if best is not None and behind_bids and not self._can_bid(best, now_us):
            best = None
        return best, alternatives

    def _can_bid(self, solution: Solution, now_us: int) -> bool:
        """Whether one itinerary can tell it with what may be won before it, and the battery lasts for it."""
        is_short = can_be_told(solution, self.tentative.values())
        return is_short and self.charging.lasts(self.program, solution, now_us)

    def _past_retreats(
        self, call: CallForProposals, now_us: int, start: tuple[int, Segment, int], best: Solution | None
    ) -> Search[tuple[Solution, list[Alternative]] | None]:
        """A sooner solution than ``best`` that counts on others' ways back to yield; None where there is none.

        Those who yield stand where their work ends, which the solution does not touch, and find a way back around it
        and all plans: so nobody waits for whom it delays. Together they are not delayed by more than twice what it
        is sooner: a customer waits for it, and the next one for them.
        """
        stamp = _stamp(call)
        horizon_us = max(self._deadline_us(call, now_us), now_us) + AWARD_LATENCY_US + HEARD_US
        held = self.clearance.held_back(stamp, horizon_us, now_us)
        while held:
            taken, plans = self.clearance.without_retreats(held, now_us), [self.mirror.plans[node] for node in held]
            found, tried = yield from self._search(call, now_us, start, taken)
            if any(self.mirror.plans.get(node) is not plan for node, plan in zip(held, plans, strict=True)):
                # Others have planned anew while this was searched.
                return None
            if found is None or (best is not None and best.finish_us - found.finish_us < WORTH_US):
                return None
            steps = [*self.program.remaining[: found.kept], *found.steps]
            plan = BegunItinerary(to_itinerary(self.machine.node_id, 1, Grade.FIRM, stamp, steps), steps[0].begin_us)
            yielding, refusing = self.clearance.met(plan, held, now_us)
            if not refusing:
                waits = {node: (held[node].place, held[node].since_us) for node in yielding}
                taken = self.clearance.without_retreats({node: held[node] for node in yielding}, now_us)
                later_us = self.clearance.have_room(plan, waits, taken, now_us)
                if later_us is None or (best is not None and 2 * (best.finish_us - found.finish_us) < later_us):
                    return None
                return found, tried
            held = {node: held[node] for node in yielding}
        return None

    def _search(
        self, call: CallForProposals, now_us: int, start: tuple[int, Segment, int], reservations: Reservations
    ) -> Search[tuple[Solution | None, list[Alternative]]]:
        kept, segment, start_us = start
        bounds, costs = yield from self._bounds(call, now_us, start, reservations)
        best, best_us, alternatives = None, 0, list[Alternative]()
        # Places on both sides of a segment are reached and served alike.
        routes: dict[Segment, Route | None] = {}
        for bound_us, _, place in bounds:
            later_us = costs.get(place.number, 0)
            if best is not None and bound_us >= best_us:
                alternatives.append(Alternative(place, None, bound_us - later_us))
                continue
            if place.segment not in routes:
                route = yield from self._route(call, place, segment, start_us, now_us, reservations)
                routes[place.segment] = route if route is not None and kept + len(route.legs) < MAX_STEPS else None
            route = routes[place.segment]
            if route is None:
                alternatives.append(Alternative(place, None))
                continue
            alternatives.append(Alternative(place, route.finish_us))
            if best is None or route.finish_us + later_us < best_us:
                steps, best_us = self._steps(call, place, route), route.finish_us + later_us
                best = Solution(kept, segment, start_us, steps, route.finish_us, place)
        return best, alternatives

    def _bounds(
        self, call: CallForProposals, now_us: int, start: tuple[int, Segment, int], reservations: Reservations
    ) -> Search[tuple[list[tuple[int, int, Station]], Mapping[int, int]]]:
        """Places that may be chosen, the most promising first, and what they cost beside the finish, by their numbers.

        Each with a time before which it cannot be finished, and that cost on it.

        Where there is a choice of places to leave the car at, the search up to taking it is common to all: it is made
        once, and only the way from there is counted as free. No route to a place takes the car sooner, as it is a
        route to taking it and to a refuge as well.
        """
        _, segment, start_us = start
        places = self._candidates(call, now_us)
        taken_us = None
        if len(places) >= FEW_PLACES and class_of_end(call.from_station) is None:
            take, _ = self._visits(call, places[0], start_us)
            route = yield from self._plan(reservations, segment, start_us, (take,), now_us)
            if route is None:
                return [(FOREVER, 0, places[0])], {}
            taken_us = route.finish_us
        bounds = self._lower_bounds(call, places, segment, start_us, taken_us)
        yield len(bounds)
        costs = self.costs.of(call, places, now_us)
        found = ((bounds[one.segment] + costs.get(one.number, 0), n, one) for n, one in enumerate(places))
        return sorted(found), costs

    def _start(self, call: CallForProposals, now_us: int, *, behind_bids: bool = True) -> tuple[int, Segment, int]:
        kept, segment, start_us = self._free_from(now_us, behind_bids=behind_bids)
        earliest_us = max(self._deadline_us(call, now_us), now_us) + AWARD_LATENCY_US
        return kept, segment, max(start_us, earliest_us)

    def _free_from(self, now_us: int, *, behind_bids: bool) -> tuple[int, Segment, int]:
        kept, segment, start_us = self.program.branch(now_us)
        for solution in self.tentative.values() if behind_bids else ():
            # What I may win before counts as won: one robot does one thing after the other.
            if solution.finish_us > start_us:
                segment, start_us = solution.place.segment, solution.finish_us
        return kept, segment, start_us

    def _route(
        self,
        call: CallForProposals,
        place: Station,
        origin: Segment,
        start_us: int,
        now_us: int,
        reservations: Reservations,
    ) -> Search[Route | None]:
        return self._plan(reservations, origin, start_us, self._visits(call, place, start_us), now_us)

    def _plan(
        self, reservations: Reservations, origin: Segment, start_us: int, visits: tuple[Visit, ...], now_us: int
    ) -> Search[Route | None]:
        node, floors = self.machine.node_id, self.mirror.lift_floors(now_us, start_us, reservations)
        for ends in self.clearance.ends():
            route = yield from planning(
                self.site, reservations, node, origin, start_us, visits, ends, MAX_EXPANSIONS, floors
            )
            if not isinstance(route, NoRoute):
                return route
        return None

    def reroute(
        self, origin: Segment, start_us: int, works: list[StationWork], now_us: int, *, asks: bool = False
    ) -> tuple[CarStep, ...] | None:
        """The same work by another way, from standing at ``origin`` at bus time ``start_us``; None where there is none.

        Without work the way to another refuge: so a machine that only stands gives way. Who ``asks`` counts on that.
        """
        visits = tuple(self._work_visit(work, now_us) for work in works)
        others = self.mirror.reservations_at(origin, start_us, may_stay=not works and start_us <= now_us)
        others = others.with_way_given(now_us + YIELDING_US) if asks else others
        route = self.effort.whole(self._plan(others, origin, start_us, visits, now_us))
        if route is None or len(route.legs) + 3 > MAX_STEPS:  # a few are kept
            return None
        steps = steps_of(route, works)
        return None if asks and not self.clearance.give_way(steps, start_us, now_us) else steps

    def _work_visit(self, work: StationWork, now_us: int) -> Visit:
        if work.handling is CarHandling.TAKE and work.station in self.site.compartments.values():
            return self._visits(work.call, work.station, now_us)[0]
        return Visit(work.station.segment, self.handling_us(work.station))

    def _lower_bounds(
        self,
        call: CallForProposals,
        places: list[Station],
        origin: Segment | None,
        start_us: int,
        taken_us: int | None = None,
    ) -> dict[Segment, int]:
        """For each segment of ``places`` when the task would end there with nobody in the way; FOREVER: out of reach.

        Without ``origin`` from where the car is taken; ``taken_us`` is when it is taken, by default as early as can be.
        """
        is_open = class_of_end(call.from_station) is not None
        bounds: dict[Segment, int] = {}
        # A car from a known place is taken at the same time, and left in as long a time, wherever it goes.
        for place in one_a_segment(places if is_open else places[:1]):
            take, leave = self._visits(call, place, start_us)
            here = take.segment if origin is None else origin
            least_us = free_flow_us(self.site, here, start_us, (take,)) if taken_us is None else taken_us
            goals = (leave.segment,) if is_open else {one.segment for one in places}
            ends = free_flow_ends(self.site, take.segment, least_us, leave, goals)
            bounds |= {place.segment: ends[leave.segment]} if is_open else ends
        return bounds

    def _visits(self, call: CallForProposals, place: Station, near_us: int) -> tuple[Visit, Visit]:
        source, sink = self.ends(call, place)
        is_in, called_us = source in self.site.compartments.values(), self._deadline_us(call, near_us)
        ready_us = called_us + call.ready_ms * 1000 if call.ready_ms else 0
        if is_in and not ready_us:
            # The customer walks out, then the input door locks; only then may the output door open.
            ready_us = called_us - self.site.timing.call_window_us + CUSTOMER_US + self.site.timing.door_us
        take = Visit(source.segment, self.handling_us(source), ready_us if is_in else 0)
        return take, Visit(sink.segment, self.handling_us(sink), 0 if is_in else ready_us)

    def handling_us(self, station: Station) -> int:
        """Reach, grip or release, retract; at a compartment its output door opens first."""
        park = self.site
        stroke_us = run_duration_us(park.shuttle_reach_mm, park.shuttle)
        door_us = self.site.timing.door_us if station in self.site.compartments.values() else 0
        return door_us + 2 * stroke_us + self.site.timing.grip_us + HANDLING_OVERHEAD_US

    def ends(self, call: CallForProposals, place: Station) -> tuple[Station, Station]:
        """Where the car is taken and where it is left; ``place`` stands for the end that the call leaves open."""
        return end_at(call.from_station, place), end_at(call.to_station, place)

    def _all_candidates(self, call: CallForProposals) -> list[Station]:
        car_class = open_class(call)
        if car_class is None:
            return [Station.from_number(call.to_station)]
        return [place for place in self.site.places if self.site.takes(place, car_class)]

    def _candidates(self, call: CallForProposals, now_us: int) -> list[Station]:
        """Stations that the bidder may choose: free places nobody is on the way to, or the one that the call names."""
        car_class = open_class(call)
        if car_class is None:
            return self._all_candidates(call)
        return self.costs.nearer(call, self.free.of(now_us, car_class, key_of(call)))

    def _steps(self, call: CallForProposals, place: Station, route: Route) -> tuple[CarStep, ...]:
        source, sink = self.ends(call, place)
        works = [
            StationWork(CarHandling.TAKE, source, call.car, call.wheelbase_mm, call),
            StationWork(CarHandling.LEAVE, sink, call.car, call.wheelbase_mm, call),
        ]
        steps = steps_of(route, works)
        return waiting_at(self.site.compartments.values(), steps) if call.ready_ms else steps

    def _deadline_us(self, call: CallForProposals, now_us: int) -> int:
        """When a call closes, or closed; now where that is read in a time that was not its caller's: work in hand."""
        deadline_us = from_bus_ms(call.deadline_ms, now_us)
        return deadline_us if deadline_us <= now_us + STAMP_AHEAD_US else now_us


def _stamp(call: CallForProposals) -> Stamp:
    """What gives a plan for a call its place among the others'."""
    return Stamp(call.deadline_ms, call.sender, call.call & 0xFF)
