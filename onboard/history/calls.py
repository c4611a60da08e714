"""Every call of a bus: who called, who bid what and when, who won, what was promised and when it came true."""

from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Criterion, Grade, Operation, Reason, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Itinerary,
    Progress,
    Reference,
    TaskReport,
)
from onboard.core.serial import ms_after
from onboard.core.site import Station
from onboard.history.bounds import drop_oldest
from onboard.history.clock import LoggedBusTime

#: Calls of the first depth that are no customer's: for a part of a task, and for room.
_NO_TASKS = (Operation.RIDE, Operation.GIVE_WAY)


def is_task(call: CallForProposals) -> bool:
    """Whether a call is for a whole task, which ends when its owner reports it done."""
    return call.depth == 0 and call.operation not in _NO_TASKS


@dataclass(slots=True)
class CallHistory:
    """One call; times in us of the log. ``finished_us`` None: not yet, or the fleet bus does not tell."""

    terms: CallForProposals
    opened_us: int
    #: When, who, and the cost in the unit of the call's criterion.
    bids: list[tuple[int, int, int]] = field(default_factory=list)
    closed_us: int | None = None
    #: By the last award: an option is one too.
    result: CallResult | None = None
    reason: Reason = Reason.NONE
    winner: int = 0
    #: The first award that was more than an option: with it the call is over for whoever listens.
    end: Award | None = None
    promised_us: int | None = None
    finished_us: int | None = None
    messages: int = 1
    awards: int = 0
    #: Of a ride: whether the caller has been on the platform where it begins.
    is_aboard: bool = False
    #: Machines that started anew while the call or what it awarded was going on.
    restarts: list[tuple[int, int]] = field(default_factory=list)

    @property
    def is_over(self) -> bool:
        """Whether nothing more is to come of it."""
        if self.result is None:
            return False
        return self.finished_us is not None or self.result is not CallResult.AWARDED

    def cost_of(self, node: int) -> int | None:
        """The last bid of a machine; None where it made none."""
        return next((cost for _, who, cost in reversed(self.bids) if who == node), None)


@dataclass(frozen=True, slots=True)
class CallOpened:
    """A call is heard for the first time."""

    call: CallHistory


@dataclass(frozen=True, slots=True)
class CallRepeated:
    """A call is said again."""

    call: CallHistory


@dataclass(frozen=True, slots=True)
class BidMade:
    """A bid; ``call`` None where its call was not heard."""

    call: CallHistory | None
    bid: Bid


@dataclass(frozen=True, slots=True)
class CallAnswered:
    """The initiator's word on a call; ``call`` None where that was not heard.

    ``is_end``: the first one on it that is more than an option.
    """

    call: CallHistory | None
    award: Award
    is_end: bool

    @property
    def is_withdrawal(self) -> bool:
        """Whether the caller of a task wants it no more, in whatever call that was."""
        return self.award.result is CallResult.WITHDRAWN and self.award.sender == self.award.task.origin


CallFact = CallOpened | CallRepeated | BidMade | CallAnswered


class Calls:
    """A fold over what was said of calls, in the order of the log. ``most`` calls are kept, None for all."""

    def __init__(self, most: int | None, clock: LoggedBusTime) -> None:
        #: The newest of each number of each caller.
        self.by_key: dict[tuple[int, int], CallHistory] = {}
        #: All of them where ``most`` is None.
        self.all: list[CallHistory] = []
        self._most = most
        self._going: list[CallHistory] = []
        self._clock = clock
        #: Whose tentative itinerary of which version goes with which call's bid.
        self._offers: dict[tuple[int, int], CallHistory] = {}

    def finish(self, task: Reference, time_us: int) -> None:
        """A task is done, where no report tells it."""
        for call in self._going:
            if call.terms.task == task and is_task(call.terms) and not call.is_over:
                call.finished_us = time_us

    def moment_us(self, bus_ms: int, near_us: int) -> int | None:
        """Time of the log of a bus time in ms, which wraps; None before bus time was heard."""
        offset_us = self._clock.offset_us
        if offset_us is None:
            return None
        return near_us + 1000 * ms_after(bus_ms, (near_us - offset_us) // 1000)

    def on_call(self, terms: CallForProposals, time_us: int) -> CallOpened | CallRepeated:
        """A call, for the first time or again."""
        key = (terms.sender, terms.call)
        known = self.by_key.get(key)
        if known is not None and known.terms == terms:
            known.messages += 1
            return CallRepeated(known)
        call = CallHistory(terms, time_us)
        self.by_key[key] = call
        if self._most is None:
            self.all.append(call)
        elif (dropped := drop_oldest(self.by_key, self._most, lambda one: one.end is not None)) is not None:
            self._offers = {offer: one for offer, one in self._offers.items() if one is not dropped}
        self._going = [one for one in self._going if not one.is_over]
        self._going.append(call)
        return CallOpened(call)

    def on_bid(self, bid: Bid, time_us: int) -> BidMade:
        """A bid, whether its call was heard or not."""
        call = self.by_key.get((bid.initiator, bid.call))
        if call is not None:
            call.messages += 1
            call.bids.append((time_us, bid.sender, bid.cost))
            if bid.itinerary_version:
                self._offers[bid.sender, bid.itinerary_version] = call
        return BidMade(call, bid)

    def on_award(self, award: Award, time_us: int) -> CallAnswered:
        """An award, whether its call was heard or not."""
        call = self.by_key.get((award.sender, award.call))
        if call is None:
            return CallAnswered(None, award, is_end=False)
        call.messages += 1
        call.awards += 1
        is_end = call.end is None and award.result is not CallResult.OPTION
        if is_end:
            call.end = award
        if call.result is None or (call.result, call.winner) != (award.result, award.winner):
            call.closed_us, call.result, call.reason, call.winner = time_us, award.result, award.reason, award.winner
            cost = call.cost_of(award.winner)
            if cost is not None and call.terms.criterion is Criterion.FINISH_TIME:
                call.promised_us = self.moment_us(cost, time_us)
        return CallAnswered(call, award, is_end)

    def on_itinerary(self, itinerary: Itinerary) -> None:
        """A plan goes with the bid that offers it, or with the award that it follows."""
        if itinerary.grade is Grade.FIRM:
            call = next((one for one in self._going if _is_stamped(one, itinerary)), None)
        else:
            call = self._offers.get((itinerary.sender, itinerary.version))
        if call is not None:
            call.messages += 1

    def on_report(self, report: TaskReport, time_us: int) -> None:
        """The winner's word on what it has won."""
        for call in self._going:
            if call.terms.task == report.task and call.winner == report.sender and not call.is_over:
                call.messages += 1
                if is_task(call.terms) and report.phase is TaskPhase.DONE:
                    call.finished_us = time_us

    def on_progress(self, progress: Progress, time_us: int) -> None:
        """A ride is over when the caller says, on the platform, that it is at the floor that it asked for."""
        for call in self._going:
            terms = call.terms
            if terms.operation is not Operation.RIDE or terms.sender != progress.sender or call.is_over:
                continue
            if (progress.track, progress.index) == _platform(terms.from_station):
                call.is_aboard = True
            elif call.is_aboard and (progress.track, progress.index) == _platform(terms.to_station):
                call.finished_us = time_us

    def on_restart(self, node: int, time_us: int) -> None:
        """A machine has started anew, in the middle of what is going on."""
        for call in self._going:
            if not call.is_over and node in (call.terms.sender, call.winner):
                call.restarts.append((time_us, node))


def _platform(number: int) -> tuple[int, int]:
    """Track and index of the platform beside a ride's station, the alley's first or last segment."""
    station = Station.from_number(number)
    return station.track, 0 if station.index == 1 else station.index + 1


def _is_stamped(call: CallHistory, itinerary: Itinerary) -> bool:
    stamp = itinerary.stamp
    same = (stamp.initiator, stamp.call) == (call.terms.sender, call.terms.call & 0xFF)
    return same and itinerary.sender == call.winner and not call.is_over
