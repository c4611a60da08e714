"""The mobile robot (MR): carrier and shuttle carry out the order program of every task that it won."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

from onboard.contract.codes import CallResult, Grade, KindCode, LegAction, MachineState, Reason, TaskPhase
from onboard.contract.messages import (
    Award,
    BatteryState,
    CallForProposals,
    DriveState,
    Itinerary,
    ManualOrder,
    Message,
    Reference,
    ShuttleState,
    Stamp,
    TaskReport,
)
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet, OverheardWord
from onboard.core.effects import Effect, Halt, Report, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, AwardedAgain, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.site import Machine, Site
from onboard.systems.car_park import custody
from onboard.systems.car_park.alternatives import Solution, weighed
from onboard.systems.car_park.asking import AskingGeneration
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.giving_way import GivingWay, YieldDecision
from onboard.systems.car_park.going_around import GoingAround
from onboard.systems.car_park.handling import ShuttleWork, handle
from onboard.systems.car_park.holding import RobotHold
from onboard.systems.car_park.program import MAX_STEPS, CarHandling, CarStep, HandlingPhase, Program, StationWork
from onboard.systems.car_park.recovery import JournalRecovery, award_record, floor_record, handled_record, ride_record
from onboard.systems.car_park.resting import Resting
from onboard.systems.car_park.riding import Riding
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.systems.car_park.starting import RobotDevices, Starting, StartStage
from onboard.systems.car_park.travel import Carriage
from onboard.systems.car_park.way import way_to_refuge
from onboard.ways.lifts import sill
from onboard.ways.mirror import WayFleet, way_fleet, way_mirror
from onboard.ways.site import TrackKind

#: A step that ends this much off its planned time makes the rest of the plan move and be told again: below it windows
#: still hold.
REPLAN_TOLERANCE_US = 500_000
#: A step that is not over, or a run that does not go on, so long after it should is told to be late, by as much again:
#: others plan on with what they know until then.
OVERDUE_US = 2_000_000


@dataclass(frozen=True)
class ParkingRobotFactory(BehaviourFactory):
    """Makes the mobile robots of a car park, with a program each."""

    fleet_type = WayFleet

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> CarParkGeneration:
        """What its bids come from; it asks lifts first where the site says rides "before"."""
        park = car_park(site)
        generation = AskingGeneration if park.rides is RideCalls.BEFORE else CarParkGeneration
        return generation(park, machine, way_mirror(mirror), Program(park))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "ParkingRobot":
        """The robot's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, CarParkGeneration):
            raise TypeError("a robot needs the car park's task-generation function")
        return ParkingRobot(way_fleet(fleet), estimator)


@dataclass
class ParkingRobot:
    """One mobile robot: waits for awards, drives, handles cars, and stands in a refuge in between."""

    fleet: WayFleet
    generation: CarParkGeneration
    kind: KindCode = KindCode.ROBOT
    carriage: Carriage = field(init=False)
    shuttle: ShuttleWork = field(init=False)
    riding: Riding = field(init=False)
    giving_way: GivingWay = field(init=False)
    recovery: JournalRecovery = field(init=False)
    going_around: GoingAround = field(init=False)
    holding: RobotHold = field(init=False)
    starting: Starting = field(init=False)
    resting: Resting = field(init=False)
    _begun: bool = False
    _fault: Reason = Reason.NONE

    def __post_init__(self) -> None:
        self.carriage = Carriage(self.fleet, self.fleet.machine.home.track)
        self.shuttle = ShuttleWork(self.fleet)
        self.carriage.is_clear, self.shuttle.at_mark = lambda: self.shuttle.is_home, lambda: self.carriage.arrived
        self.carriage.in_hand = lambda: (self.program.version, self.program.leg)
        self.carriage.route_ahead = lambda: way_to_refuge(self.fleet.site, self.program.remaining[1:])
        self.riding = Riding(self.fleet)
        self.recovery = JournalRecovery.read(self.fleet.node_id, self.fleet.entries)
        custody.replay(self.fleet, self.recovery.cars.values())
        self.fleet.tokens.before_grant = partial(custody.before_grant, self.fleet)
        self.going_around = GoingAround(self.fleet, self.generation, self.carriage, self.shuttle, self._take_up)
        self.giving_way = GivingWay(self.fleet, self.program, self.going_around.standoff)
        self.resting = Resting(self.fleet, self.generation.site, self.generation, self.going_around)
        self.holding = RobotHold(self.fleet, self.generation, self.carriage, self.shuttle)
        machine = RobotDevices(self.carriage, self.shuttle, self.riding)
        self.starting = Starting(
            self.fleet, self.generation, machine, self.recovery, self._say_what_is_mine, self._started
        )
        self.carriage.track = self.recovery.floor or self.carriage.track

    @property
    def program(self) -> Program:
        """The order program in hand."""
        return self.generation.program

    @property
    def why_stopped(self) -> Reason:
        """ACTUATOR_FAULT where drive or shuttle fail; SENSOR_FAULT: they sense what journal and program deny."""
        is_astray = self.starting.is_over and self.shuttle.is_astray
        if self._fault is Reason.NONE and (self.starting.stage is StartStage.HELD or is_astray):
            return Reason.SENSOR_FAULT
        return Reason.ACTUATOR_FAULT if self.going_around.is_stuck else self._fault

    @property
    def state(self) -> MachineState:
        """For heartbeats: STOPPED by a fault, OBSTACLE in a person's hand, STARTING until placed."""
        if self.why_stopped is not Reason.NONE:
            return MachineState.STOPPED
        if self.holding.is_at_rest:
            return MachineState.OBSTACLE
        if not self.starting.is_over:
            return MachineState.STARTING
        if self.program.step is None:
            return MachineState.WAITING if self.program.unplanned else MachineState.IDLE
        return MachineState.WAITING if self.carriage.blocked is not None else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """Version of the firm itinerary."""
        return self.program.version

    def start(self, now_us: int) -> list[Effect]:
        """Nothing moves before the position is sensed."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """States of drive, shuttle and battery; a shuttle that fails, or an empty battery, stops the robot for good."""
        if isinstance(message, DriveState):
            return self.carriage.sense(message, now_us)
        effects = self.shuttle.sense(message, now_us) if isinstance(message, ShuttleState) else []
        effects += self.resting.sense(message, now_us) if isinstance(message, BatteryState) else []
        if (self.shuttle.fault or self.generation.charging.is_empty) and self._fault is Reason.NONE:
            effects += self._fail(Reason.ACTUATOR_FAULT, now_us)
        return effects

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Another machine's plan may mean that mine has to come later, or to take another way."""
        self.going_around.hear(message)
        self.resting.hear(message, now_us)
        if isinstance(message, Award):
            again = [self._tell_again(message.task)] if self.recovery.is_asked(self.fleet, message) else []
            return again + self._yield_task(message, now_us)
        if isinstance(message, ManualOrder) and message.machine == self.fleet.node_id:
            return self.holding.ordered(message)
        lost = self.holding.loses(message)
        if lost is not None and lost in self._untouched():
            return self._lose(lost, now_us)
        if not isinstance(message, Itinerary) or message.grade is not Grade.FIRM or not self.starting.is_over:
            return []
        # Nobody counts on the plan of a robot that is held: it is made anew once it is let go.
        if self.holding.is_at_rest or self.fleet.mirror.itineraries.get(message.sender) is not message:
            return []
        answer = self.giving_way.heed(message.sender, now_us)
        if answer is YieldDecision.ANEW:
            return self._reroute(message.sender, now_us)
        return self._publish(now_us) if answer is YieldDecision.LATER else []

    def _yield_task(self, award: Award, now_us: int) -> list[Effect]:
        """A task of mine is not mine by a newer version, or its call is void: I was lost for its initiator.

        A newer version is called for only once its initiator has taken the task from whom it had before, whatever
        comes of that call. A custodian's FORFEITED names no version: its initiator answers it, not I.
        """
        for call in [work.call for work in self._works()]:
            if (call.task, call.sender) != (award.task, award.sender):
                continue
            is_void = award.result is CallResult.WITHDRAWN or (
                award.result is CallResult.REJECTED and award.call == call.call
            )
            others = award.winner != self.fleet.node_id and self.recovery.is_newer(award)
            if (others or is_void) and call.task in self._untouched(is_lost=True):
                return self._lose(call.task, now_us)
        return []

    def _untouched(self, *, is_lost: bool = False) -> list[Reference]:
        """Tasks in hand that can be given back, or be another's."""
        return self.going_around.untouched(is_lost=is_lost) if self.starting.is_over else self.recovery.untouched()

    def _lose(self, task: Reference, now_us: int) -> list[Effect]:
        self.recovery.forget(task)
        gone = self.going_around.lose(task)
        return gone + (self.going_around.drop([task], now_us) if self.starting.is_over else [])

    def _take_up(self, kept: int, steps: Sequence[CarStep], works: list[StationWork], now_us: int) -> list[Effect]:
        """A program made anew for the same or fewer tasks, under the same stamp."""
        rest = [*self.program.remaining[:kept], *steps]
        if not kept:
            self._begun = False
        if not rest and self.carriage.standing_at is not None:
            self.program.standing = self.carriage.nearest
            self.carriage.go(self.carriage.nearest)
        planned = [step.work for step in rest]
        self.program.replace(rest, self.program.stamp, [work for work in works if work not in planned])
        effects: list[Effect] = [Report("goes around: " + "; ".join(str(step) for step in steps))]
        return effects + self._publish(now_us)

    def _reroute(self, sender: int, now_us: int) -> list[Effect]:
        """Do the same work by another way; where there is none, come behind on the old one."""
        kept, origin, start_us = self.going_around.turning((), now_us)
        works = [step.work for step in self.program.remaining[kept:] if step.work is not None]
        unplanned = self.program.unplanned
        steps = self.generation.reroute(origin, start_us, [*works, *unplanned], now_us)
        if steps is not None:
            works, unplanned = [*works, *unplanned], []
        elif unplanned:
            # What finds no way now must not stand in the way of others either.
            steps = self.generation.reroute(origin, start_us, works, now_us)
        if steps is None or steps == tuple(self.program.remaining[kept:]):
            return self._publish(now_us) if self.giving_way.fall_back(sender, now_us) is YieldDecision.LATER else []
        self._begun = self._begun and bool(kept)
        stamp = self.giving_way.stamp_for(sender, now_us)
        self.program.replace([*self.program.remaining[:kept], *steps], stamp, unplanned)
        effects: list[Effect] = [Report(f"gives way to node {sender}: " + "; ".join(str(step) for step in steps))]
        return effects + self._publish(now_us)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Pre-assignment keeps a tentative solution, being outbid drops it, an award makes it firm (row P47)."""
        match event:
            case PreAssigned(call=call, proposal=proposal):
                self.generation.reserve(call, proposal, now_us)
                return [Report(weighed(proposal.alternatives))]
            case Released(call_key=key):
                self.generation.tentative.pop(key, None)
                self.generation.ahead.end(key, now_us)
                return []
            case Awarded(call_key=key, call=call, proposal=proposal, award=award):
                self.generation.tentative.pop(key, None)
                (solution,) = proposal.program
                again = call.task in self.going_around.untouched()
                is_begun = not again and call.task in [work.call.task for work in self._works()]
                if is_begun or self.recovery.has_done(call):
                    # Its initiator has not heard how far it has come, and has called for it anew.
                    return [self._tell_again(call.task)]
                version = 1 if award is None else award.task_version
                self.recovery.versions[call.task] = version
                why = self._why_not()
                if why is not Reason.NONE:
                    return self.going_around.forfeit(call.task, why, now_us)
                dropped = self.going_around.drop([call.task], now_us) if again else []
                return dropped + self._take_on(call, solution, version, now_us)
            case AwardedAgain(call=call):
                return [self._tell_again(call.task)]
        return []

    def _why_not(self) -> Reason:
        """Why a task that was won cannot be taken on; NONE where it can."""
        if self._fault is not Reason.NONE:
            return self._fault
        if self.holding.is_held:
            return Reason.OPERATOR
        # A bid of before: of a life before, or of when there was still a way for all that is in hand.
        return Reason.IMPOSSIBLE if self.program.unplanned or not self.starting.is_over else Reason.NONE

    def _works(self) -> list[StationWork]:
        """What is in hand, or what a restart has left to do."""
        return self.program.works() if self.starting.is_over else self.recovery.works

    def _tell_again(self, task: Reference) -> Effect:
        """What became of a task whose award is said again."""
        handlings = [work.handling for work in self._works() if work.call.task == task]
        done = [one.station for one in self.recovery.done if one.task == task]
        if handlings or done:
            phase = TaskPhase.AWARDED if CarHandling.TAKE in handlings else TaskPhase.LOADED
            return self._report(task, *((phase, 0) if handlings else (TaskPhase.DONE, done[-1])))
        why = Reason.JOURNAL_LOST if self.recovery.is_restart else Reason.CANCELLED
        return Send(TaskReport(self.fleet.node_id, task, TaskPhase.FORFEITED, 0, why))

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """All goes back to the stewards by itself, and is refused until then; but for slots that are not in use."""
        return self.carriage.may_grant(key, requester, now_us)

    def advance(self, now_us: int) -> list[Effect]:
        """Carry on with the step in hand."""
        if self._fault is not Reason.NONE:
            return self.going_around.say_again(now_us)
        if self.holding.stops(self._begun):
            return self.going_around.say_again(now_us) + self.holding.come_to_rest(now_us)
        if not self.starting.is_over:
            return self.starting.advance(now_us)
        self.generation.ahead.go_on(now_us)
        effects = self.going_around.watch_drive(now_us) + self.going_around.advance(now_us)
        # A step can end without a word on any bus, and the next is to begin in the same moment.
        for _ in range(MAX_STEPS):
            if self.holding.stops(self._begun):
                return effects + self.holding.come_to_rest(now_us)
            step = self.program.step
            if step is None:
                if not (self.resting.is_on and self.resting.sets_off(now_us)):
                    return effects + self.carriage.advance(now_us)
                effects += self._publish(now_us)
                continue
            if not self._begun:
                self._begun = True
                effects += self._begin(step, now_us)
            effects += self._carry_on(step, now_us)
            if not self._is_done(step, now_us):
                effects += self._tell_delay(step, now_us)
                break
            effects += self._end(step, now_us)
        return effects

    def next_wake(self) -> int | None:
        """The drive's next order, the end of a planned wait, or of a pause after a restart.

        Who has failed only says again what it gives back.
        """
        if self._fault is not Reason.NONE:
            return self.going_around.next_word()
        if self.holding.stops(self._begun):
            return min((one for one in (self.carriage.next_wake(), self.going_around.next_word()) if one), default=None)
        if not self.starting.is_over:
            return min((one for one in (self.carriage.next_wake(), self.starting.next_wake()) if one), default=None)
        parts = (self.carriage, self.going_around, self.generation.ahead, self.resting)
        times = [part.next_wake() for part in parts]
        step = self.program.step
        if step is not None and self._begun:
            times.append(step.end_us if step.action is LegAction.STAND else self._latest_us(step) + OVERDUE_US)
        return min([time for time in times if time is not None], default=None)

    def looks_from(self) -> int:
        """It looks often while it waits for a slot or rides, and for a drive that got stuck, or goes again."""
        return self.going_around.looks_from()

    def heeds(self, message: OverheardWord) -> bool:
        """Where lifts are, and who has a station or a car; of slots it knows what it has, and waits for."""
        return self.riding.sill.heeds(message)

    def statements(self, now_us: int) -> list[Effect]:
        """My firm itinerary as I told it under its version, where I am in it, and the tokens that I hold."""
        effects: list[Effect] = []
        itinerary = self.fleet.mirror.itineraries.get(self.fleet.node_id)
        if itinerary is not None:
            effects += [Send(itinerary), *self.carriage.statement(now_us)]
        # An initiator that was restarted learns that its task is in hand.
        effects += self._taken_on(self.program.works()) + custody.statements(self.fleet)
        effects += self.holding.manual.statement()
        return effects + self.fleet.tokens.statements()

    def _taken_on(self, works: list[StationWork]) -> list[Effect]:
        to_take = [work for work in works if work.handling is CarHandling.TAKE]
        return [self._report(work.call.task, TaskPhase.AWARDED, work.station.number) for work in to_take]

    # --- steps -------------------------------------------------------------------------------------------------

    def _say_what_is_mine(self) -> list[Effect]:
        """At a restart: tasks in hand, of which each initiator knows whether another has got it meanwhile."""
        mine = self._taken_on(self.recovery.works)
        if self.recovery.is_news and self.recovery.done:
            # The power may have failed before this was said, or heard; who is pushed as it starts has said it.
            self.recovery.is_news = False
            mine.insert(0, self._tell_again(self.recovery.done[-1].task))
        return mine

    def _started(self, planned: tuple[CarStep, ...] | None, now_us: int) -> list[Effect]:
        """The start is over, and the program taken up: tell the plan."""
        # What a restart has left in hand is the first step, and was begun before.
        self._begun = len(planned or ()) < len(self.program.steps)
        effects: list[Effect] = []
        if self.recovery.is_restart:
            effects.append(Report("goes on after a restart: " + "; ".join(str(step) for step in self.program.steps)))
        if planned is None:
            # Somebody is in the way, of work or to a refuge: it is tried again, and what was not touched is given back.
            self.going_around.turn_later(now_us)
        return effects + self._publish(now_us)

    def _take_on(self, call: CallForProposals, promised: Solution, version: int, now_us: int) -> list[Effect]:
        """Second request of the task-generation function: the operating sequence that is really carried out.

        Its firm itinerary is all that a lift needs to know of a ride: nobody calls for what that holds already.
        """
        solution = self.generation.renewed(call, promised, now_us)
        if solution is None:
            # It came behind what was won or lasts longer since: no plan holds both.
            return self.going_around.forfeit(call.task, Reason.IMPOSSIBLE, now_us)
        kept = self.program.remaining[: solution.kept]
        self._begun = self._begun and bool(kept)
        self.program.replace([*kept, *solution.steps], Stamp(call.deadline_ms, call.sender, call.call & 0xFF))
        self.going_around.won()
        return [
            award_record(call, *self.generation.ends(call, solution.place), version),
            Report("program: " + "; ".join(str(step) for step in solution.steps)),
            *self._publish(now_us),
            self._report(call.task, TaskPhase.AWARDED, solution.place.number),
        ]

    def _begin(self, step: CarStep, now_us: int) -> list[Effect]:
        if step.action is LegAction.TRAVEL:
            self.carriage.go(step.destination)
            if self.fleet.site.tracks[step.track].kind is TrackKind.SPUR:
                # Before the turn: the drive tells only that it is across, not in which spur.
                return [floor_record(step.track)]
        elif step.action is LegAction.RIDE:
            return [ride_record(step), *self.carriage.statement(now_us), *self.riding.begin(step.track, step.to_index)]
        else:
            # A way that was given up while its rights were awaited is not gone when they come.
            self.carriage.go(step.destination, waits=step.work is None and step.end_us > now_us)
        return [] if step.work is None else self.shuttle.begin(step.work) + self._announce_start(step.work)

    def _announce_start(self, work: StationWork) -> list[Effect]:
        is_left = work.handling is CarHandling.LEAVE
        return [] if is_left else [self._report(work.call.task, TaskPhase.STARTED, work.station.number)]

    def _carry_on(self, step: CarStep, now_us: int) -> list[Effect]:
        if step.action is LegAction.RIDE:
            return self.riding.advance(now_us)
        if step.work is not None:
            return handle(self.carriage, self.shuttle, now_us)
        if self.shuttle.is_out:
            return [Halt("the carrier should move while its shuttle is out")]
        return self.carriage.advance(now_us)

    def _is_done(self, step: CarStep, now_us: int) -> bool:
        if step.action is LegAction.TRAVEL:
            return self.carriage.standing_at == step.destination
        if step.action is LegAction.RIDE:
            return self.riding.done
        if step.work is not None:
            return self.shuttle.phase is HandlingPhase.DONE
        return now_us >= step.end_us

    def _latest_us(self, step: CarStep) -> int:
        """When a step has to be over, or its run has to go on from where the carrier stands, to end as planned; us."""
        return step.end_us - (self.carriage.run_us(step.destination) if step.action is LegAction.TRAVEL else 0)

    def _tell_delay(self, step: CarStep, now_us: int) -> list[Effect]:
        """A step that takes longer than planned moves the rest of the plan while it still lasts, so others can plan."""
        late_us = now_us - self._latest_us(step)
        if late_us < OVERDUE_US:
            return []
        self.program.lengthen(late_us + OVERDUE_US)
        # Whoever waits for rights in vain may have lost the task: its initiator answers then.
        return self._publish(now_us) + ([] if step.work is None else self._announce_start(step.work))

    def _end(self, step: CarStep, now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        if step.work is not None:
            taken = step.work.handling is CarHandling.TAKE
            phase = TaskPhase.LOADED if taken else TaskPhase.DONE
            effects.append(handled_record(step.work))
            if not taken:
                self.recovery.left(step.work)
            effects.append(self._report(step.work.call.task, phase, step.work.station.number))
        if step.action is LegAction.RIDE:
            floor = sill(self.fleet.site, step.track, step.to_index).track
            effects.append(floor_record(floor))
            self.carriage.ride_to(floor)
        self._begun = False
        self.program.over()
        following = self.program.step
        late_us = now_us - (step.end_us if following is None else following.begin_us)
        if following is not None and abs(late_us) > REPLAN_TOLERANCE_US:
            self.program.shift(late_us)
            effects += self._publish(now_us)
        return effects

    def _publish(self, now_us: int) -> list[Effect]:
        itinerary = self.program.itinerary(self.fleet.node_id, now_us)
        self.fleet.mirror.on_itinerary(itinerary, now_us)
        return [Send(itinerary)]

    def _report(self, task: Reference, phase: TaskPhase, station: int) -> Effect:
        return Send(TaskReport(self.fleet.node_id, task, phase, station, Reason.NONE))

    def _fail(self, reason: Reason, now_us: int) -> list[Effect]:
        """An actuator failed: stand still as an obstacle, give back what was not touched, and say so.

        What follows is a person's decision: the controller is started anew once the machine is sound.
        """
        self._fault, self.carriage.stopped = reason, True
        effects: list[Effect] = [Report(f"stopped: {reason.name}"), *self.carriage.claim(now_us)]
        lost = self._untouched()
        for task in lost:
            self.recovery.forget(task)
            effects += self.going_around.forfeit(task, reason, now_us)
        self.program.leave_out(lost)
        return effects
