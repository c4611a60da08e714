"""Two calls at a time, and a car that is in the way of another: chapters 4 and 10 of docs/protocol.md."""

from collections.abc import Generator

from onboard.conform.cast import Cast, grants, silent
from onboard.conform.checks import Check
from onboard.conform.player import Scene
from onboard.conform.stage import SECOND, Play, Stage, Wait, Word, after_ms
from onboard.contract.codes import CallResult, Grade, LegAction, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import Bid, CallForProposals, CarAt, Itinerary, Reference, TaskReport
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park.conform.desk import Desk

_BEHIND = "With my bid I keep what it rests on (my time, my place): my bids for other calls come behind it."
_FREE = "It is free again when a better bid is heard, when the call closes for another or nobody"
#: Costs that differ by no more are alike, ms.
_ALIKE_MS = 1_500

TWO = (
    Check("second-bid-comes-behind-the-first", "B7", _BEHIND),
    Check("withdrawn-call-frees-its-time", "B7", _FREE),
    Check("refused-call-frees-its-time", "B7", _FREE),
    Check("beaten-bid-frees-its-time", "B7", _FREE),
    Check("bid-comes-behind-what-is-won", "B10", "I have bid, or won, elsewhere meanwhile"),
    Check("two-tasks-are-one-plan", "P1", "A robot has one firm itinerary"),
    Check("two-tasks-keep-their-bids", "B2", "What it promises it keeps as well as it can"),
    Check("one-of-two-is-taken-back", "U6", "It is dropped, and its plan is told anew."),
    Check("task-taken-back-frees-its-time", "U6", "It is dropped, and its plan is told anew."),
)


class _Pair:
    """The first compartment's car, and one in the bay of the other, for which calls come meanwhile."""

    def __init__(self, stage: Stage, cast: Cast, desk: Desk) -> None:
        self.stage, self.cast, self.desk = stage, cast, desk
        self.bay, self.car = desk.site.compartments[stage.other], Reference(stage.other, 1)
        self.alone_ms = 0

    def comes(self) -> None:
        """The second car is told of."""
        self._is_at(self.bay.number, 1)

    def leaves(self) -> None:
        """Its driver has taken it (duty Q6)."""
        self._is_at(OUTSIDE, 2)

    def _is_at(self, station: int, version: int) -> None:
        self.cast.cars[self.car] = CarAt(self.stage.other, self.car, station, version, self.desk.wheelbase_mm)
        self.stage.say(self.cast.cars[self.car])

    def call(self) -> CallForProposals:
        """The second compartment's call."""
        return self.desk.call(sender=self.stage.other, from_station=self.bay.number, car=self.car)

    def asks(self) -> Generator[Wait, None, tuple[int, Word | None]]:
        """What the node asks for the second car, in ms behind the deadline, -1 for silence."""
        call = self.call()
        bid = yield from self.desk.asks(call)
        return (-1 if bid is None else self.desk.over_ms(call, bid)), bid

    def judge_free(self, name: str) -> Play:
        """It costs what it costs an idle robot."""
        over_ms, bid = yield from self.asks()
        is_free = 0 <= over_ms <= self.alone_ms + _ALIKE_MS
        self.stage.judge(name, is_free, f"{over_ms} ms, alone {self.alone_ms} ms", bid)


def two(stage: Stage, cast: Cast) -> Play:
    """Another call comes while the node has bid, has been let go or beaten, and has won."""
    desk = Desk(stage, cast, 0x1700, 2_200)
    desk.place_car()
    cast.answer = silent
    pair = _Pair(stage, cast, desk)
    pair.comes()
    yield from stage.pause(1.0)
    pair.alone_ms, bid = yield from pair.asks()
    if bid is None:
        pair.leaves()
        return
    for name, result in (
        ("withdrawn-call-frees-its-time", CallResult.WITHDRAWN),
        ("refused-call-frees-its-time", CallResult.REFUSED),
    ):
        begin_us, call = stage.now_us, desk.call()
        stage.say(call)
        yield from stage.pause(0.8 if stage.lift else 0.35)
        first = desk.bid_of(call, begin_us)
        if first is not None and result is CallResult.WITHDRAWN:
            over_ms, bid = yield from pair.asks()
            least_ms = desk.over_ms(call, first) + desk.handling_us(pair.bay) // 1000
            is_behind = over_ms < 0 or over_ms >= least_ms
            stage.judge("second-bid-comes-behind-the-first", is_behind, f"not behind {least_ms} ms", first, bid)
        desk.award(call, 0, result)
        yield from stage.pause(0.1)
        yield from pair.judge_free(name)
    call = desk.call()
    stage.say(call)
    yield from stage.pause(0.002)
    cost = (call.deadline_ms + desk.floor_over_ms() - 300) % 2**32
    stage.say(Bid(stage.other, call.sender, call.call, cost, 0))
    yield from stage.pause(0.3)
    yield from pair.judge_free("beaten-bid-frees-its-time")
    desk.withdraw(call)
    yield from stage.pause(1.0)
    yield from _won(stage, desk, pair)
    pair.leaves()
    yield from stage.pause(3.0)


def _won(stage: Stage, desk: Desk, pair: _Pair) -> Play:
    """It wins the first call, then the second; the first is taken back, then the second."""
    call, bid = yield from desk.wins()
    if bid is None:
        return
    yield from stage.pause(1.0)
    second = pair.call()
    other = yield from desk.asks(second, withdraws=False)
    least_ms = bid.message.cost + desk.handling_us(pair.bay) // 1000
    is_behind = other is None or after_ms(other.message.cost, least_ms) >= 0
    stage.judge("bid-comes-behind-what-is-won", is_behind, "not behind what it has won", bid, other)
    if other is not None:
        begin_us = stage.now_us
        desk.award(second, stage.node)
        plan = yield from stage.hears(Itinerary, _is_firm, 3.0, begin_us)
        works = [] if plan is None else [leg for leg in plan.message.legs if leg.action is LegAction.WORK]
        at = [(leg.track, leg.to_index) for leg in works]
        are_both = desk.bay.segment in at and pair.bay.segment in at and len(works) >= 4
        stage.judge("two-tasks-are-one-plan", are_both, "not the work of both", plan)
        late_ms = after_ms(works[-1].end_ms, other.message.cost) if works else 1 << 31
        stage.judge("two-tasks-keep-their-bids", abs(late_ms) <= 1_000, f"{late_ms} ms later than bid", other, plan)
        begin_us = stage.now_us
        desk.withdraw(call)
        plan = yield from stage.hears(Itinerary, _is_firm, 3.0, begin_us + 1)
        works = [] if plan is None else [leg for leg in plan.message.legs if leg.action is LegAction.WORK]
        at = [(leg.track, leg.to_index) for leg in works]
        is_one = pair.bay.segment in at and desk.bay.segment not in at[:1]
        stage.judge("one-of-two-is-taken-back", is_one, "not the work of the second alone", plan)
        desk.withdraw(second)
    else:
        desk.withdraw(call)
    yield from stage.pause(2.0)
    yield from pair.judge_free("task-taken-back-frees-its-time")


def _is_firm(one: Itinerary) -> bool:
    return one.grade is Grade.FIRM


_ELSEWHERE = (
    "A robot that stands with a car before a bay in which another car is leaves its own at a free place after 10 s "
    "(where no robot plans to fetch that, 48 s and four times `door_ms`) and says DONE with that station"
)
OCCUPIED = (
    Check("waits-before-an-occupied-bay", "C7", _ELSEWHERE),
    Check("leaves-its-car-at-a-free-place", "C7", _ELSEWHERE),
    Check("says-where-it-left-it", "C7", _ELSEWHERE),
    Check("gives-the-car-to-that-places-keeper", "C3", "then the car's token and the station's go to the keeper."),
)


def occupied(stage: Stage, cast: Cast) -> Play:
    """It brings a car to the bay, and another is there."""
    desk = Desk(stage, cast, 0x1800, 2_300)
    at = cast.cars.get(desk.car)
    if at is None or at.station in (ANY_STATION, desk.bay.number):
        return
    call, bid = yield from desk.wins_back(at.station)
    if bid is None:
        return
    begin_us = stage.now_us
    aboard = yield from stage.hears(CarAt, lambda one: one.station == ANY_STATION, 90.0, begin_us)
    if aboard is None:
        desk.withdraw(call)
        return
    other = Reference(stage.caller, 2)
    cast.cars[other] = CarAt(stage.caller, other, desk.bay.number, 1, desk.wheelbase_mm)
    stage.say(cast.cars[other])
    bay = desk.bay.number
    cast.answer = lambda key, request: (
        Reason.DOOR_NOT_READY if key == (TokenKind.STATION, bay) else grants(key, request)
    )
    left = yield from stage.hears(CarAt, lambda one: one.car == desk.car and one.station != ANY_STATION, 180.0)
    places = {place.number for place in desk.site.places}
    is_free = left is not None and left.message.station in places
    stage.judge("leaves-its-car-at-a-free-place", is_free, "not left at a place within 3 minutes", aboard, left)
    if left is None:
        return
    waited_us = left.time_us - aboard.time_us
    stage.judge("waits-before-an-occupied-bay", waited_us >= 10 * SECOND, f"after {waited_us} us", aboard, left)
    done = yield from stage.hears(TaskReport, lambda one: one.phase is TaskPhase.DONE, 15.0, left.time_us)
    is_so = done is not None and done.message.station == left.message.station
    stage.judge("says-where-it-left-it", is_so, "not DONE with that station", left, done)
    yield from stage.pause(3.0)
    keeper = desk.site.stewards[left.message.station >> 8]
    key: TokenKey = desk.car_key
    stage.judge("gives-the-car-to-that-places-keeper", cast.holder(key)[0] == keeper, f"not to {keeper}", left)
    cast.cars[other] = CarAt(stage.caller, other, OUTSIDE, 2, desk.wheelbase_mm)
    stage.say(cast.cars[other])
    cast.answer = grants
    yield from stage.pause(40.0)


SCENES = (
    Scene("two calls at a time", TWO, two, needs_other=True),
    Scene("another car in the bay", OCCUPIED, occupied, needs_car=True),
)
