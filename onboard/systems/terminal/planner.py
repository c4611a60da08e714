"""What a vehicle means to do: tasks won, the plan adopted in its turn, and the plan made anew where it is violated."""

from collections import deque
from dataclasses import dataclass, field, replace

from onboard.contract.codes import Grade, Reason, TaskPhase, TokenKind
from onboard.contract.messages import Award, CallForProposals, Itinerary, Stamp, TaskReport
from onboard.contract.terminal import Assignment, StepReport, StepResult
from onboard.core.authority import segment_token
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.negotiation import Awarded, NegotiationEvent, PreAssigned, Released
from onboard.core.serial import successor, to_bus_ms
from onboard.core.site import Segment
from onboard.systems.terminal.body import VehicleParts
from onboard.systems.terminal.generation import VehicleGeneration, job_of
from onboard.systems.terminal.memory import plan_record, read_plan
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.plan import ActionPlan, EntityStay, Load, PlanReader, to_frames
from onboard.systems.terminal.search import BoxTransport, remaining
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.systems.terminal.traffic import AnewFor, Owned, PlanViolation, is_for_good
from onboard.systems.terminal.unbegun import UnbegunLoads

#: A violated plan that cannot be bettered is looked at again after this, us: others' plans change within seconds.
AGAIN_US = 10_000_000
#: How far the plan has come, and what was won and is not planned yet, is said again so often, us (dbc/terminal.dbc).
SAY_US = 5_000_000
#: Refused for so long without anybody before me, us: the steward sees another order.
TELL_US = 10_000_000
#: Refused for so long behind somebody, us: whoever that is may wait for me by a list that only I have otherwise.
TELL_BEHIND_US = 30_000_000
#: Plans are adopted in turns of bus time, one vehicle so long after the other, us: each sees what the one before has
#: told, so that no two plans are made at once around the same gaps.
TURN_US = 50_000
_NO_STAMP = Stamp(0, 0, 0)


@dataclass
class Planner:
    """One vehicle's plan. ``queue`` are tasks won that are in no plan yet; ``touched`` counts plans made anew."""

    fleet: Fleet
    generation: VehicleGeneration
    body: VehicleParts
    queue: deque[BoxTransport] = field(default_factory=deque)
    touched: int = 0
    version: int = 0
    stamp: Stamp = _NO_STAMP
    _looked_at: int = -1
    _again_at_us: int | None = None
    #: Until when the plan that was made anew last stands, us: how it goes shows only then.
    _stands_until_us: int = 0
    _patience_at_us: int | None = None
    _queue_at_us: int | None = None
    _said_at_us: int | None = None
    _turn_at_us: int | None = None
    #: The step in hand, and since when the right to go on from it is refused.
    _refused: tuple[int, int] | None = None
    unbegun: UnbegunLoads = field(init=False)

    def __post_init__(self) -> None:
        self.unbegun = UnbegunLoads(self.fleet, self.generation)

    @property
    def site(self) -> Terminal:
        """The terminal for which it plans."""
        return self.generation.site

    @property
    def mirror(self) -> TerminalMirror:
        """My picture of the others."""
        return self.generation.mirror

    @property
    def owned(self) -> Owned | None:
        """The plan of this vehicle that is being carried out; None without one."""
        return self.mirror.traffic.plans.get(self.fleet.node_id)

    def start(self, now_us: int) -> None:
        """After a restart the journal knows the plan and how far it has come."""
        plan, over = read_plan(self.fleet.node_id, self.fleet.entries)
        rights = {key.number & 0xFFFF for key in self.fleet.tokens.held if key.kind is TokenKind.CAR}
        self.unbegun.given_back = rights - {load.box for load in (plan.loads if plan is not None else ())}
        if plan is None:
            return
        self.version = plan.version
        self.mirror.take_up(plan, now_us)
        for step, ended_us in over:
            self.mirror.traffic.report(self.fleet.node_id, plan.version, step, ended_us)

    def next_wake(self) -> int | None:
        """My next turn in which there is something to plan, or when a task is to be spoken of again."""
        said_us = self._said_at_us if self.queue or self.owned is not None else None
        return min((time for time in (said_us, self._turn_at_us) if time is not None), default=None)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Awarded: the plan is made a second time, around what is known then (row P20), and told."""
        match event:
            case PreAssigned(call_key=key):
                self.generation.promised.add(key)
            case Released(call_key=key):
                self.generation.promised.discard(key)
            case Awarded(call_key=key, call=call):
                self.generation.promised.discard(key)
                return self._awarded(call, now_us)
        return []

    def called(self, call: CallForProposals) -> None:
        """A box that is in my queue is called for: its desk took the task for lost, and whoever wins it now has it.

        Another desk that calls for the same box knows nothing of that task.
        """
        lost = [job for job in self.queue if (job.box, job.task.origin) == (call.car.number, call.task.origin)]
        self.queue = deque(job for job in self.queue if job not in lost)
        self.generation.has_queue = bool(self.queue)

    def speak(self, now_us: int) -> list[Effect]:
        """Say again how far the plan has come, and of a task that waits to be planned that it is not lost."""
        owned = self.owned
        effects: list[Effect] = []
        if self._said_at_us is None or self._said_at_us > now_us:
            self._said_at_us = self._said_at_us or now_us + SAY_US
            return []
        self._said_at_us = now_us + SAY_US
        if owned is not None and owned.current:
            effects.append(Send(self.report(owned, owned.current - 1, owned.began)))
        node = self.fleet.node_id
        waiting = [(job.task, job.target) for job in self.queue]
        if owned is not None and self.fleet.tokens.refused:
            # To whose box I am refused the right may have been given to another meanwhile.
            refused = [one for one in owned.plan.loads if self.unbegun.right_to(one) in self.fleet.tokens.refused]
            waiting += [(one.task, owned.plan.steps[one.put].entity) for one in refused]
        reports = [TaskReport(node, task, TaskPhase.AWARDED, target, Reason.NONE) for task, target in waiting]
        return effects + [Send(report) for report in reports]

    def over(self, now_us: int) -> list[Effect]:
        """The plan is over; under a version of its own, so that whoever missed the report asks."""
        self.version = successor(self.version, 8)
        nothing = ActionPlan(self.fleet.node_id, self.version, now_us, ())
        return [Record(plan_record(nothing)), *self.statement(now_us)]

    # --- tasks -------------------------------------------------------------------------------------------------

    def _awarded(self, call: CallForProposals, now_us: int) -> list[Effect]:
        self.stamp = Stamp(to_bus_ms(now_us), call.sender, call.call & 0xFF)
        taken = Send(TaskReport(self.fleet.node_id, call.task, TaskPhase.AWARDED, call.to_station, Reason.NONE))
        self._take(job_of(self.mirror, call))
        return [taken]

    def assigned(self, order: Assignment, now_us: int) -> list[Effect]:
        """A central planner's order is as good as an award."""
        taken = Send(TaskReport(self.fleet.node_id, order.task, TaskPhase.AWARDED, order.target, Reason.NONE))
        owned = self.owned
        known = [load.task for load in owned.plan.loads] if owned is not None else []
        if order.task in known or any(job.task == order.task for job in self.queue):
            return [taken]
        before = self.mirror.traffic.before.get(order.task, 0)
        job = BoxTransport(order.box, order.task, self.mirror.station_of(order.box), order.target, before)
        if job.source:
            self._take(job)
        return [taken] if job.source else []

    def _take(self, job: BoxTransport) -> None:
        """It is planned in my next turn."""
        self.queue.append(job)
        self.generation.has_queue = True

    def _plan_next(self, now_us: int) -> list[Effect]:
        """Put the oldest task won behind what is planned.

        One whose box is in a plan is forfeited, as two desks wanted it, and one under a box that nobody is to fetch.
        """
        if not self.queue or (self._queue_at_us is not None and now_us < self._queue_at_us):
            return []
        job = self.queue[0]
        if self.mirror.in_plans(job.box) is not None or not self.mirror.is_free(job.box):
            self._drop_first()
            return [Send(TaskReport(self.fleet.node_id, job.task, TaskPhase.FORFEITED, job.source, Reason.NONE))]
        if self.mirror.traffic.dates(now_us).circle:
            # While plans wait for each other there are no dates to put anything behind: one is made anew first.
            return []
        found = self.generation.plan(job, now_us, version=successor(self.version, 8))
        if found is None or is_for_good(found.plan.end, now_us):
            self._queue_at_us = now_us + AGAIN_US
            return []
        self._drop_first()
        return self._adopt(found.plan, now_us)

    def in_turn(self, now_us: int) -> list[Effect]:
        """What is only done in my turn; I wake for the turn in which something is due."""
        turn_us = self._turn_us(now_us)
        effects: list[Effect] = []
        self.unbegun.note(now_us)
        if turn_us == now_us:
            effects = self._plan_next(now_us) + self._mend(now_us)
            effects = effects or self._give_back(self.unbegun.gone(), now_us) or self._tell_anew(now_us)
            effects = effects or self._give_back(self.unbegun.due(now_us), now_us)
            if not effects and self.unbegun.is_to_look and (self.owned is None or self._is_settled(self.owned)):
                effects = self._give_back(self.unbegun.buried(), now_us)
            turn_us = self._turn_us(now_us + TURN_US)
        due_us = self._planning_due(now_us)
        self._turn_at_us = max(turn_us, self._turn_us(due_us)) if due_us is not None else None
        return effects

    def _tell_anew(self, now_us: int) -> list[Effect]:
        """A steward that refuses me while I see nobody before me has another order: my plan is told anew, as it is.

        So it is after long where I do see somebody: lists may differ without any plan being missed, and then two may
        each wait for the other with nobody else's picture showing why (campaign terminal, all, seed 15).
        """
        owned, not_yet = self.owned, Reason.TOKEN_NOT_GRANTABLE_YET
        keys = [key for key, why in self.fleet.tokens.refused.items() if why is not_yet]
        # A box's right has no list: who has won it is all that its keeper goes by.
        refused = [key.number >> 8 for key in keys if key.kind is TokenKind.SEGMENT]
        if owned is None or not refused or self.mirror.traffic.waits_for_good(self.fleet.node_id, now_us):
            self._refused = None
            return []
        if self._refused is None or self._refused[0] != owned.current:
            self._refused = (owned.current, now_us)
        patience_us = TELL_US if any(self._is_first(entity) for entity in refused) else TELL_BEHIND_US
        if now_us - self._refused[1] < patience_us:
            return []
        self._refused = None
        left = remaining(self.mirror.traffic, self.fleet.node_id, now_us)
        if left is None:
            return []
        first = left.steps[0]._replace(after=self._ahead() or left.steps[0].after)
        steps = first, *left.steps[1:]
        return self._adopt(replace(left, version=successor(self.version, 8), steps=steps), now_us)

    def _ahead(self) -> EntityStay | None:
        """Whose stay is before mine on the lane that I am in, by who has the slot before me; None for nobody's.

        That is so on the ground, whatever lists say of it (terminal, operators, clocks and bus, 214).
        """
        move, traffic = self.body.move, self.mirror.traffic
        if move is None or self.site.entities[move.entity].kind is not EntityKind.LANE:
            return None
        holder = self.fleet.tokens.holder_of(segment_token(Segment(move.entity, move.slot + 1)))
        row = [one for one in traffic.lists.get(move.entity, []) if one.owner == holder != self.fleet.node_id]
        return next((one.key for one in row if traffic.is_inside(one)), None)

    def lost(self, award: Award, now_us: int) -> list[Effect]:
        """A task of my plan is another's, or nobody's: its desk took it back while I was silent."""
        return self._give_back(self.unbegun.after(award), now_us)

    def _give_back(self, loads: list[Load], now_us: int) -> list[Effect]:
        """Others may do these; the plan goes on without them, once the body is where it can."""
        if not loads or self.owned is None or not self._is_settled(self.owned):
            return []
        self.unbegun.begin_anew()
        plan = self.generation.without({one.box for one in loads}, now_us, version=successor(self.version, 8))
        return [] if plan is None else [*self._adopt(plan, now_us), *self.unbegun.give(loads)]

    def _is_settled(self, owned: Owned) -> bool:
        """Whether nothing is ordered, and the body is where the step in hand is.

        Just come into the next entity it reports that step first: a plan made anew then would begin behind it, and lead
        from where it is no more.
        """
        move = self.body.move
        is_there = move is not None and move.entity == owned.plan.steps[owned.current].entity
        return is_there and not (self.body.is_moving or self.body.is_handling)

    def _is_first(self, entity: int) -> bool:
        """Whether nobody is before me in an entity's list but those inside, and there is room beside them."""
        traffic = self.mirror.traffic
        row = traffic.lists.get(entity, [])
        inside = [one for one in row if traffic.is_inside(one)]
        capacity = self.site.entities[entity].capacity
        following = next((one for one in row if not traffic.is_inside(one)), None)
        return following is not None and following.owner == self.fleet.node_id and len(inside) < capacity

    def _planning_due(self, now_us: int) -> int | None:
        """When there is something to plan, or to look at."""
        times = [self._again_at_us, self._patience_at_us, self.unbegun.due_us]
        if self.owned is not None and self.fleet.tokens.refused:
            times.append(now_us + TELL_US)
        if self.queue:
            times.append(self._queue_at_us or now_us)
        if self.owned is not None and self.mirror.traffic.changes != self._looked_at:
            times.append(now_us)
        return min((time for time in times if time is not None), default=None)

    def _drop_first(self) -> None:
        self.queue.popleft()
        self._queue_at_us = None
        self.generation.has_queue = bool(self.queue)

    def _turn_us(self, now_us: int) -> int:
        """When my turn to adopt plans is, or begins next; ``now_us`` itself while it is."""
        count, rank = len(self.site.vehicles), self.site.vehicles.index(self.fleet.node_id)
        behind = (now_us // TURN_US - rank) % count
        return now_us if not behind else (now_us // TURN_US + count - behind) * TURN_US

    # --- plans -------------------------------------------------------------------------------------------------

    def _adopt(self, plan: ActionPlan, now_us: int) -> list[Effect]:
        """Journal the plan, put it between the others' and tell it."""
        plan = self._as_told(plan, now_us)
        self.version = plan.version
        self.mirror.take_up(plan, now_us)
        return [Record(plan_record(plan)), *self.statement(now_us)]

    def _as_told(self, plan: ActionPlan, now_us: int) -> ActionPlan:
        """The plan as all others read it: in whole ms, with the durations that they know."""
        reader, read = PlanReader(self.site), None
        for frame in to_frames(plan):
            read = reader.feed(frame, now_us)  # type: ignore[arg-type]  # a plan's own frames
        assert read is not None
        loads = tuple(replace_before(load, old) for load, old in zip(read.loads, plan.loads, strict=True))
        return replace(read, loads=loads)

    def statement(self, now_us: int) -> list[Effect]:
        """Itinerary head, plan, and how far it has come."""
        owned = self.owned
        if self.version == 0:
            return []
        node = self.fleet.node_id
        plan = owned.plan if owned is not None else ActionPlan(node, self.version, now_us, ())
        grade = Grade.FIRM if owned is not None else Grade.RELEASED
        itinerary = Itinerary(node, self.version, grade, self.stamp, ())
        self.fleet.mirror.on_itinerary(itinerary, now_us)
        effects: list[Effect] = [Send(itinerary), *(Send(frame) for frame in to_frames(plan))]
        if owned is not None and owned.current:
            effects.append(Send(self.report(owned, owned.current - 1, owned.began)))
        return effects

    def report(self, owned: Owned, step: int, at_us: int, result: StepResult = StepResult.DONE) -> StepReport:
        """What became of a step."""
        entity = owned.plan.steps[step].entity
        return StepReport(self.fleet.node_id, owned.plan.version, step, result, entity, to_bus_ms(at_us))

    def _mend(self, now_us: int) -> list[Effect]:
        """Make my plan anew if it is violated, and mine only (M31); a blocked lane is waited for first (M33)."""
        owned, traffic = self.owned, self.mirror.traffic
        if owned is None or not self._is_settled(owned):
            return []
        if now_us < self._stands_until_us:
            self._again_at_us, self._looked_at = self._stands_until_us, traffic.changes
            return []
        self._patience_at_us = self._patience_end(now_us)
        due = self._again_at_us is not None and self._again_at_us <= now_us
        if traffic.changes == self._looked_at and not due:
            return []
        self._looked_at = traffic.changes
        self._again_at_us = None
        found = next((one for one in traffic.violations(now_us) if one.owner == self.fleet.node_id), None)
        blocked = self.mirror.long_blocked(now_us) & {step.entity for step in owned.plan.steps[owned.current + 1 :]}
        if blocked:
            text = f"{self.site.entities[min(blocked)].name} is blocked"
            found = PlanViolation(self.fleet.node_id, AnewFor.BLOCKED, text)
        elif found is None and traffic.out and traffic.waits_for_good(self.fleet.node_id, now_us):
            found = PlanViolation(self.fleet.node_id, AnewFor.OUT, "who comes before does not go on")
        return self._anew(owned, found, now_us) if found is not None else []

    def _anew(self, owned: Owned, found: PlanViolation, now_us: int) -> list[Effect]:
        self._again_at_us = now_us + AGAIN_US
        plan = self.generation.again(now_us, version=successor(self.version, 8))
        if plan is None or is_for_good(plan.end, now_us):
            return []
        is_better = plan.end < self.mirror.traffic.end_of(self.fleet.node_id, now_us)
        entities = [[one.entity for one in steps] for steps in (plan.steps, owned.plan.steps[owned.current :])]
        # A circle ends with any other plan, and a blocked lane with another way only.
        is_enough = is_better or found.why in (AnewFor.CIRCLE, AnewFor.BLOCKED)
        if not is_enough or (found.why is AnewFor.BLOCKED and entities[0] == entities[1]):
            return []
        self.touched += 1
        self._stands_until_us = now_us + AGAIN_US
        return [Report(f"plan made anew: {found.text}"), *self._adopt(plan, now_us)]

    def _patience_end(self, now_us: int) -> int | None:
        """When the next blocked lane, or vehicle that does not go on, has been waited for long enough."""
        traffic = self.mirror.traffic
        ends = [since + self.site.patience_us for since in (*traffic.blocked.values(), *traffic.out.values())]
        coming = min((end for end in ends if end > now_us), default=None)
        if self._patience_at_us is not None and self._patience_at_us <= now_us:
            self._looked_at = -1
        return coming if self.owned is not None else None


def replace_before(load: Load, old: Load) -> Load:
    """A load as it was told, with the date that its owner knows."""
    return load._replace(before=old.before)
