"""From power-up to the first step: while a robot starts, nothing but this touches its program, plan or drives.

No plan that is heard, no award, no neighbour that asks for room: the program has no place before this is over, and
refuses (design, section 6). Where the carrier stands and whether the shuttle is out come from the sensors, what is in
hand from the journal; nothing else is remembered. Two ways lead out: the robot takes part, or it
is held for a person, because sensors and journal contradict each other. A broken actuator is the robot's own business.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Final, NamedTuple

from onboard.contract.codes import DriveMode, Grade, LegAction, ShuttleMode
from onboard.contract.messages import Reference, ShuttleState, Stamp
from onboard.core.effects import Effect, Report, Send
from onboard.core.serial import successor, to_bus_ms
from onboard.core.site import Segment
from onboard.core.token_keys import segment_token
from onboard.systems.car_park import custody, salvage
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.handling import ShuttleWork
from onboard.systems.car_park.program import CarStep, ends_at, standing_itinerary, to_itinerary
from onboard.systems.car_park.recovery import JournalRecovery, floor_record
from onboard.systems.car_park.riding import Riding
from onboard.systems.car_park.travel import Carriage
from onboard.ways.kinematics import run_duration_us
from onboard.ways.lift_uses import ride_us
from onboard.ways.lifts import gate, sill
from onboard.ways.mirror import WayFleet

#: From the first known position after a restart until plans are made: whom it is in the way of says meanwhile what it
#: plans now. What all planned before they have told with their answers.
SETTLING_US = 500_000
#: Modes in which the shuttle has come to rest.
AT_REST = (ShuttleMode.HOME, ShuttleMode.REACHED)


class StartStage(Enum):
    """How far a robot has come since power-up."""

    UNPLACED = "looks for its place"
    SETTLING = "knows its place, and hears what the others plan"
    HELD = "held for a person: sensors and journal contradict each other"
    OVER = "takes part"


class StartEvent(Enum):
    """What leads from one stage to the next."""

    FIRST_PLACE = auto()
    PLACE_AGAIN = auto()
    PLACE_LOST = auto()
    CONTRADICTION = auto()
    AGREEMENT = auto()
    PLAN = auto()


TABLE: Final[dict[tuple[StartStage, StartEvent], StartStage]] = {
    (StartStage.UNPLACED, StartEvent.FIRST_PLACE): StartStage.OVER,
    (StartStage.UNPLACED, StartEvent.PLACE_AGAIN): StartStage.SETTLING,
    (StartStage.UNPLACED, StartEvent.CONTRADICTION): StartStage.HELD,
    (StartStage.SETTLING, StartEvent.PLACE_LOST): StartStage.UNPLACED,
    (StartStage.SETTLING, StartEvent.CONTRADICTION): StartStage.HELD,
    (StartStage.SETTLING, StartEvent.PLAN): StartStage.OVER,
    (StartStage.HELD, StartEvent.AGREEMENT): StartStage.UNPLACED,
}


class RobotDevices(NamedTuple):
    """What a robot senses and moves."""

    carriage: Carriage
    shuttle: ShuttleWork
    riding: Riding


@dataclass
class Starting:
    """One robot's start. ``announce()`` is called once it stands, ``started(planned, now)`` once it is over.

    ``planned`` are the steps behind what was in hand, None where there was no way.
    """

    fleet: WayFleet
    generation: CarParkGeneration
    body: RobotDevices
    recovery: JournalRecovery
    announce: Callable[[], list[Effect]]
    started: Callable[[tuple[CarStep, ...] | None, int], list[Effect]]
    stage: StartStage = StartStage.UNPLACED
    place: Segment | None = field(default=None, init=False)
    _due_us: int | None = None
    #: The run to the place that is still under way while the others are heard.
    _run: CarStep | None = None

    def __post_init__(self) -> None:
        self.fleet.slots_told = self.fleet.slots_told or self.recovery.told

    @property
    def is_over(self) -> bool:
        """Whether the robot takes part."""
        return self.stage is StartStage.OVER

    def next_wake(self) -> int | None:
        """When the others have had their time, or a lift is to be asked; what else is waited for is told by sensors."""
        return self._due_us if self._due_us is not None else self.body.riding.sill.next_wake()

    def advance(self, now_us: int) -> list[Effect]:
        """One step of the table, where what leads to it was found."""
        if self.body.carriage.sensed is None:
            return []
        if self.stage is StartStage.HELD:
            return self._look_again(now_us)
        if self.stage is StartStage.UNPLACED:
            return self._find_place(now_us)
        return self._settle(now_us)

    def _enter(self, found: StartEvent) -> None:
        self.stage = TABLE[self.stage, found]

    # --- the place ---------------------------------------------------------------------------------------------

    def _find_place(self, now_us: int) -> list[Effect]:
        """Placed at a mark; between marks first to the nearest one, as far as rights allow, with the shuttle home.

        That it goes there is told once it may: the others hear of it, and it hears them, while it goes.
        In the mouth of a spur, turned towards it, it turns back first: no plan begins or ends there.
        """
        carriage = self.body.carriage
        effects = custody.take_over(self.fleet)
        if self.fleet.slots_told:
            effects += self._is_told(self.fleet.slots_told, now_us)
            if self.fleet.slots_told:
                return effects
        here = carriage.standing_at
        assert carriage.sensed is not None
        if here is not None and here == carriage.nearest:
            return effects + self._is_placed(here, now_us)
        out = carriage.way_out
        if out is not None and carriage.goal is not None and carriage.goal != out:
            carriage.go(out)
        shuttle = self.body.shuttle.sensed
        rests = carriage.sensed.mode in (DriveMode.STANDING, DriveMode.FAULT)
        if carriage.goal is None and rests and shuttle is not None and shuttle.mode in AT_REST:
            if shuttle.mode is not ShuttleMode.HOME:
                return effects + self._hold(self._contradiction(None, shuttle))
            if not self.generation.is_held:
                # It asks first for what it is in: it may have been pushed there while it was off.
                carriage.go(out or carriage.nearest)
        if carriage.goal is None:
            return effects
        effects += carriage.advance(now_us)
        run = self._run_to_mark(now_us)
        return effects if run is None else effects + self._tell_place(run.destination, run, now_us)

    def _run_to_mark(self, now_us: int) -> CarStep | None:
        """The run to the nearest mark once the drive has its order: the place is known then, and others may hear it.

        None where the body is in one slot or across a mouth, or where anything but a run is in hand: then it is placed
        when it stands.
        """
        carriage, goal = self.body.carriage, self.body.carriage.goal
        if goal is None or goal.track != carriage.track or carriage.target != goal or carriage.way_out is not None:
            return None
        assert carriage.sensed is not None
        off_mm = carriage.sensed.position_mm - carriage.axis.position_mm(goal.index)
        behind = goal.index + (1 if off_mm > 0 else -1)
        if behind in carriage.axis.mouths or carriage.axis.slot(behind) not in carriage.occupied():
            return None
        if not self._has_only_to_run(goal):
            return None
        end_us = now_us + run_duration_us(abs(off_mm), self.fleet.site.carrier)
        return CarStep(LegAction.TRAVEL, goal.track, behind, goal.index, now_us, end_us)

    def _has_only_to_run(self, goal: Segment) -> bool:
        """Whether nothing else was begun, and sensors and journal agree."""
        shuttle, recovery = self.body.shuttle.sensed, self.recovery
        if not recovery.is_restart or recovery.phase is not None or recovery.ride is not None or shuttle is None:
            return False
        is_known = bool(recovery.works) or not shuttle.load_kg
        return is_known and not self._missing() and not self._contradiction(goal, shuttle)

    def _is_told(self, told: tuple[Segment, ...], now_us: int) -> list[Effect]:
        """A journal that is lost knew the floor: who made the rights anew has seen where the carrier stands.

        Aboard a lift the floor is where that stands by its word under the gate, which is asked for where it has it.
        """
        site, sill_proof = self.fleet.site, self.body.riding.sill
        # In a mouth it is turned, or turning: its drive speaks of the track inside.
        floor = site.turned_into(told) or next((slot.track for slot in told if slot.track not in site.lifts), None)
        if floor is None:
            lift, key = told[0].track, segment_token(gate(told[0].track))
            if not self.fleet.tokens.holds(key):
                return self.fleet.tokens.want(key, now_us)
            stop = sill_proof.stands_at(lift)
            if stop is None:
                return sill_proof.ask([lift], now_us)
            floor = sill(site, lift, stop).track
        self.fleet.slots_told, self.body.carriage.track, self.recovery.is_restart = (), floor, True
        return [floor_record(floor)]

    def _is_placed(self, here: Segment, now_us: int) -> list[Effect]:
        """Stand here and tell everybody; after a restart go on a little later."""
        self.place = here
        self.body.carriage.go(here)
        if not self.recovery.is_restart:
            return self._start_first(here, now_us)
        return self._tell_place(here, None, now_us)

    def _tell_place(self, here: Segment, run: CarStep | None, now_us: int) -> list[Effect]:
        """Say where it stands, or will when its ``run`` is over, and hear what the others plan."""
        self._enter(StartEvent.PLACE_AGAIN)
        self.place, self._run, self._due_us = here, run, now_us + SETTLING_US
        program, node = self.generation.program, self.fleet.node_id
        program.version = successor(program.version, 8)
        stamp = Stamp(to_bus_ms(now_us), node, 0)
        told = standing_itinerary(node, program.version, stamp, here, now_us)
        if run is not None:
            told = to_itinerary(node, program.version, Grade.FIRM, stamp, [run])
        self.fleet.mirror.on_itinerary(told, now_us)
        return [Send(told), *self.announce()]

    def _start_first(self, here: Segment, now_us: int) -> list[Effect]:
        """A first life has nothing in hand: it takes part as soon as its shuttle is seen to be home."""
        shuttle = self.body.shuttle.sensed
        if shuttle is None or shuttle.mode not in AT_REST:
            return []
        why = self._contradiction(here, shuttle)
        if why:
            return self._hold(why)
        self._enter(StartEvent.FIRST_PLACE)
        return self._go_on(here, (), now_us)

    # --- what is in hand ---------------------------------------------------------------------------------------

    def _settle(self, now_us: int) -> list[Effect]:
        """Ask for what it is in; once the others were heard and the shuttle is at rest, go on where they agree."""
        assert self.place is not None
        if not self._is_at_place:
            # Pushed away meanwhile, or may go no farther: what was said of the place is wrong.
            self._enter(StartEvent.PLACE_LOST)
            self.body.carriage.stay()
            self._due_us = self._run = None
            return self._find_place(now_us)
        effects = self.body.carriage.advance(now_us)
        if self._due_us is not None and now_us < self._due_us:
            return effects
        self._due_us = None
        shuttle = self.body.shuttle.sensed
        if shuttle is None or not (shuttle.mode in AT_REST or self._is_in_a_stroke(self.place, shuttle)):
            return effects
        effects += self._salvage(self.place, shuttle, now_us)
        why = self._contradiction(self.place, shuttle)
        return effects + (self._hold(why) if why else self._take_part(now_us))

    @property
    def _is_at_place(self) -> bool:
        """Whether the carrier stands at the place as told, or still runs there as its drive was ordered."""
        carriage = self.body.carriage
        if carriage.standing_at == self.place:
            self._run = None
            return True
        return self._run is not None and carriage.target == self.place

    def _is_in_a_stroke(self, place: Segment, shuttle: ShuttleState) -> bool:
        """Whether the shuttle still does what the journal has begun here: it is gone on with when that is over."""
        moves = shuttle.mode is not ShuttleMode.FAULT and self.recovery.phase is not None
        return moves and self.recovery.is_under_way(place, shuttle) and not self._missing()

    def _salvage(self, place: Segment, shuttle: ShuttleState, now_us: int) -> list[Effect]:
        """Where the journal was lost: what sensors and rights say that is in hand."""
        if self.recovery.works or (shuttle.mode is ShuttleMode.HOME and not shuttle.load_kg):
            return []
        found = salvage.find(self.fleet, self.generation, place, shuttle, now_us)
        if found is None:
            return []
        self.recovery.works, self.recovery.phase = [found.work], found.phase
        return salvage.noted(found)

    def _hold(self, why: str) -> list[Effect]:
        self._enter(StartEvent.CONTRADICTION)
        self._due_us = None
        self.body.carriage.stay()
        return [Report(f"held for a person: {why}")]

    def _look_again(self, now_us: int) -> list[Effect]:
        """Whoever has put it right need not say so: the sensors do."""
        shuttle = self.body.shuttle.sensed
        if shuttle is None or shuttle.mode not in AT_REST:
            return []
        place = self.body.carriage.standing_at
        if self._contradiction(place, shuttle):
            return []
        self._enter(StartEvent.AGREEMENT)
        return [Report("sensors and journal agree again"), *self._find_place(now_us)]

    def _contradiction(self, place: Segment | None, shuttle: ShuttleState) -> str:
        """The same of what the journal has in hand, and of cars that came with rights made anew."""
        why = self.recovery.contradiction(place, shuttle)
        if why or place is None or shuttle.load_kg:
            return why
        missing = self._missing()
        if not missing or (len(missing) == 1 and len(custody.may_stand_in(self.fleet, place)) == 1):
            return ""
        names = ", ".join(f"{car.origin}.{car.number}" for car in missing)
        return f"no car is aboard, {names} was there by the last word of it, and where it was left no right tells"

    def _missing(self) -> list[Reference]:
        """Cars that are said to be aboard, and that nothing in hand is about: rights made anew tell no handling."""
        in_hand = {work.car for work in self.recovery.works}
        return [car for car in custody.said_aboard(self.fleet) if car not in in_hand]

    def _put_down(self, place: Segment, now_us: int) -> list[Effect]:
        """A car that is said to be aboard and is not was left before the journal was lost: where it had the right to.

        A robot leaves a car only in a station whose right it holds, and has that until it has said where the car is.
        """
        shuttle = self.body.shuttle.sensed
        if shuttle is None or shuttle.load_kg:
            return []
        effects: list[Effect] = []
        for car in self._missing():
            (station,) = custody.may_stand_in(self.fleet, place)
            effects.append(Report(f"car {car.origin}.{car.number} was left at {station} before its word was lost"))
            effects += custody.put_down(self.fleet, car, station, now_us)
        return effects

    def _take_part(self, now_us: int) -> list[Effect]:
        assert self.place is not None
        self._enter(StartEvent.PLAN)
        placed = self._put_down(self.place, now_us)
        return placed + self._go_on(self.place, self._in_hand(self.place, now_us), now_us)

    def _go_on(self, place: Segment, in_hand: tuple[CarStep, ...], now_us: int) -> list[Effect]:
        """Go on from ``place`` with what the journal says is mine, by a way planned anew (rows P14, P20)."""
        works, self.recovery.works = self.recovery.works, []
        stamp = Stamp(to_bus_ms(now_us), self.fleet.node_id, 0)
        if not self.recovery.is_restart:
            self.generation.program.begin(place, [], stamp)
            return self.started((), now_us)
        origin, start_us, ahead = place, now_us, works
        for step in in_hand:
            self._resume(step)
            origin, start_us = ends_at(self.fleet.site, step), step.end_us
            ahead = ahead if step.work is None else ahead[1:]
        more = self.generation.reroute(origin, start_us, ahead, now_us)
        calls = [work.call for work in works]
        if calls:
            stamp = Stamp(calls[0].deadline_ms, calls[0].sender, calls[0].call & 0xFF)
        self.generation.program.begin(place, [*in_hand, *(more or ())], stamp, ahead if more is None else ())
        return self.started(more, now_us)

    def _resume(self, step: CarStep) -> None:
        """The step in hand goes on from where the journal and the sensors say that it was."""
        if step.work is not None and self.recovery.phase is not None:
            self.body.shuttle.resume(step.work, self.recovery.phase)
        elif step.action is LegAction.RIDE:
            self.body.riding.begin(step.track, step.to_index)

    def _in_hand(self, here: Segment, now_us: int) -> tuple[CarStep, ...]:
        """The run, handling or ride that the start or the restart fell into, as the first step of the new program."""
        if self._run is not None:
            return (self._run,)
        ride = self.recovery.ride
        if ride is not None:
            lasts_us = ride_us(self.fleet.site, ride.track, ride.from_index, ride.to_index)
            return (ride._replace(begin_us=now_us, end_us=now_us + lasts_us),)
        assert self.body.shuttle.sensed is not None
        if not self.recovery.is_under_way(here, self.body.shuttle.sensed):
            return ()
        work = self.recovery.works[0]
        end_us = now_us + self.generation.handling_us(work.station)
        return (CarStep(LegAction.WORK, here.track, here.index, here.index, now_us, end_us, work),)
