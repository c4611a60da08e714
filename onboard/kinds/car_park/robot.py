"""The mobile robot (MR): carrier and shuttle carry out the order program of every task that it won."""

from dataclasses import dataclass, field

from onboard.core.authority import TokenKey
from onboard.core.behaviour import Fleet
from onboard.core.codes import (
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Reason,
    TaskPhase,
)
from onboard.core.effects import Effect, Halt, Record, Report, Send
from onboard.core.messages import (
    CallForProposals,
    DriveState,
    Message,
    Reference,
    ShuttleState,
    Stamp,
    TaskReport,
)
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.serial import to_bus_ms
from onboard.core.site import Machine, Segment, Site
from onboard.kinds.car_park.generation import CarParkGeneration, Solution
from onboard.kinds.car_park.handling import Phase, ShuttleWork
from onboard.kinds.car_park.program import MAX_STEPS, Handling, Program, Step, Work
from onboard.kinds.car_park.travel import Carriage

#: A step that ends this much off its planned time makes the rest of the plan move and be told again. Ours.
REPLAN_TOLERANCE_US = 500_000


class RobotFactory:
    """Makes mobile robots."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> CarParkGeneration:
        """The robot's task-generation function."""
        return CarParkGeneration(site, machine, mirror, Program(site))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "Robot":
        """The robot's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, CarParkGeneration):
            raise TypeError("a robot needs the car park's task-generation function")
        return Robot(fleet, estimator)


@dataclass
class Robot:
    """One mobile robot: waits for awards, drives, handles cars, and stands in a refuge in between."""

    fleet: Fleet
    generation: CarParkGeneration
    kind: KindCode = KindCode.ROBOT
    carriage: Carriage = field(init=False)
    shuttle: ShuttleWork = field(init=False)
    _begun: bool = False
    _fault: Reason = Reason.NONE

    def __post_init__(self) -> None:
        self.carriage = Carriage(self.fleet, self.fleet.machine.home.track)
        self.shuttle = ShuttleWork(self.fleet)

    @property
    def program(self) -> Program:
        """The order program in hand."""
        return self.generation.program

    @property
    def state(self) -> MachineState:
        """Heartbeat state."""
        if self._fault is not Reason.NONE:
            return MachineState.STOPPED
        if self.program.standing is None:
            return MachineState.STARTING
        if self.program.step is None:
            return MachineState.IDLE
        return MachineState.WAITING if self.carriage.blocked is not None else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """Version of the firm itinerary."""
        return self.program.version

    def start(self, now_us: int) -> list[Effect]:
        """Nothing moves before the position is sensed."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Drive and shuttle states."""
        if isinstance(message, DriveState):
            effects = self.carriage.sense(message, now_us, self.program.version, self.program.current)
            if self.program.standing is None and self.carriage.standing_at is not None:
                effects += self._admit(self.carriage.standing_at, now_us)
            return effects
        if isinstance(message, ShuttleState):
            self.shuttle.sense(message)
            if self.shuttle.fault and self._fault is Reason.NONE:
                return self._fail(Reason.ACTUATOR_FAULT)
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Nothing beyond what tokens, mirror and negotiation take from the bus."""
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Pre-assignment keeps a tentative solution, being outbid drops it, an award makes it firm (row P47)."""
        match event:
            case PreAssigned(call_key=key, proposal=proposal):
                (solution,) = proposal.program
                self.generation.tentative[key] = solution
                return []
            case Released(call_key=key):
                self.generation.tentative.pop(key, None)
                return []
            case Awarded(call_key=key, call=call, proposal=proposal):
                self.generation.tentative.pop(key, None)
                (solution,) = proposal.program
                return self._take_on(call, solution, now_us)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A robot passes segments and stations back to their stewards by itself; until then it refuses."""
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        """Carry on with the step in hand."""
        if self.program.standing is None or self._fault is not Reason.NONE:
            return []
        effects: list[Effect] = []
        # A step can end without a word on any bus, and the next is to begin in the same moment.
        for _ in range(MAX_STEPS):
            step = self.program.step
            if step is None:
                return effects + self.carriage.advance(now_us)
            if not self._begun:
                self._begun = True
                effects += self._begin(step, now_us)
            effects += self._carry_on(step, now_us)
            if not self._is_done(step, now_us):
                break
            effects += self._end(step, now_us)
        return effects

    def next_wake(self) -> int | None:
        """The drive's next order, or the end of a planned wait."""
        times = [self.carriage.next_wake()]
        step = self.program.step
        if step is not None and step.action is LegAction.STAND and self._begun:
            times.append(step.end_us)
        due = [time for time in times if time is not None]
        return min(due) if due else None

    def statements(self, now_us: int) -> list[Effect]:
        """My firm itinerary, and the car in my custody."""
        effects: list[Effect] = []
        if self.program.version:
            effects.append(Send(self.program.itinerary(self.fleet.node_id, now_us)))
        return effects + self.fleet.tokens.statements()

    # --- steps -------------------------------------------------------------------------------------------------

    def _admit(self, here: Segment, now_us: int) -> list[Effect]:
        """First position after power-up: stand here and tell everybody."""
        self.program.standing = here
        self.program.replace([], Stamp(to_bus_ms(now_us), self.fleet.node_id, 0))
        self.carriage.go(here)
        return self._publish(now_us)

    def _take_on(self, call: CallForProposals, promised: Solution, now_us: int) -> list[Effect]:
        """Second request of the task-generation function: the operating sequence that is really carried out."""
        solution, _ = self.generation.solve(call, now_us)
        if solution is None:
            solution = promised
        kept = self.program.remaining[: solution.kept]
        if not kept:
            self._begun = False
        self.program.replace([*kept, *solution.steps], Stamp(call.deadline_ms, call.sender, call.call & 0xFF))
        effects: list[Effect] = [
            Record({"record": "award", "initiator": call.sender, "call": call.call, "task": call.task.number}),
            Report("program: " + "; ".join(str(step) for step in solution.steps)),
        ]
        effects += self._publish(now_us)
        effects.append(self._report(call.task, TaskPhase.AWARDED, solution.place.number))
        return effects

    def _begin(self, step: Step, now_us: int) -> list[Effect]:
        if step.action is LegAction.TRAVEL:
            self.carriage.go(step.destination)
        elif step.work is not None:
            return self.shuttle.begin(step.work) + self._announce_start(step.work)
        return []

    def _announce_start(self, work: Work) -> list[Effect]:
        if work.handling is Handling.LEAVE:
            return []
        return [self._report(work.call.task, TaskPhase.STARTED, work.station.number)]

    def _carry_on(self, step: Step, now_us: int) -> list[Effect]:
        if step.work is not None:
            return self.carriage.advance(now_us) + self.shuttle.advance(now_us)
        if self.shuttle.is_out:
            return [Halt("the carrier should move while its shuttle is out")]
        return self.carriage.advance(now_us)

    def _is_done(self, step: Step, now_us: int) -> bool:
        if step.action is LegAction.TRAVEL:
            return self.carriage.standing_at == step.destination
        if step.work is not None:
            return self.shuttle.phase is Phase.DONE
        return now_us >= step.end_us

    def _end(self, step: Step, now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        if step.work is not None:
            taken = step.work.handling is Handling.TAKE
            phase = TaskPhase.LOADED if taken else TaskPhase.DONE
            effects.append(self._report(step.work.call.task, phase, step.work.station.number))
        self._begun = False
        self.program.current += 1
        late_us = now_us - step.end_us
        if self.program.step is not None and abs(late_us) > REPLAN_TOLERANCE_US:
            self.program.shift(late_us)
            effects += self._publish(now_us)
        return effects

    def _publish(self, now_us: int) -> list[Effect]:
        itinerary = self.program.itinerary(self.fleet.node_id, now_us)
        assert itinerary.grade is Grade.FIRM
        self.fleet.mirror.on_itinerary(itinerary, now_us)
        return [Send(itinerary)]

    def _report(self, task: Reference, phase: TaskPhase, station: int) -> Effect:
        return Send(TaskReport(self.fleet.node_id, task, phase, station, Reason.NONE))

    def _fail(self, reason: Reason) -> list[Effect]:
        """An actuator failed: stand still as an obstacle and say so; what follows is a person's decision."""
        self._fault = reason
        self.carriage.stopped = True
        effects: list[Effect] = [Report(f"stopped: {reason.name}")]
        work = self.shuttle.work
        if work is not None:
            effects.append(Send(TaskReport(self.fleet.node_id, work.call.task, TaskPhase.FORFEITED, 0, reason)))
        return effects
