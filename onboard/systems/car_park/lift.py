"""The elevator robot (ER): a platform that serves rides in the order of everybody's plans, one at a time.

It schedules its future from the robots' itineraries and is never locked for a session: it goes ahead to the floor of
the next ride, grants platform and gate there, moves when the gate is back and its sensor sees the carrier wholly
aboard, and grants the gate again on the floor of arrival. It moves only while it holds the gate itself.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, DriveMode, Grade, KindCode, LegAction, MachineState, Reason, TaskPhase
from onboard.contract.messages import (
    Award,
    DriveOrder,
    DriveState,
    Itinerary,
    Leg,
    Message,
    PlatformState,
    Progress,
    TaskReport,
)
from onboard.core.authority import TokenKey, segment_token
from onboard.core.behaviour import OverheardWord
from onboard.core.effects import Effect, Record, Send
from onboard.core.journal_records import records_in
from onboard.core.motion_authority import authorised
from onboard.core.negotiation import Awarded, AwardedAgain, NegotiationEvent, PreAssigned, Released
from onboard.core.serial import from_bus_ms, is_newer
from onboard.systems.car_park.bay_memory import BayMemory
from onboard.systems.car_park.lift_generation import LiftGeneration
from onboard.systems.car_park.lift_steps import LIFT_TABLE, LiftDeed, LiftFinding, LiftPhase
from onboard.systems.car_park.records import RideOverRecord, RideRecord
from onboard.systems.car_park.stall import MOVES, PlaceWords, Stall, lift_silence_us
from onboard.systems.car_park.stewardship import Stewardship
from onboard.ways.lifts import MARK_TOLERANCE_MM, gate, nearest_stop, platform, stop_mm, under_gate
from onboard.ways.mirror import WayFleet
from onboard.work.device_link import DeviceLink

#: A drive that says to be farther from the nearest mark than this is not believed, mm: no track has such gaps.
OFF_LIMIT_MM = 20_000


@dataclass(frozen=True, slots=True)
class Ride:
    """One ride as its robot planned it; ``board`` and ``leave`` are lift indices, ``begin_us`` the RIDE leg's begin."""

    robot: int
    board: int
    leave: int
    begin_us: int


@dataclass
class Lift:
    """One elevator. ``ride`` is the ride in hand, from the grant of the platform until it is back."""

    fleet: WayFleet
    generation: LiftGeneration
    kind: KindCode = KindCode.LIFT
    phase: LiftPhase = LiftPhase.STARTING
    ride: Ride | None = None
    drive: DriveState | None = None
    platform: PlatformState | None = None
    stewardship: Stewardship = field(init=False)
    stall: Stall = field(init=False)
    _is_stuck: bool = False
    #: The drive's orders: a position in the shaft, mm.
    link: DeviceLink[int] = field(init=False)
    _told: PlaceWords[int] = field(default_factory=PlaceWords)
    #: Under which version of the gate it said so last, while that was out.
    _proved: int | None = None
    _gate_was_out: bool = False
    _made: dict[int, int] = field(default_factory=dict)
    _rides_with_me: dict[int, tuple[Itinerary, bool]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        me, site = self.fleet.node_id, self.fleet.site
        speed_mm_s = site.lift.speed_mm_s
        self.link = DeviceLink(
            lambda sequence, position_mm: DriveOrder(me, sequence, position_mm, speed_mm_s),
            site.timing.drive_refresh_us,
        )
        self.stall = Stall(silence_us=lift_silence_us(site, self.track))
        self.stewardship = Stewardship(self.fleet)
        self.stewardship.replay(BayMemory(self.fleet.node_id).read(self.fleet.entries))

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def track(self) -> int:
        """The lift's shaft, as the number of a track."""
        return self.fleet.machine.home.track

    @property
    def state(self) -> MachineState:
        """For heartbeats: WAITING already where it stands and only its robot is not heard yet."""
        if self.phase is LiftPhase.STARTING:
            # Who knows where it stands takes part, though it waits for the robot that has its platform to be heard.
            stands = self.drive is not None and self.drive.mode is DriveMode.STANDING
            return MachineState.WAITING if stands and self.platform is not None else MachineState.STARTING
        if self._is_stuck:
            return MachineState.STOPPED
        return MachineState.IDLE if self.phase is LiftPhase.FREE else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """A lift's future is in the robots' itineraries."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing moves before the position is sensed."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Drive and platform sensors; every floor that is passed or reached is told to the fleet."""
        if isinstance(message, PlatformState):
            self.platform = message
            return []
        if not isinstance(message, DriveState):
            return []
        if abs(message.position_mm - self._position_mm(self._nearest(message.position_mm))) > OFF_LIMIT_MM:
            self.fleet.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            return []
        if self.drive is None:
            self.link.go_on_from(message.sequence)
        self.drive = message
        self.stall.sensed(message.position_mm, now_us)
        self.generation.index = self._index()
        return self._tell(now_us)

    def _tell(self, now_us: int) -> list[Effect]:
        """Say where the platform stops or has come to, and once under each version by which the gate is out."""
        assert self.drive is not None
        index, proves = self._index(), None if self._holds_gate() else self._gate_version
        is_proof = proves is not None and proves != self._proved
        if not self._told.is_news(index, self.drive.mode, now_us) and not is_proof:
            return []
        self._told.last = (index, self.drive.mode in MOVES, now_us)
        self._proved = proves
        return [self._word(self.drive)]

    @property
    def _gate_version(self) -> int:
        return self.fleet.tokens.seen.get(segment_token(gate(self.track)), 0)

    def _word(self, drive: DriveState) -> Effect:
        """Where the platform is, under the version of the gate: whoever holds it under this one may go by it."""
        index = self._index()
        offset_mm = drive.position_mm - self._position_mm(index)
        under = under_gate(self._gate_version)
        return Send(Progress(self.fleet.node_id, *under, self.track, index, offset_mm, drive.speed_mm_s))

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """As steward of alleys: awards tell who may fetch a stored car, and a car given to me is stated anew."""
        effects = self.stewardship.hear(message, now_us)
        if not isinstance(message, Award) or message.result is not CallResult.AWARDED:
            return effects
        known = self.fleet.negotiation.knows(message.sender, message.call)
        if message.winner == self.fleet.node_id and not known:
            # Of a life before, or of before a sleep: the ride stands in its robot's itinerary, a word ends the repeats.
            effects.append(Send(TaskReport(self.fleet.node_id, message.task, TaskPhase.AWARDED, 0, Reason.NONE)))
        return effects

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """An option is kept while it stands, and never driven for: only the robots' firm itineraries move the lift.

        A ride that was awarded stands in the robot's itinerary already; a word ends the award's repeats.
        """
        match event:
            case PreAssigned(call_key=key, proposal=proposal):
                self.generation.promises.update((key, promise) for promise in proposal.program)
                return []
            case Released(call_key=key):
                self.generation.promises.pop(key, None)
                return []
            case Awarded(call_key=key, call=call):
                self.generation.promises.pop(key, None)
                taken = TaskReport(self.fleet.node_id, call.task, TaskPhase.AWARDED, call.from_station, Reason.NONE)
                return [Send(taken)]
            case AwardedAgain(call=call):
                return [
                    Send(TaskReport(self.fleet.node_id, call.task, TaskPhase.AWARDED, call.from_station, Reason.NONE))
                ]
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Platform: to the robot of the next ride, at its floor. Gate: to the robot of the ride, at its floor."""
        if key == segment_token(platform(self.track)):
            return self._may_have_platform(requester, now_us)
        if key == segment_token(gate(self.track)):
            return self._may_have_gate(requester, now_us)
        return self.stewardship.may_grant(key, requester, now_us)

    def advance(self, now_us: int) -> list[Effect]:
        """One step of the phase table."""
        effects = self.stewardship.review(now_us)
        self._is_stuck = self.stall.is_stuck(now_us)
        if self.drive is None or self.platform is None:
            return effects
        effects += self._step(now_us)
        if not self._holds_gate():
            # Who has it goes by no word but one that was said since.
            effects += self._tell(now_us)
        return effects

    def next_wake(self) -> int | None:
        """When the drive's order is to be repeated, or a winner counts as lost."""
        due = [time for time in (self.link.due_us, self.stewardship.next_wake()) if time is not None]
        return min(due, default=None)

    def looks_from(self) -> int:
        """It looks often whether its drive has got stuck, or goes again."""
        return 0 if self._is_stuck else self.stall.stuck_from_us

    def heeds(self, message: OverheardWord) -> bool:
        """Where the robots are that are to ride, and who has the platform."""
        if isinstance(message, Progress):
            itinerary = self.fleet.mirror.itineraries.get(message.sender)
            return itinerary is not None and self._ride_legs(itinerary)
        return TokenKey(message.token_kind, message.token) == segment_token(platform(self.track))

    def statements(self, now_us: int) -> list[Effect]:
        """Where the platform is, and the tokens that this node holds."""
        effects = self.stewardship.car_statements() + self.fleet.tokens.statements()
        if self.drive is not None and self.drive.mode is DriveMode.STANDING:
            effects.append(self._word(self.drive))
        return effects

    # --- grants ------------------------------------------------------------------------------------------------

    def _may_have_platform(self, requester: int, now_us: int) -> Reason:
        if self.phase is not LiftPhase.FREE:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        following = self.next_ride(now_us)
        if following is None or following.robot != requester:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        if not self._stands_at(following.board):
            return Reason.DOOR_NOT_READY
        self._do(LiftFinding.GRANTED, following, now_us)
        return Reason.NONE

    def _may_have_gate(self, requester: int, now_us: int) -> Reason:
        ride = self.ride
        if ride is None or ride.robot != requester:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        is_entered = self._gate_was_out and (self.platform is None or self.platform.carrier_aboard)
        if self.phase is LiftPhase.BOARDING and not is_entered and self._stands_at(ride.board):
            # Again where nobody came in by it: it may have come back from the ride before only now.
            self._gate_was_out = True
            return Reason.NONE
        is_aboard = not self._holds_platform()
        if self.phase is LiftPhase.LEAVING and is_aboard and self._stands_at(ride.leave) and not self._onward(now_us):
            # As often as it is asked for: who waits aboard gives the gate back. The ride ends with the platform: a gate
            # that went out behind that would keep it from ending.
            return Reason.NONE
        return Reason.DOOR_NOT_READY

    def next_ride(self, now_us: int) -> Ride | None:
        """The ride that the robots' firm itineraries plan first among those not yet made."""
        rides = [
            ride
            for node, itinerary in self.fleet.mirror.itineraries.items()
            if self._ride_legs(itinerary) and not self._is_absent(node)
            for ride in self._rides(node, itinerary, now_us)
        ]
        rides = [ride for ride in rides if self._made.get(ride.robot) != ride.begin_us]
        return min(rides, key=lambda ride: (ride.begin_us, ride.robot), default=None)

    def _is_absent(self, robot: int) -> bool:
        """Whether a robot is an obstacle that does not hold the platform: its planned rides count no more."""
        holder = self.fleet.tokens.holder_of(segment_token(platform(self.track)))
        return robot in self.fleet.mirror.obstacles.machines and robot != holder

    def _as_planned_now(self, ride: Ride, now_us: int) -> Ride:
        """The ride of whoever is aboard by its newest plan: a restarted robot may want to go elsewhere."""
        itinerary = self.fleet.mirror.itineraries.get(ride.robot)
        planned = self._rides(ride.robot, itinerary, now_us)
        return next((one for one in planned if one.board == ride.board), ride)

    def _rides(self, robot: int, itinerary: Itinerary | None, now_us: int) -> list[Ride]:
        """Rides on this lift that a robot's plan still has before it, by its own word for where in the plan it is."""
        if itinerary is None:
            return []
        return rides_of(self.track, robot, itinerary, self.fleet.mirror.progress.get(robot), now_us)

    def _ride_legs(self, itinerary: Itinerary) -> bool:
        """Whether an itinerary rides with this lift at all: few do, and it is asked for at every message."""
        known = self._rides_with_me.get(itinerary.sender)
        if known is None or known[0] is not itinerary:
            rides = any(leg.action is LegAction.RIDE and leg.track == self.track for leg in itinerary.legs)
            known = self._rides_with_me[itinerary.sender] = (itinerary, rides)
        return known[1]

    # --- the phases --------------------------------------------------------------------------------------------

    def _step(self, now_us: int) -> list[Effect]:
        """One line of ``LIFT_TABLE``, by what is found now."""
        return self._do(*self._found(now_us), now_us)

    def _found(self, now_us: int) -> tuple[LiftFinding, Ride | None]:
        """What counts in this phase, and the ride that it is about."""
        match self.phase:
            case LiftPhase.STARTING:
                return self._found_starting(now_us)
            case LiftPhase.FREE:
                following = self.next_ride(now_us)
                return LiftFinding.NOTHING if following is None else LiftFinding.WANTED, following
            case LiftPhase.BOARDING:
                return self._found_boarding(now_us)
            case LiftPhase.RIDING:
                there = self.ride is not None and self._stands_at(self.ride.leave)
                return LiftFinding.THERE if there else LiftFinding.ON_THE_WAY, self.ride
            case LiftPhase.LEAVING:
                return self._found_leaving(now_us)

    def _do(self, finding: LiftFinding, ride: Ride | None, now_us: int) -> list[Effect]:
        """What the table says, for the ride that the finding is about."""
        self.phase, deed = LIFT_TABLE[self.phase, finding]
        match deed:
            case LiftDeed.STATE:
                self.ride = ride
                return self.statements(now_us)
            case LiftDeed.LET_IN:
                # A grant of the gate may be under way still, of a boarding that its robot gave up.
                self.ride, self._gate_was_out = ride, not self._holds_gate()
            case LiftDeed.ARRIVE:
                self._gate_was_out = False
                return self._stand()
            case LiftDeed.STAND:
                return self._stand()
            case LiftDeed.TO_BOARD | LiftDeed.TO_END if ride is not None:
                return self._go(ride.board if deed is LiftDeed.TO_BOARD else ride.leave, now_us)
            case LiftDeed.SET_OFF if ride is not None:
                self.ride = ride
                return [Record(RideRecord(ride.robot, ride.board, ride.leave)), *self._go(ride.leave, now_us)]
            case LiftDeed.END:
                return self._end_ride(now_us)
        return []

    def _found_starting(self, now_us: int) -> tuple[LiftFinding, Ride | None]:
        """Free where nobody has the platform; after a restart in the middle of a ride, back into its phase."""
        assert self.platform is not None and self.drive is not None
        if self.drive.mode is not DriveMode.STANDING:
            return LiftFinding.NOTHING, None
        holder = self.fleet.tokens.holder_of(segment_token(platform(self.track)))
        if holder != self.fleet.node_id:
            return self._found_of_ride(holder, now_us)
        is_clear = not self.platform.crossing and not self.platform.carrier_aboard
        return LiftFinding.CLEAR if is_clear else LiftFinding.NOTHING, None

    def _found_of_ride(self, robot: int, now_us: int) -> tuple[LiftFinding, Ride | None]:
        """Who holds the platform is boarding, riding or leaving: tokens, sensors and the journal tell which."""
        assert self.platform is not None
        ride = self._ride_in_journal()
        if ride is not None:
            return LiftFinding.RIDE_AT_END if self._stands_at(ride.leave) else LiftFinding.RIDE_BEGUN, ride
        itinerary = self.fleet.mirror.itineraries.get(robot)
        planned = self._rides(robot, itinerary, now_us)
        here = next((one for one in planned if self._stands_at(one.board)), None)
        is_inside = self.platform.carrier_aboard and not self.platform.crossing and self._holds_gate()
        if itinerary is not None and planned and is_inside:
            # The journal was lost on the way: whoever is aboard tells where it is carried, and has nowhere else to go.
            leg = leg_in_hand(itinerary, self.fleet.mirror.progress.get(robot))
            is_carried = leg is not None and (leg.action, leg.track) == (LegAction.RIDE, self.track)
            if is_carried and self._stands_at(planned[0].leave):
                # It may plan to come back and ride from here: that is another ride.
                return LiftFinding.RIDE_AT_END, planned[0]
            if is_carried and here is None:
                return LiftFinding.RIDE_BEGUN, planned[0]
        if here is None:
            return LiftFinding.NOTHING, None
        self._gate_was_out = self.platform.carrier_aboard or not self._holds_gate()
        return LiftFinding.RIDE_PLANNED, here

    def _found_boarding(self, now_us: int) -> tuple[LiftFinding, Ride | None]:
        assert self.platform is not None and self.ride is not None
        aboard = self.platform.carrier_aboard and not self.platform.crossing
        if self._gate_was_out and self._holds_gate() and aboard:
            return LiftFinding.ABOARD, self._as_planned_now(self.ride, now_us)
        return LiftFinding.GIVEN_UP if self._holds_platform() else LiftFinding.NOTHING, self.ride

    def _found_leaving(self, now_us: int) -> tuple[LiftFinding, Ride | None]:
        """Whether who is aboard has left, or says that it rides on: its plan begins with that ride then."""
        assert self.platform is not None
        if self._holds_platform() and self._holds_gate():
            return LiftFinding.OUT, self.ride
        aboard = self.platform.carrier_aboard and not self.platform.crossing
        onward = self._onward(now_us) if aboard and self._holds_gate() else None
        return LiftFinding.NOTHING if onward is None else LiftFinding.ONWARD, onward

    def _ride_in_journal(self) -> Ride | None:
        """The ride that was begun and not ended when the controller stopped."""
        found: Ride | None = None
        for record in records_in(self.fleet.entries, RideRecord, RideOverRecord):
            found = None
            if isinstance(record, RideRecord):
                found = Ride(record.robot, record.board, record.leave, 0)
        return found

    def _onward(self, now_us: int) -> Ride | None:
        """The ride from this floor that the robot of the ride in hand says it is in, by its plan and ``Progress``."""
        assert self.ride is not None
        robot = self.ride.robot
        itinerary, seen = self.fleet.mirror.itineraries.get(robot), self.fleet.mirror.progress.get(robot)
        if itinerary is None or seen is None or is_newer(seen.itinerary_version, itinerary.version, 8):
            # Where it says that it is further on, its plan was missed; a plan told since begins where it is.
            return None
        leg = leg_in_hand(itinerary, seen)
        if leg is None or (leg.action, leg.track, leg.from_index) != (LegAction.RIDE, self.track, self.ride.leave):
            return None
        planned = self._rides(robot, itinerary, now_us)
        return next((one for one in planned if (one.board, one.leave) == (leg.from_index, leg.to_index)), None)

    def _end_ride(self, now_us: int) -> list[Effect]:
        assert self.ride is not None
        # The robot need not tell its plan anew after a ride: it is remembered as made.
        self._made[self.ride.robot] = self._begin_as_told(self.ride, now_us)
        over = Record(RideOverRecord(self.ride.robot))
        self.ride = None
        return [over, *self._step(now_us)]

    def _begin_as_told(self, ride: Ride, now_us: int) -> int:
        """When a ride began by its robot's newest plan: who wins a task while aboard tells the same ride anew."""
        itinerary = self.fleet.mirror.itineraries.get(ride.robot)
        leg = leg_in_hand(itinerary, self.fleet.mirror.progress.get(ride.robot)) if itinerary is not None else None
        told = (LegAction.RIDE, self.track, ride.board, ride.leave)
        if leg is None or (leg.action, leg.track, leg.from_index, leg.to_index) != told:
            return ride.begin_us
        return self._rides(ride.robot, itinerary, now_us)[0].begin_us

    # --- inner works -------------------------------------------------------------------------------------------

    def _holds_gate(self) -> bool:
        return self.fleet.tokens.holds(segment_token(gate(self.track)))

    def _holds_platform(self) -> bool:
        return self.fleet.tokens.holds(segment_token(platform(self.track)))

    def _position_mm(self, index: int) -> int:
        return stop_mm(self.fleet.site, self.track, index)

    def _index(self) -> int:
        assert self.drive is not None
        return self._nearest(self.drive.position_mm)

    def _nearest(self, position_mm: int) -> int:
        return nearest_stop(self.fleet.site, self.track, position_mm)

    def _stands_at(self, index: int) -> bool:
        drive = self.drive
        if drive is None or drive.mode is not DriveMode.STANDING or drive.sequence != self.link.sequence:
            # One that has not taken up the last order yet may still go by it.
            return False
        return abs(drive.position_mm - self._position_mm(index)) <= MARK_TOLERANCE_MM

    def _stand(self) -> list[Effect]:
        self.stall.rests()
        self.link.rest()
        return []

    def _go(self, index: int, now_us: int) -> list[Effect]:
        """Order the drive to a floor and keep the order fresh, under the authority of the gate."""
        if self._stands_at(index):
            return self._stand()
        permit = authorised(self.fleet.motion, [segment_token(gate(self.track))])
        if not permit or self.platform is None or self.platform.crossing:
            return self._stand()
        said = self.link.order(self._position_mm(index), permit, now_us)
        if said:
            self.stall.ordered(now_us)
        return said


def rides_of(track: int, robot: int, itinerary: Itinerary, seen: Progress | None, now_us: int) -> list[Ride]:
    """Rides on one lift that a firm itinerary still plans: those in its leg in hand, as its robot said it, and later.

    Whether a ride is over is the robot's word alone: planned times say only in which order rides were planned.
    """
    if itinerary.grade is not Grade.FIRM:
        return []
    current, rides = _current(itinerary, seen), []
    begin_us = from_bus_ms(itinerary.stamp.award_ms, now_us)
    for number, leg in enumerate(itinerary.legs):
        if number >= current and leg.action is LegAction.RIDE and leg.track == track:
            rides.append(Ride(robot, leg.from_index, leg.to_index, begin_us))
        begin_us = from_bus_ms(leg.end_ms, now_us)
    return rides


def leg_in_hand(itinerary: Itinerary, seen: Progress | None) -> Leg | None:
    """The leg that a robot is in by its own word, the first where it said nothing yet; None where all are done."""
    current = _current(itinerary, seen)
    return itinerary.legs[current] if current < len(itinerary.legs) else None


def _current(itinerary: Itinerary, seen: Progress | None) -> int:
    return seen.leg if seen is not None and seen.itinerary_version == itinerary.version else 0
