"""The lift that the kit speaks as: chapter 9 of docs/protocol.md from the lift's side, until a scene has it fail.

Its platform is moved by whoever plays; by the kit's clock it is there when its own run is over (duty P4).
"""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

from onboard.conform.cast import Cast
from onboard.conform.stage import MS, PlatformRun, Stage, Word, after_ms
from onboard.contract.codes import (
    CallResult,
    Grade,
    LegAction,
    MachineState,
    Operation,
    Reason,
    TaskPhase,
    TokenKind,
)
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Itinerary,
    Progress,
    TaskReport,
    TokenGrant,
    TokenRequest,
)
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.desk import ride_us, rise_us
from onboard.systems.car_park.conform.shafts import gate, platform, under_gate
from onboard.systems.car_park.site import car_park

#: Duty L1: a word this far off the mark counts as standing there, mm.
MARK_MM = 5
#: What a run of the platform may take beside its own time: the node's plan has 400 ms for gate and sill.
_PLAY_US = 50 * MS


class Phase(Enum):
    """Where the lift is with the ride in hand: the chart of chapter 9."""

    FREE = "nobody has the platform"
    BOARDING = "the platform is granted"
    RIDING = "on its way to the ride's end"
    LEAVING = "at the ride's end"


class RideAhead(NamedTuple):
    """A RIDE leg of the node's plan; when it begins, bus time in ms as frames tell it."""

    board: int
    leave: int
    begin_ms: int


def as_said(word: Progress) -> Progress | None:
    """Its word as it is, as a good lift says it."""
    return word


def unsaid(_: Progress) -> Progress | None:
    """No word at all, so that who waits must ask."""
    return None


def otherwise(**changes: int) -> Callable[[Progress], Progress | None]:
    """Its word with these fields otherwise."""
    return lambda word: replace(word, **changes)


def elsewhere(word: Progress) -> Progress | None:
    """As if it stood at the other of its two stops."""
    return replace(word, index=3 - word.index)


class Platform:
    """One lift. ``keeps`` and ``tells`` are what scenes change."""

    def __init__(self, stage: Stage, cast: Cast, node: int) -> None:
        self.stage, self.cast, self.node = stage, cast, node
        self.site = car_park(stage.site)
        self.track, self.index = stage.site.machines[node].home.track, 1
        self.phase, self.ride = Phase.FREE, RideAhead(0, 0, 0)
        self.platform_key = TokenKey(TokenKind.SEGMENT, platform(self.track).number)
        self.gate_key = TokenKey(TokenKind.SEGMENT, gate(self.track).number)
        #: When the platform is where it goes, by the kit's clock.
        self.there_us: int | None = None
        #: When the last ride that is over began.
        self.made_ms: int | None = None
        #: The version of the gate under which a true word was said last.
        self.proved = -1
        #: Requests that it has refused and looks at again by itself (duty K10).
        self.asked: dict[TokenKey, TokenRequest] = {}
        #: Where the rides begin that it has bid for, by the numbers of the node's calls.
        self.called: dict[int, int] = {}
        #: Those of them that were held as options, and that were awarded.
        self.optioned: set[int] = set()
        self.awarded: set[int] = set()
        self.reset()
        stage.hearers.append(self.hear)

    def reset(self) -> None:
        """Refuse nothing, say where it stands and bid in time, from now on."""
        #: Tokens that it refuses though it could give them.
        self.keeps: set[TokenKey] = set()
        #: What it says instead of where it stands, while its gate is out.
        self.tells: Callable[[Progress], Progress | None] = as_said
        #: How much later than it is wanted it bids for a ride, ms; None: it says nothing.
        self.late_ms: int | None = 0

    # --- what it knows -------------------------------------------------------------------------------------------

    def has(self, key: TokenKey) -> bool:
        """Whether the node under test has its platform, or its gate."""
        return self.cast.holder(key)[0] == self.stage.node

    def is_on(self, at: Progress) -> bool:
        """Whether a place is that of its platform, at a floor or between two."""
        return at.track == self.track or self.site.platforms.get(Segment(at.track, at.index)) == self.track

    def is_aboard(self) -> bool:
        """Whether the node says that it stands on the platform."""
        place = self.stage.last(Progress)
        return place is not None and self.is_on(place.message) and not place.message.speed_mm_s

    def word(self) -> Progress:
        """Where it stands, under the version of its gate (duty L1)."""
        version = self.cast.holder(self.gate_key)[1]
        return Progress(self.node, *under_gate(version), self.track, self.index, 0, 0)

    def planned(self) -> RideAhead | None:
        """The node's next ride that is not made yet (duty L2)."""
        plan, place = self.cast.plans.get(self.stage.node), self.stage.last(Progress)
        if plan is None:
            return None
        done = 0
        if place is not None and place.message.itinerary_version == plan.version:
            done = place.message.leg
        begins = (plan.stamp.award_ms, *(leg.end_ms for leg in plan.legs))
        rides = [
            RideAhead(leg.from_index, leg.to_index, begin_ms)
            for leg, begin_ms in list(zip(plan.legs, begins, strict=False))[done:]
            if leg.action is LegAction.RIDE and leg.track == self.track
        ]
        return next((one for one in rides if self._is_ahead(one)), None)

    def _is_ahead(self, ride: RideAhead) -> bool:
        return self.made_ms is None or after_ms(ride.begin_ms, self.made_ms) > 0

    def _stands_at(self, stop: int) -> bool:
        return self.there_us is None and self.index == stop

    # --- what it does --------------------------------------------------------------------------------------------

    def answer(self, key: TokenKey, request: TokenRequest) -> Reason | None:
        """Duty L3, for its platform and its gate; any other token as the fleet does."""
        if key not in (self.platform_key, self.gate_key):
            return self.cast.answer(key, request)
        answer = self.cast.answer(key, request)
        if answer is Reason.NONE:
            answer = self._platform_for(key) if key == self.platform_key else self._gate_for(key)
        self.asked[key] = request
        if answer is Reason.NONE:
            del self.asked[key]
        return answer

    def _platform_for(self, key: TokenKey) -> Reason:
        ride = self.planned()
        if self.phase is not Phase.FREE or ride is None:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        if key in self.keeps or not self._stands_at(ride.board):
            return Reason.DOOR_NOT_READY
        self._is_in(Phase.BOARDING)
        self.ride = ride
        return Reason.NONE

    def _gate_for(self, key: TokenKey) -> Reason:
        if not self.has(self.platform_key):
            return Reason.TOKEN_NOT_GRANTABLE_YET
        stop = {Phase.BOARDING: self.ride.board, Phase.LEAVING: self.ride.leave}.get(self.phase, 0)
        return Reason.NONE if key not in self.keeps and self._stands_at(stop) else Reason.DOOR_NOT_READY

    def gave(self, key: TokenKey) -> None:
        """Duty L4: once under each version by which the gate is out."""
        if key == self.gate_key:
            self.tell()

    def tell(self) -> None:
        """Say where it stands, as the scene has it; nothing while it moves."""
        if self.there_us is not None:
            return
        said = self.tells(self.word()) if self.has(self.gate_key) else self.word()
        if said is not None:
            self.stage.say(said)
            if said == self.word():
                self.proved = self.cast.holder(self.gate_key)[1]

    def hear(self, word: Word) -> None:
        """What the node says; what it gives back the fleet has taken already."""
        message = word.message
        if isinstance(message, TokenGrant) and message.holder == self.node:
            self._has_back(TokenKey(message.token_kind, message.token))
        elif isinstance(message, Itinerary) and message.grade is Grade.FIRM:
            self._look()
        elif isinstance(message, CallForProposals) and message.operation is Operation.RIDE:
            self._bid(message)
        elif isinstance(message, Award) and message.winner == self.node and message.result is CallResult.OPTION:
            self.optioned.add(message.call)
        elif isinstance(message, Award) and message.winner == self.node and message.result is CallResult.AWARDED:
            self.awarded.add(message.call)
            begins = self.called.get(message.call, 0)
            self.stage.say(TaskReport(self.node, message.task, TaskPhase.AWARDED, begins, Reason.NONE))

    def _bid(self, call: CallForProposals) -> None:
        """Duty L2: when the ride will be over that is called for."""
        doors = [door.number for door in self.site.tracks[self.track].joins]
        if self.late_ms is None or not {call.from_station, call.to_station} <= set(doors):
            return
        stops = doors.index(call.from_station) + 1, doors.index(call.to_station) + 1
        cost = call.deadline_ms + call.ready_ms + ride_us(self.site, self.track, *stops) // MS + self.late_ms
        self.called[call.call] = call.from_station
        self.stage.say(Bid(self.node, call.sender, call.call, cost % 2**32, 0))

    def _has_back(self, key: TokenKey) -> None:
        is_free = not self.has(self.platform_key) and not self.has(self.gate_key)
        if self.phase is Phase.BOARDING and key == self.gate_key and self.is_aboard():
            self._is_in(Phase.RIDING)
            self._drive(self._leaves_at())
        elif self.phase is Phase.BOARDING and is_free:
            self._is_in(Phase.FREE)
            self.look_again()
        elif self.phase is Phase.LEAVING and is_free:
            self.made_ms = self.ride.begin_ms
            self._is_in(Phase.FREE)
            self._look()

    def _leaves_at(self) -> int:
        """Where who is aboard wants to by its newest plan."""
        ride = self.planned()
        if ride is not None and ride.board == self.ride.board:
            self.ride = ride
        return self.ride.leave

    def _look(self) -> None:
        """Go to where the next ride begins."""
        ride = self.planned()
        if self.phase is Phase.FREE and self.there_us is None and ride is not None and ride.board != self.index:
            self._drive(ride.board)

    def _drive(self, stop: int) -> None:
        lasts_us = rise_us(self.site, self.track, self.index, stop) + _PLAY_US
        self.index, self.there_us = stop, self.stage.now_us + lasts_us
        self.stage.rides.append(PlatformRun(self.node, stop, lasts_us))

    def _is_in(self, phase: Phase) -> None:
        self.phase = phase
        self.cast.parts[self.node].state = MachineState.IDLE if phase is Phase.FREE else MachineState.WORKING

    def look_again(self) -> None:
        """Grant what was asked for and can be granted now: the platform before the gate (duty K10)."""
        for key in (self.platform_key, self.gate_key):
            request = self.asked.get(key)
            if request is not None and self.cast.is_on and self.answer(key, request) is Reason.NONE:
                self.cast.grant(key, request.sender)

    def next_us(self) -> int | None:
        """When its platform has come to where it goes."""
        return self.there_us

    def wake(self) -> None:
        """It has come there, and says so (duty P10)."""
        if self.there_us is None or self.there_us > self.stage.now_us:
            return
        self.there_us = None
        if self.phase is Phase.RIDING:
            self._is_in(Phase.LEAVING)
        self.tell()
        self.look_again()
        self._look()


def platform_of(cast: Cast) -> Platform:
    """That of the lift that the kit plays; for scenes that need one."""
    found = cast.doubles[cast.stage.lift]
    assert isinstance(found, Platform)
    return found


def watch(stage: Stage, cast: Cast) -> None:
    """Have each lift of the site move from now on."""
    if stage.lift:
        cast.doubles[stage.lift] = Platform(stage, cast, stage.lift)
