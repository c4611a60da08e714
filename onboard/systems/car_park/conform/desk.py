"""What a compartment of the kit's fleet calls for, and what its calls must be answered with."""

from collections.abc import Generator
from dataclasses import dataclass, field, replace
from math import ceil, sqrt
from typing import Any

from onboard.conform.cast import Cast
from onboard.conform.stage import SECOND, Stage, Wait, Word, after_ms
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Award, Bid, CallForProposals, CarAt, Reference
from onboard.core.site import Segment, Station
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.shafts import platform, platform_at, stop_at, stop_mm
from onboard.systems.car_park.site import CarPark, car_park

#: Duty B3: the task begins so long after the deadline; what a handling takes beside strokes and grip; the bay is ready
#: so long after the call was opened, and its door's time, us.
_AWARDED_US, _SETTLES_US, _DRIVER_US = 150_000, 400_000, 9_500_000
#: Duty P4: what a ride takes for gate and sill, us.
_GATE_US = 400_000
#: Duty B4: a slot is 480 bit times and this, us.
_SLOT_US = 500


def _run_us(way_mm: int, speed: int, acceleration: int) -> int:
    """Duty P4: from rest to rest, in whole ms."""
    if way_mm * acceleration >= speed * speed:
        seconds = way_mm / speed + speed / acceleration
    else:
        seconds = 2 * sqrt(way_mm / acceleration)
    return ceil(round(seconds * 1e6) / 1000) * 1000


def rise_us(site: CarPark, lift: int, board: int, leave: int) -> int:
    """Duty P4: the run of a lift's platform from stop to stop, us; ``lift`` is the number of its track."""
    height_mm = abs(stop_mm(site, lift, leave) - stop_mm(site, lift, board))
    return _run_us(height_mm, site.lift.speed_mm_s, site.lift.acceleration_mm_s2)


def ride_us(site: CarPark, lift: int, board: int, leave: int) -> int:
    """Duty P4: a ride from stop to stop, with gate and sill, us."""
    return rise_us(site, lift, board, leave) + _GATE_US


@dataclass
class Desk:
    """The calls of one play. Numbers go on from scene to scene."""

    stage: Stage
    cast: Cast
    number: int = 0x0100
    tasks: int = 0
    site: CarPark = field(init=False)
    car: Reference = field(init=False)

    def __post_init__(self) -> None:
        self.site = car_park(self.stage.site)
        self.car = Reference(self.stage.caller, 1)

    @property
    def bay(self) -> Station:
        """The station of the first compartment."""
        return self.site.compartments[self.stage.caller]

    @property
    def car_key(self) -> TokenKey:
        """The token of the car."""
        return TokenKey(TokenKind.CAR, self.car.origin << 16 | self.car.number)

    def segment_at(self, track: int, index: int) -> Segment:
        """The segment that a position is in: beyond a linked end it is the mouth, beyond a sill a lift's platform."""
        lift = track if track in self.site.lifts else self.site.platforms.get(Segment(track, index))
        if lift is not None:
            return platform(lift)
        return self.site.mouths.get(Segment(track, index), Segment(track, index))

    def segment_key(self, track: int, index: int) -> TokenKey:
        """The token of the segment that a position is in, so of the mouth for one beyond a linked end."""
        return TokenKey(TokenKind.SEGMENT, self.segment_at(track, index).number)

    @property
    def wheelbase_mm(self) -> int:
        """That of the car, rounded down as it travels."""
        return self.stage.means.wheelbase_mm // 10 * 10

    def place_car(self) -> None:
        """The compartment says that the car stands in its bay, once (duty Q1)."""
        if self.car not in self.cast.cars:
            at = CarAt(self.stage.caller, self.car, self.bay.number, 1, self.wheelbase_mm)
            self.cast.cars[self.car] = at
            self.stage.say(at)

    def call(self, **changes: Any) -> CallForProposals:
        """A call to park the car, under numbers of its own; ``changes`` are fields of it that are otherwise."""
        self.number += 1
        self.tasks += 1
        made = CallForProposals(
            sender=self.stage.caller,
            call=self.number,
            task=Reference(self.stage.caller, self.tasks),
            operation=Operation.PARK,
            kind=KindCode.ROBOT,
            criterion=Criterion.FINISH_TIME,
            attempt=1,
            depth=0,
            deadline_ms=self.stage.bus_ms(self.stage.bus_us + self.site.timing.call_window_us),
            from_station=self.bay.number,
            to_station=ANY_STATION,
            car=self.car,
            wheelbase_mm=self.wheelbase_mm,
        )
        return replace(made, **changes)

    def award(self, of: CallForProposals, winner: int, result: CallResult = CallResult.AWARDED, **changes: Any) -> None:
        """The initiator closes a call."""
        said = Award(of.sender, of.call, winner, of.task, 1, result, Reason.NONE)
        self.stage.say(replace(said, **changes))

    def withdraw(self, call: CallForProposals) -> None:
        """Nobody wants it done any more."""
        self.award(call, 0, CallResult.WITHDRAWN)

    def bid_of(self, call: CallForProposals, since_us: int) -> Word | None:
        """What the node under test bid for a call."""
        key = (call.sender, call.call)
        words = self.stage.since(Bid, since_us)
        return next((one for one in words if (one.message.initiator, one.message.call) == key), None)

    def asks(self, call: CallForProposals, *others: Bid, withdraws: bool = True) -> Generator[Wait, None, Word | None]:
        """Open a call, let others bid 2 ms after it, and wait for the deadline: the node's bid, None for silence."""
        begin_us = self.stage.now_us
        self.stage.say(call)
        if others:
            yield from self.stage.pause(0.002)
            self.stage.say(*others)
        yield Wait(begin_us + self.site.timing.call_window_us + 20_000)
        bid = self.bid_of(call, begin_us)
        if withdraws:
            self.withdraw(call)
            yield from self.stage.pause(0.4)
        return bid

    def wins(self, **changes: Any) -> Generator[Wait, None, tuple[CallForProposals, Word | None]]:
        """Open a call and award it to the node under test, where it bids; ``changes`` are those of the call."""
        call = self.call(**changes)
        bid = yield from self.asks(call, withdraws=False)
        if bid is None:
            self.withdraw(call)
        else:
            self.award(call, self.stage.node)
        return call, bid

    def wins_back(self, place: int) -> Generator[Wait, None, tuple[CallForProposals, Word | None]]:
        """The same for the car to be fetched from where it stands."""
        return (yield from self.wins(operation=Operation.RETRIEVE, from_station=place, to_station=self.bay.number))

    # --- figures -------------------------------------------------------------------------------------------------

    def handling_us(self, station: Station) -> int:
        """Duty B3: reach, grip or release, retract; at a compartment its door too."""
        site = self.site
        stroke_us = _run_us(site.shuttle_reach_mm, site.shuttle.speed_mm_s, site.shuttle.acceleration_mm_s2)
        door_us = site.timing.door_us if station in site.compartments.values() else 0
        return 2 * stroke_us + site.timing.grip_us + _SETTLES_US + door_us

    def run_us(self, begin: int, end: int) -> int:
        """A run along the alley from index to index."""
        return self.run_from_us(begin, 0, end)

    def run_from_us(self, begin: int, offset_mm: int, end: int) -> int:
        """A run along the alley from so far behind the mark of an index to that of another."""
        axis, pitch_mm = self.site.carrier, self.site.tracks[self.bay.track].pitch_mm
        way_mm = abs((end - begin) * pitch_mm - offset_mm)
        return _run_us(way_mm, axis.speed_mm_s, axis.acceleration_mm_s2)

    def floor_over_ms(self) -> int:
        """Duty B3: the floor of a call to park, in ms after its deadline."""
        window_us = self.site.timing.call_window_us
        ready_us = max(_AWARDED_US, _DRIVER_US + self.site.timing.door_us - window_us)
        at_bay_us = ready_us + self.handling_us(self.bay)
        ends = (self._way_us(place) + self.handling_us(place) for place in self.site.places)
        return -(-(at_bay_us + min(ends)) // 1000)

    def _way_us(self, place: Station) -> int:
        """From the bay to before a place with all ways free: along its alley, or onto a lift, up and off it."""
        if place.track == self.bay.track:
            return self.run_us(self.bay.index, place.index)
        found = []
        for lift in self.site.lifts:
            board, leave = (stop_at(self.site, lift, one.track) for one in (self.bay, place))
            near, far = (platform_at(self.site, lift, one.track) for one in (self.bay, place))
            if board is not None and leave is not None and near is not None and far is not None:
                runs_us = self.run_us(self.bay.index, near.index) + self.run_us(far.index, place.index)
                found.append(runs_us + ride_us(self.site, lift, board, leave))
        return min(found, default=1 << 62)

    def approach_us(self) -> int:
        """To the bay from where a robot may rest at the farthest."""
        along_us = self.run_us(1, self.site.tracks[self.bay.track].length)
        return along_us + sum(along_us + ride_us(self.site, lift, 1, 2) for lift in self.site.lifts)

    def over_ms(self, call: CallForProposals, bid: Word) -> int:
        """A bid's cost in ms after the deadline of its call."""
        cost: int = bid.message.cost
        return after_ms(cost, call.deadline_ms)

    def delay_us(self, above_us: int) -> int:
        """Duty B4: how long a cost above the floor waits, moved to the node's slot."""
        timing, nodes = self.site.timing, sorted(self.site.machines)
        slot_us = 480 * SECOND // self.site.bitrate + _SLOT_US
        most_us = timing.bid_delay_us * max(0, above_us) // max(1, max(0, above_us) + timing.bid_half_us)
        round_us = slot_us * len(nodes)
        return most_us // round_us * round_us + nodes.index(self.stage.node) * slot_us
