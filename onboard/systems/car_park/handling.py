"""Taking a car from a station and leaving it there: the shuttle's steps as one table.

A station's token is the right to send the shuttle in; the car's token is its custody. Both are asked for in front of
the station; a compartment grants its bay only with the output door open. The journal notes each step before the order
to the actuator.

Who was pushed off its mark as it sent the shuttle out is refused by the shuttle's drive, which has not begun: nothing
is broken. It takes the order back, goes back to the mark and begins anew.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.codes import ShuttleAction, ShuttleMode, Side
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import ShuttleOrder, ShuttleState
from onboard.core.authority import TokenKey, station_token
from onboard.core.effects import Effect, Record
from onboard.core.motion_authority import Permit, authorised
from onboard.core.serial import successor
from onboard.systems.car_park import custody
from onboard.systems.car_park.program import CarHandling, HandlingPhase, StationWork
from onboard.systems.car_park.records import StepRecord
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.stall import Stall
from onboard.systems.car_park.travel import Carriage
from onboard.systems.car_park.unheard import Unheard
from onboard.ways.mirror import WayFleet
from onboard.ways.tokens import car_token

#: (phase, handling) -> (shuttle's order on leaving the phase, or None, and the next phase).
#: CLAMP grips when a car is taken and releases when it is left.
TABLE: dict[tuple[HandlingPhase, CarHandling], tuple[ShuttleAction | None, HandlingPhase]] = {
    (HandlingPhase.ACQUIRE, CarHandling.TAKE): (ShuttleAction.REACH, HandlingPhase.REACH),
    (HandlingPhase.REACH, CarHandling.TAKE): (ShuttleAction.GRIP, HandlingPhase.CLAMP),
    (HandlingPhase.CLAMP, CarHandling.TAKE): (ShuttleAction.RETRACT, HandlingPhase.RETRACT),
    (HandlingPhase.RETRACT, CarHandling.TAKE): (None, HandlingPhase.DONE),
    (HandlingPhase.ACQUIRE, CarHandling.LEAVE): (ShuttleAction.REACH, HandlingPhase.REACH),
    (HandlingPhase.REACH, CarHandling.LEAVE): (ShuttleAction.RELEASE, HandlingPhase.CLAMP),
    (HandlingPhase.CLAMP, CarHandling.LEAVE): (ShuttleAction.RETRACT, HandlingPhase.RETRACT),
    (HandlingPhase.RETRACT, CarHandling.LEAVE): (None, HandlingPhase.DONE),
}

#: The phase that is left by the order of each phase.
_BEFORE = {
    HandlingPhase.REACH: HandlingPhase.ACQUIRE,
    HandlingPhase.CLAMP: HandlingPhase.REACH,
    HandlingPhase.RETRACT: HandlingPhase.CLAMP,
}

#: The shuttle's mode that ends each phase, for the order given on entering it.
ENDS = {
    HandlingPhase.REACH: ShuttleMode.REACHED,
    HandlingPhase.CLAMP: ShuttleMode.REACHED,
    HandlingPhase.RETRACT: ShuttleMode.HOME,
}


@dataclass
class ShuttleWork:
    """One robot's shuttle and the handling in hand."""

    fleet: WayFleet
    work: StationWork | None = None
    phase: HandlingPhase = HandlingPhase.DONE
    sequence: int = 0
    sensed: ShuttleState | None = None
    fault: bool = False
    stall: Stall = field(default_factory=lambda: Stall(repeats=False))
    #: Whether the carrier stands at the mark of what is in hand, as far as is sensed.
    at_mark: Callable[[], bool] = lambda: True
    _resuming: bool = False
    _ordered: ShuttleOrder | None = None
    _unheard: Unheard = field(default_factory=Unheard)

    def begin(self, work: StationWork) -> list[Effect]:
        """Start one handling in front of its station."""
        self.work = work
        self.phase = HandlingPhase.ACQUIRE
        return []

    def resume(self, work: StationWork, phase: HandlingPhase) -> None:
        """Go on with a handling after a restart: the journal names its last step, the sensors whether it is over."""
        self.work, self.phase, self._resuming = work, phase, True

    @property
    def is_out(self) -> bool:
        """Whether the shuttle may be outside the carrier: then the carrier must not move (row P32)."""
        return self.phase not in (HandlingPhase.ACQUIRE, HandlingPhase.DONE)

    @property
    def is_astray(self) -> bool:
        """Whether its sensor sees it out though nothing in hand has sent it there: the carrier gets no orders then."""
        return self.sensed is not None and not self.is_home and not self.is_out

    def drop(self) -> None:
        """The handling in hand, which was not begun, is not to be: its rights are asked for no more."""
        self._ask_no_more()
        self.work, self.phase = None, HandlingPhase.DONE

    def _ask_no_more(self) -> None:
        for key in self._rights() if self.work is not None else ():
            self.fleet.tokens.forget(key)

    @property
    def is_home(self) -> bool:
        """Whether its own sensor says that it is home; what was never sensed is not."""
        return self.sensed is not None and self.sensed.mode is ShuttleMode.HOME

    def sense(self, state: ShuttleState, now_us: int) -> list[Effect]:
        """Take up the shuttle's state; one that goes on without the last order has missed it, and hears it again."""
        if self.sensed is None:
            # The shuttle does nothing on an order that it has had: go on from its number after a restart.
            self.sequence = state.sequence
        self.sensed = state
        if self._is_refused(state):
            self.phase = HandlingPhase.REFUSED
            return self._send(ShuttleAction.RETRACT, state.side, state.wheelbase_mm, now_us)
        is_answer = state.sequence == self.sequence
        self.fault = state.mode is ShuttleMode.FAULT and (is_answer or self.phase is not HandlingPhase.REFUSED)
        if self.phase is HandlingPhase.REFUSED and is_answer and self.is_home:
            self.phase = HandlingPhase.ACQUIRE
        order = self._ordered
        if order is None or not self.is_out or state.sequence == order.sequence:
            self.stall.rests()
            return []
        return self._permit().order(order) if self._unheard.is_due("shuttle", now_us, heard=False) else []

    def _is_refused(self, state: ShuttleState) -> bool:
        """Whether the drive would not reach out where the carrier, pushed since, does not stand at the mark."""
        has_stayed = state.mode is ShuttleMode.FAULT and not state.extension_mm and state.sequence == self.sequence
        return has_stayed and self.phase is HandlingPhase.REACH and bool(self._permit()) and not self.at_mark()

    def comes_back(self, now_us: int) -> list[Effect]:
        """Where it has reached out beside its station: the carrier was pushed to another mark in that very moment.

        Nothing is gripped or let go yet. It begins anew once the carrier is back.
        """
        state = self.sensed
        if state is None or self._resuming or self.phase is not HandlingPhase.REACH:
            return []
        if state.mode is not ShuttleMode.REACHED or state.sequence != self.sequence or not self._permit():
            return []
        self.phase = HandlingPhase.REFUSED
        return self._send(ShuttleAction.RETRACT, state.side, state.wheelbase_mm, now_us)

    def advance(self, now_us: int) -> list[Effect]:
        """Take the next step of the table where its condition is met."""
        if self.work is None or self.phase is HandlingPhase.DONE:
            return []
        if self._resuming:
            return self._resume(self.work, now_us)
        if self.phase is HandlingPhase.ACQUIRE:
            if self._is_elsewhere(self.work):
                self._ask_no_more()
                return []
            effects = self._acquire(now_us)
            is_taken = self.work.handling is CarHandling.LEAVE and custody.others_in(
                self.fleet.mirror, self.work.station, self.work.car
            )
            if is_taken:
                return effects
            return effects + self._next(now_us)
        if self.sensed is None or self.sensed.sequence != self.sequence or self.sensed.mode is not ENDS[self.phase]:
            return []
        return self._next(now_us)

    def _resume(self, work: StationWork, now_us: int) -> list[Effect]:
        """What the last step was to bring about is taken as over where the sensors say so, else ordered again."""
        state = self.sensed
        if state is None or state.mode not in (ShuttleMode.HOME, ShuttleMode.REACHED):
            return []
        self._resuming = False
        is_home = state.mode is ShuttleMode.HOME
        clamped = (state.load_kg > 0) is (work.handling is CarHandling.TAKE)
        if self.phase is HandlingPhase.CLAMP and clamped and is_home:
            self.phase = HandlingPhase.RETRACT
        over = {HandlingPhase.REACH: not is_home, HandlingPhase.CLAMP: clamped, HandlingPhase.RETRACT: is_home}
        if not over[self.phase]:
            self.phase = _BEFORE[self.phase]
        return self._next(now_us)

    def _rights(self) -> list[TokenKey]:
        assert self.work is not None
        return [station_token(self.work.station), car_token(*self.work.car)]

    def _is_elsewhere(self, work: StationWork) -> bool:
        """Whether a car that is to be taken stands at another station by its custodian's word: nothing is here."""
        if work.handling is not CarHandling.TAKE or not car_park(self.fleet.site).quiet_moves:
            return False
        stands = self.fleet.mirror.car_station(work.car)
        return stands is not None and stands != work.station

    def _permit(self) -> Permit:
        return authorised(self.fleet.motion, self._rights())

    def _acquire(self, now_us: int) -> list[Effect]:
        assert self.work is not None
        effects: list[Effect] = []
        rights = self._rights()
        if not self.work.wheelbase_mm and self.work.car not in self.fleet.mirror.cars:
            # Its driver still drives in: nobody has the right to a car that is not there.
            rights = rights[:1]
        for key in rights:
            effects += self.fleet.tokens.want(key, now_us)
        return effects

    def _wheelbase_mm(self, work: StationWork) -> int:
        """As it was called for; of a car that was called for before it was measured, as its custodian tells it."""
        record = self.fleet.mirror.cars.get(work.car)
        return work.wheelbase_mm or (0 if record is None else record.wheelbase_mm)

    def _next(self, now_us: int) -> list[Effect]:
        assert self.work is not None
        order, following = TABLE[self.phase, self.work.handling]
        if order is None:
            self.phase = following
            return self._finish(self.work, now_us)
        permit, wheelbase_mm, side = self._permit(), self._wheelbase_mm(self.work), self.work.station.side
        if not permit or (order is ShuttleAction.GRIP and not wheelbase_mm):
            # A car that is not measured as far as is known would be torn: its custodian tells it.
            return []
        self.phase = following
        measured_mm = 0 if self.work.wheelbase_mm else wheelbase_mm
        station, car = self.work.station.number, self.work.car.number
        begun = StepRecord(self.phase, self.work.handling, station, car, measured_mm)
        return [Record(begun), *self._send(order, side, wheelbase_mm, now_us)]

    def _send(self, action: ShuttleAction, side: Side, wheelbase_mm: int, now_us: int) -> list[Effect]:
        self.sequence = successor(self.sequence, 8)
        self._ordered = ShuttleOrder(self.fleet.node_id, self.sequence, action, side, wheelbase_mm)
        self._unheard.ordered("shuttle")
        self.stall.ordered(now_us)
        return self._permit().order(self._ordered)

    def _finish(self, work: StationWork, now_us: int) -> list[Effect]:
        """The shuttle is home: state where the car is, pass custody on after leaving it, give the station back."""
        key = car_token(*work.car)
        taken = work.handling is CarHandling.TAKE
        # After a restart it may be with its new custodian already, who states it then.
        where, wheelbase_mm = ANY_STATION if taken else work.station.number, self._wheelbase_mm(work)
        effects = custody.state(self.fleet, work.car, where, wheelbase_mm)
        owner = custody.keeper(self.fleet.site, work.station)
        given = [station_token(work.station)] if taken else [key, station_token(work.station)]
        for token in given:
            # After a restart in the middle of this one of them may be gone already.
            if self.fleet.tokens.holds(token):
                effects += self.fleet.tokens.give(token, owner, now_us)
        return effects


def handle(carriage: Carriage, shuttle: ShuttleWork, now_us: int) -> list[Effect]:
    """Carrier or shuttle, never both: who was pushed off the station goes back first, and not with the shuttle out."""
    if carriage.goal is None or carriage.arrived:
        return carriage.advance(now_us) + shuttle.advance(now_us)
    return shuttle.comes_back(now_us) if shuttle.is_out else carriage.advance(now_us)
