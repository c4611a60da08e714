"""Every call of a log: who called, who bid what and when, who won, what was promised and when it came true."""

from dataclasses import dataclass, field

from onboard.core.codes import CallResult, Grade, Operation, Reason, TaskPhase
from onboard.core.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    Heartbeat,
    Itinerary,
    Message,
    Progress,
    Reference,
    TaskReport,
)
from onboard.core.serial import ms_after
from onboard.core.site import Station
from onboard.trace.words import Words

#: Calls of the first depth that are no customer's: for a part of a task, and for room.
_NO_TASKS = (Operation.RIDE, Operation.GIVE_WAY)


def is_task(call: CallForProposals) -> bool:
    """Whether a call is for a whole task, which ends when its owner reports it done."""
    return call.depth == 0 and call.operation not in _NO_TASKS


@dataclass
class Call:
    """One call; times in us of the log. ``finished_us`` None: not yet, or the fleet bus does not tell."""

    terms: CallForProposals
    opened_us: int
    #: When, who, and the cost in the unit of the call's criterion.
    bids: list[tuple[int, int, int]] = field(default_factory=list)
    closed_us: int | None = None
    result: CallResult | None = None
    reason: Reason = Reason.NONE
    winner: int = 0
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


class Calls:
    """A fold over the fleet bus: feed every message in the order of the log."""

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self._by_key: dict[tuple[int, int], Call] = {}
        self._going: list[Call] = []
        self._boots: dict[int, int] = {}
        self._offset_us: int | None = None
        #: Whose tentative itinerary of which version goes with which call's bid.
        self._offers: dict[tuple[int, int], Call] = {}

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message."""
        match message:
            case BusTime():
                self._offset_us = time_us - message.bus_time_us
            case CallForProposals():
                self._on_call(message, time_us)
            case Bid():
                self._on_bid(message, time_us)
            case Award():
                self._on_award(message, time_us)
            case Itinerary():
                self._on_itinerary(message)
            case TaskReport():
                self._on_report(message, time_us)
            case Progress():
                self._on_progress(message, time_us)
            case Heartbeat():
                self._on_heartbeat(message, time_us)

    def moment_us(self, bus_ms: int, near_us: int) -> int | None:
        """Time of the log of a bus time in ms, which wraps; None before bus time was heard."""
        if self._offset_us is None:
            return None
        return near_us + 1000 * ms_after(bus_ms, (near_us - self._offset_us) // 1000)

    def _on_call(self, terms: CallForProposals, time_us: int) -> None:
        key = (terms.sender, terms.call)
        known = self._by_key.get(key)
        if known is not None and known.terms == terms:
            known.messages += 1
            return
        call = Call(terms, time_us)
        self._by_key[key] = call
        self.calls.append(call)
        self._going = [one for one in self._going if not one.is_over]
        self._going.append(call)

    def _on_bid(self, bid: Bid, time_us: int) -> None:
        call = self._by_key.get((bid.initiator, bid.call))
        if call is not None:
            call.messages += 1
            call.bids.append((time_us, bid.sender, bid.cost))
            if bid.itinerary_version:
                self._offers[bid.sender, bid.itinerary_version] = call

    def _on_award(self, award: Award, time_us: int) -> None:
        call = self._by_key.get((award.sender, award.call))
        if call is None:
            return
        call.messages += 1
        call.awards += 1
        if call.result is not None and (call.result, call.winner) == (award.result, award.winner):
            return
        call.closed_us, call.result, call.reason, call.winner = time_us, award.result, award.reason, award.winner
        cost = next((cost for _, node, cost in reversed(call.bids) if node == award.winner), None)
        if cost is not None and call.terms.criterion.name == "FINISH_TIME":
            call.promised_us = self.moment_us(cost, time_us)

    def _on_itinerary(self, itinerary: Itinerary) -> None:
        if itinerary.grade is Grade.FIRM:
            call = next((one for one in self._going if _is_stamped(one, itinerary)), None)
        else:
            call = self._offers.get((itinerary.sender, itinerary.version))
        if call is not None:
            call.messages += 1

    def _on_report(self, report: TaskReport, time_us: int) -> None:
        for call in self._going:
            if call.terms.task == report.task and call.winner == report.sender and not call.is_over:
                call.messages += 1
                if is_task(call.terms) and report.phase is TaskPhase.DONE:
                    call.finished_us = time_us

    def _on_progress(self, progress: Progress, time_us: int) -> None:
        """A ride is over when the caller says, on the platform, that it is at the floor that it asked for."""
        for call in self._going:
            terms = call.terms
            if terms.operation is not Operation.RIDE or terms.sender != progress.sender or call.is_over:
                continue
            if (progress.track, progress.index) == _platform(terms.from_station):
                call.is_aboard = True
            elif call.is_aboard and (progress.track, progress.index) == _platform(terms.to_station):
                call.finished_us = time_us

    def _on_heartbeat(self, beat: Heartbeat, time_us: int) -> None:
        before = self._boots.get(beat.sender)
        self._boots[beat.sender] = beat.boot
        if before is None or before == beat.boot:
            return
        for call in self._going:
            if not call.is_over and beat.sender in (call.terms.sender, call.winner):
                call.restarts.append((time_us, beat.sender))


def _platform(number: int) -> tuple[int, int]:
    """Track and index of the platform beside a ride's station, the alley's first or last segment."""
    station = Station.from_number(number)
    return station.track, 0 if station.index == 1 else station.index + 1


def _is_stamped(call: Call, itinerary: Itinerary) -> bool:
    stamp = itinerary.stamp
    same = (stamp.initiator, stamp.call) == (call.terms.sender, call.terms.call & 0xFF)
    return same and itinerary.sender == call.winner and not call.is_over


def told(call: Call, words: Words, start_us: int) -> list[str]:
    """The lines of one call; times since the log's start, promises beside what came true."""
    terms = call.terms
    names = words.system
    way = names.way(terms)
    parent = "" if not terms.depth else f", part {terms.part} of call {words.reference(Reference(*terms.parent))}"
    again = f", attempt {terms.attempt}" if terms.attempt > 1 else ""
    lines = [
        f"{_at(call.opened_us, start_us)} {words.machine(terms.sender)} call {terms.call}: "
        f"{names.operation(terms.operation)} {names.thing(terms.car)}, task {words.reference(terms.task)}"
        f"{way and f', {way}'}{parent}{again}; {call.messages} messages"
    ]
    for time_us, node, cost in call.bids:
        lines.append(
            f"    {_at(time_us, start_us)} {words.machine(node)} bids {words.cost(cost, terms.criterion)}"
            f" ({(time_us - call.opened_us) / 1000:.1f} ms after the call)"
        )
    lines.append(f"    {_ending(call, words, start_us)}")
    lines += [f"    {_at(time_us, start_us)} {words.machine(node)} started anew" for time_us, node in call.restarts]
    return lines


def _ending(call: Call, words: Words, start_us: int) -> str:
    if call.result is None or call.closed_us is None:
        return "still open at the end of the log"
    reason = f": {words.system.reason(call.reason)}" if call.reason is not Reason.NONE else ""
    text = f"{_at(call.closed_us, start_us)} {call.result.name.lower()}{reason}"
    if not call.winner:
        return text
    text += f" to {words.machine(call.winner)}"
    if call.awards > 1:
        text += f" (said {call.awards} times)"
    if call.promised_us is not None:
        text += f"; promised {_at(call.promised_us, start_us)}"
    if call.finished_us is None:
        return text + (
            "; finish not in this log" if is_task(call.terms) or call.terms.operation is Operation.RIDE else ""
        )
    text += f", finished {_at(call.finished_us, start_us)}"
    if call.promised_us is not None:
        text += f" ({(call.finished_us - call.promised_us) / 1e6:+.3f} s)"
    return text


def _at(time_us: int, start_us: int) -> str:
    return f"{(time_us - start_us) / 1e6:.3f} s"
