"""The vehicle's task-generation function: what a transport would cost me around all plans (rows M23 to M27)."""

from dataclasses import dataclass, field, replace

from onboard.contract.codes import Operation
from onboard.contract.messages import CallForProposals, Reference
from onboard.contract.terminal import Action
from onboard.core.negotiation import CallKey, Proposal
from onboard.core.serial import to_bus_ms
from onboard.core.site import Machine
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.plan import ActionPlan, ActionStep, Load
from onboard.systems.terminal.routes import carry_us, free_flow_us, least_end_ms
from onboard.systems.terminal.search import BoxTransport, FoundPlan, PlanSearch, remaining
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.systems.terminal.traffic import Traffic, copy_of, is_for_good

#: So many stations are tried, the nearest first, as a way out of a lane. Ours: the first is mostly good enough.
MOST_WAYS_OUT = 3


@dataclass
class VehicleGeneration:
    """An ``Estimator``. ``has_queue`` is true while a task was won that is in no plan yet: nothing more is bid for.

    ``promised`` are the calls in which this machine's bid stands best.
    """

    site: Terminal
    machine: Machine
    mirror: TerminalMirror
    has_queue: bool = False
    promised: set[CallKey] = field(default_factory=set)
    #: Whether a person has a hand in the vehicle: it bids for nothing then (row M38).
    is_held: bool = False
    searches: int = 0

    # --- the Estimator -----------------------------------------------------------------------------------------

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Picked up when it is called for, as plans begin before a call is decided, and carried straight."""
        return least_end_ms(self.site, call, now_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """Alone on all ways; None for a machine whose plan ends after T + delta T (M24), and for what nobody can do."""
        if call.operation is not Operation.TRANSPORT or not self.is_candidate(now_us):
            return None
        if self.mirror.in_plans(call.car.number) is not None:
            # Two desks called for one box at once, and one has it.
            return None
        stations = (call.from_station, call.to_station)
        known = [self.site.entities.get(number) for number in stations]
        if any(one is None or one.kind is not EntityKind.STATION for one in known):
            return None
        here, free_us = self.start(now_us)
        way_us, loaded_us = free_flow_us(self.site, here, call.from_station), carry_us(self.site, call)
        return None if way_us is None or loaded_us is None else to_bus_ms(free_us + way_us + loaded_us)

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The end of the best plan; none while a bid for another call stands best: what that brings goes first."""
        if self.promised - {CallKey(call.sender, call.call)}:
            return None
        found = self.plan(job_of(self.mirror, call), now_us, version=1)
        if found is None or is_for_good(found.plan.end, now_us):
            return None
        return Proposal(to_bus_ms(found.plan.end), None, (found.plan.end, found.plan.steps), ())

    # --- plans -------------------------------------------------------------------------------------------------

    def is_candidate(self, now_us: int) -> bool:
        """Whether it has no plan, or one that ends before T + delta T."""
        end_us = self.mirror.traffic.end_of(self.machine.node_id, now_us)
        return not self.has_queue and not self.is_held and end_us <= now_us + self.site.horizon_us

    def start(self, now_us: int) -> tuple[int, int]:
        """Where and when the machine is free: an area, bus us."""
        node = self.machine.node_id
        return self.mirror.where[node], self.mirror.traffic.end_of(node, now_us)

    def plan(self, job: BoxTransport, now_us: int, *, version: int) -> FoundPlan | None:
        """What is left of the plan in hand, and then ``job``."""
        kept = remaining(self.mirror.traffic, self.machine.node_id, now_us)
        here, free_us = self.start(now_us)
        return self.search(now_us).best(here, free_us, job, version=version, kept=kept)

    def search(self, now_us: int, traffic: Traffic | None = None) -> PlanSearch:
        """A search over the mirror as it is, or over another picture; lanes that are blocked for long are left out."""
        self.searches += 1
        found = self.mirror.traffic if traffic is None else traffic
        return PlanSearch(self.site, found, self.machine.node_id, now_us, self.mirror.long_blocked(now_us))

    def again(self, now_us: int, *, version: int) -> ActionPlan | None:
        """The loads of the plan in hand planned anew from the step in hand, around everybody's plans; None if no way.

        What is done at a station is ended there first; who stands at a stack too early leaves it, and comes back.
        """
        node, traffic = self.machine.node_id, self.mirror.traffic
        left = remaining(traffic, node, now_us)
        if left is None or not left.loads:
            return None if left is None else self._way_out(left, now_us, version)
        at_station = self.site.entities[left.steps[0].entity].kind is EntityKind.STATION
        kept, loads = self._at_station(left, now_us) if at_station else (None, left.loads)
        here = left.steps[0].entity if not at_station else self.site.entities[left.steps[0].entity].area
        # What is picked up before it undocks, the last of the steps that come first.
        count = len(kept.steps) - 1 if kept is not None else 0
        began = kept.end if kept is not None else left.begin
        # Where others will be without what is planned now.
        alone = copy_of(traffic)
        begun = kept if kept is not None else replace(left, steps=left.steps[:1], loads=())
        alone.take_up(replace(begun, version=left.version), now_us)
        search = self.search(now_us, alone)
        for load in loads:
            source = left.steps[load.pick].entity if load.pick < len(left.steps) else 0
            if load.pick < count:
                source = 0
            job = BoxTransport(load.box, load.task, source, left.steps[load.put].entity, traffic.date_of(load))
            found = search.best(here, began, job, version=version, kept=kept)
            if found is None:
                return None
            kept = found.plan
            if load.pick < count:
                # It is picked up in the steps that are ended first.
                kept = replace(kept, loads=(*kept.loads[:-1], kept.loads[-1]._replace(pick=load.pick)))
            began = kept.end
            here = self.site.entities[found.plan.steps[-1].entity].area
        return kept

    def _way_out(self, left: ActionPlan, now_us: int, version: int) -> ActionPlan | None:
        """Who has given all back gets out of its lane: to a station that can be reached, and out of it again.

        Plans end in an area, which is come to from a station.
        """
        here, site = left.steps[0].entity, self.site
        if site.entities[here].kind in (EntityKind.AREA, EntityKind.STATION):
            return None
        alone = copy_of(self.mirror.traffic)
        alone.take_up(replace(left, steps=left.steps[:1]), now_us)
        search, found = self.search(now_us, alone), list[FoundPlan]()
        ways = {one: free_flow_us(site, here, one) for one, place in site.entities.items() if place.area}
        for station in sorted((one for one, way in ways.items() if way is not None), key=lambda one: ways[one] or 0):
            one = search.best(here, left.begin, BoxTransport(0, Reference(0, 0), 0, station), version=version)
            found += [one] if one is not None else []
            if len(found) == MOST_WAYS_OUT:
                break
        best = min(found, key=lambda one: one.plan.end, default=None)
        if best is None:
            return None
        steps = tuple(step for step in best.plan.steps if step.action is not Action.PUT_DOWN)
        return replace(best.plan, steps=steps, loads=())

    def without(self, boxes: set[int], now_us: int, *, version: int) -> ActionPlan | None:
        """What is left of the plan in hand without these boxes, which are picked up last of all; None without a plan.

        It ends where the last other box is put down. Where there is none it goes on to the next station of the plan,
        and comes out of it again, since plans end in an area; one that is in an area stays there.
        """
        left = remaining(self.mirror.traffic, self.machine.node_id, now_us)
        if left is None:
            return None
        kept = tuple(load for load in left.loads if load.box not in boxes)
        steps = left.steps
        if kept:
            steps = steps[: max(load.put for load in kept) + 2]
        elif self.site.entities[steps[0].entity].kind is EntityKind.AREA:
            steps = ()
        else:
            pick = min(load.pick for load in left.loads)
            out = next(number for number, step in enumerate(steps) if step.action is Action.UNDOCK)
            steps = (*steps[: min(pick, out)], steps[out])
        return replace(left, version=version, steps=steps, loads=kept)

    def _at_station(self, left: ActionPlan, now_us: int) -> tuple[ActionPlan, tuple[Load, ...]]:
        """The steps at the station in hand as a plan that comes first, and the loads that are not put down by then."""
        if self.mirror.traffic.stands_too_early(left.owner):
            here, undock_us = left.steps[0], self.site.undock_us
            out = ActionStep(Action.UNDOCK, here.entity, undock_us, max(now_us, left.begin) + undock_us, here.after)
            return ActionPlan(left.owner, left.version, left.begin, (out,)), left.loads
        count = left.visits()[0][1] + 1
        loads = tuple(load for load in left.loads if load.put >= count)
        done = tuple(load for load in left.loads if load.put < count)
        return ActionPlan(left.owner, left.version, left.begin, left.steps[:count], done), loads


def job_of(mirror: TerminalMirror, call: CallForProposals) -> BoxTransport:
    """What a call asks for."""
    before = mirror.traffic.before.get(call.task, 0)
    return BoxTransport(call.car.number, call.task, call.from_station, call.to_station, before)
