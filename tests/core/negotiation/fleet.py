"""A fleet on the smallest bus there is: messages one after the other, each heard by all others after a while.

Each message goes over the wire as the frames of ``dbc/fleet.dbc``, put together again by each machine for itself; what
a test looks at is decoded. ``Bus.lose`` may take a frame of a message from a single receiver, as an inconsistent
omission or a full receive queue does: the rest of it is inert. Time begins a second before bus time wraps on the wire,
so every run crosses the wrap.
"""

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from onboard.contract.codes import Criterion, Grade, KindCode, Operation, Reason
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, Message, Reference, Stamp
from onboard.core.effects import Effect, Report, Send
from onboard.core.negotiation import (
    Awarded,
    CallKey,
    Closed,
    Estimator,
    Negotiation,
    NegotiationEvent,
    PreAssigned,
    Proposal,
    Released,
    RequestedTerms,
    SpeakingSlot,
    SubCallAnswer,
)
from onboard.core.negotiation.bidding import ANY_TIME
from onboard.core.serial import BUS_MS_MODULUS
from onboard.core.site import Timing
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder

START_US = (BUS_MS_MODULUS - 1_000) * 1_000
CALLER = 1
#: Most events at one moment before the fleet counts as running away.
MAX_TURNS = 2_000
TIMING = Timing(
    call_window_us=1_000_000,
    bid_delay_us=300_000,
    bid_half_us=10_000_000,
    deadline_guard_us=20_000,
    max_attempts=5,
    award_repeat_us=100_000,
    token_repeat_us=200_000,
    heartbeat_us=2_000_000,
    bus_time_us=5_000_000,
    drive_refresh_us=200_000,
)


def terms(number: int = 1, **changes: int) -> RequestedTerms:
    """A call for a robot to park car ``number``; ``changes`` are whole numbers such as stations."""
    car = Reference(CALLER, number)
    values = {"from_station": 0x104, "to_station": 0xFFFF, "wheelbase_mm": 2_500} | changes
    station, goal, wheelbase_mm = values.pop("from_station"), values.pop("to_station"), values.pop("wheelbase_mm")
    assert not values, "only these three may be changed here"
    return RequestedTerms(
        car, Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, station, goal, load=car, load_mm=wheelbase_mm
    )


def a_call(call: int = 1, deadline_us: int = START_US + 1_000_000, **changes: object) -> CallForProposals:
    """A call as it is heard."""
    t = terms()
    values: dict[str, object] = {
        "sender": CALLER,
        "call": call,
        "task": t.task,
        "operation": t.operation,
        "kind": t.kind,
        "criterion": t.criterion,
        "attempt": 1,
        "depth": 0,
        "deadline_ms": deadline_us // 1_000 % BUS_MS_MODULUS,
        "from_station": t.from_station,
        "to_station": t.to_station,
        "car": t.load,
        "wheelbase_mm": t.load_mm,
    }
    return CallForProposals(**(values | changes))  # type: ignore[arg-type]  # each value has its field's type


@dataclass
class Costs:
    """A task-generation function that was told its answers: ms after the call's deadline, by task number.

    ``slack_ms`` is how far the bound lies below the cost. A cost of None cannot be found by searching; a task without
    an entry is one that the machine cannot do at all.
    """

    by_task: dict[int, int | None]
    slack_ms: int = 0
    with_itinerary: bool = False
    node: int = 0
    asked: list[str] = field(default_factory=list)

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Nobody is faster than the deadline itself."""
        self.asked.append("floor")
        return call.deadline_ms

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The cost less the slack."""
        self.asked.append("lower_bound")
        if call.task.number not in self.by_task:
            return None
        cost = self.by_task[call.task.number]
        return (call.deadline_ms + max(0, (cost or 0) - self.slack_ms)) % BUS_MS_MODULUS

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The cost."""
        self.asked.append("estimate")
        cost = self.by_task[call.task.number]
        if cost is None:
            return None
        stamp = Stamp(call.deadline_ms, call.sender, call.call & 0xFF)
        plan = Itinerary(self.node, 7, Grade.TENTATIVE, stamp, ()) if self.with_itinerary else None
        return Proposal((call.deadline_ms + cost) % BUS_MS_MODULUS, plan, (), ())


class Machine:
    """A node that keeps what the negotiation tells it, and announces a firm plan once it is awarded.

    It says its plan again every ``RESTATE_US``, as machines do that find their mirrors differ.
    """

    RESTATE_US = 1_000_000

    def __init__(
        self,
        node_id: int,
        costs: Estimator,
        *,
        kind: KindCode = KindCode.ROBOT,
        silent: bool = False,
        slot: SpeakingSlot = ANY_TIME,
    ) -> None:
        if isinstance(costs, Costs):
            costs.node = node_id
        self.node_id = node_id
        self.negotiation = Negotiation(node_id, kind, replace(TIMING, silent=silent), costs, slot=slot)
        self.committed: set[CallKey] = set()
        self.assigned: list[CallForProposals] = []
        self.parts: list[tuple[SubCallAnswer, ...]] = []
        self.released: list[Reason] = []
        self.closed: list[Closed] = []
        self.reports: list[str] = []
        self.heard: list[tuple[int, Message]] = []
        self._plans: dict[CallKey, Itinerary] = {}
        self._restate_us: int | None = None

    def receive(self, message: Message, now_us: int) -> list[Message]:
        """Hear one message; what is said in answer."""
        self.heard.append((now_us, message))
        return self.carry_out(self.negotiation.receive(message, now_us), now_us)

    def wake(self, now_us: int) -> list[Message]:
        """Do what is due."""
        said = self.carry_out(self.negotiation.wake(now_us), now_us)
        if self._restate_us is not None and self._restate_us <= now_us:
            self._restate_us = now_us + self.RESTATE_US
            said += self._plans.values()
        return said

    def next_wake(self) -> int | None:
        """When to wake it."""
        due = [time for time in (self.negotiation.next_wake(), self._restate_us) if time is not None]
        return min(due) if due else None

    def carry_out(self, outcome: list[Effect | NegotiationEvent], now_us: int) -> list[Message]:
        """Keep the events; hand on the messages."""
        said: list[Message] = []
        for item in outcome:
            match item:
                case Send(message):
                    said.append(message)
                case Report(text):
                    self.reports.append(text)
                case PreAssigned(call_key=key):
                    self.committed.add(key)
                case Released(call_key=key, reason=reason):
                    self.committed.remove(key)
                    self.released.append(reason)
                case Awarded(call_key=key, call=call, parts=parts):
                    self.committed.discard(key)
                    self.assigned.append(call)
                    self.parts.append(parts)
                    stamp = Stamp(call.deadline_ms, call.sender, call.call & 0xFF)
                    self._plans[key] = Itinerary(self.node_id, 8, Grade.FIRM, stamp, ())
                    self._restate_us = now_us + self.RESTATE_US
                    said.append(self._plans[key])
                case Closed():
                    self.closed.append(item)
        return said

    def call_for(self, what: RequestedTerms, now_us: int) -> list[Message]:
        """Open a call."""
        return self.carry_out(list(self.negotiation.open(what, now_us)), now_us)


#: (message, receiver) to whether this receiver misses a frame of it.
Loss = Callable[[Message, int], bool]


def decoded(message: Message) -> Message:
    """The message that whoever hears its frames puts together."""
    decoder = Decoder(fleet_codec())
    *unfinished, whole = [decoder.feed(frame, 0) for frame in fleet_codec().encode(message)]
    assert whole is not None and unfinished.count(None) == len(unfinished), f"{message} comes to nothing"
    return whole


def nothing_lost(message: Message, receiver: int) -> bool:
    """A perfect bus."""
    return False


class Bus:
    """Machines, and the messages between them in virtual time. ``wire`` holds all that was sent, with the time."""

    def __init__(self, machines: list[Machine], latency_us: int = 300, lose: Loss = nothing_lost) -> None:
        self.machines = {machine.node_id: machine for machine in machines}
        self.latency_us = latency_us
        self.lose = lose
        self.now_us = START_US
        self.wire: list[tuple[int, Message]] = []
        self._free_us = 0
        self._sequence = itertools.count()
        self._arrivals: list[tuple[int, int, Message]] = []
        self._decoders = {node: Decoder(fleet_codec()) for node in self.machines}
        self._losses = 0

    def post(self, messages: list[Message]) -> None:
        """Put messages on the bus; each takes the latency, one after the other."""
        for message in map(decoded, messages):
            self._free_us = max(self._free_us, self.now_us) + self.latency_us
            self.wire.append((self.now_us, message))
            heapq.heappush(self._arrivals, (self._free_us, next(self._sequence), message))

    def call(self, what: RequestedTerms, node: int = CALLER) -> None:
        """Let a machine open a call now."""
        self.post(self.machines[node].call_for(what, self.now_us))

    def run(self, seconds: float) -> None:
        """Go on for so long; arrivals before timers of the same moment, timers in order of node-ID."""
        end_us = self.now_us + round(seconds * 1e6)
        turns = 0
        while (due_us := self._next_us()) is not None and due_us <= end_us:
            turns = 0 if due_us > self.now_us else turns + 1
            assert turns < MAX_TURNS, "somebody asks to be woken again and again for something that is not done"
            self.now_us = max(self.now_us, due_us)
            if self._arrivals and self._arrivals[0][0] <= self.now_us:
                self._deliver(heapq.heappop(self._arrivals)[2])
                continue
            for machine in self.machines.values():
                wake_us = machine.next_wake()
                if wake_us is not None and wake_us <= self.now_us:
                    self.post(machine.wake(self.now_us))
        self.now_us = end_us

    def _next_us(self) -> int | None:
        times = [machine.next_wake() for machine in self.machines.values()]
        times += [arrival[0] for arrival in self._arrivals[:1]]
        return min((time for time in times if time is not None), default=None)

    def _deliver(self, message: Message) -> None:
        frames = fleet_codec().encode(message)
        for node, machine in self.machines.items():
            if node == message.sender:
                continue
            missed = self._miss(len(frames)) if self.lose(message, node) else None
            for number, frame in enumerate(frames):
                heard = self._decoders[node].feed(frame, self.now_us) if number != missed else None
                if heard is not None:
                    self.post(machine.receive(heard, self.now_us))

    def _miss(self, frames: int) -> int:
        """Which frame of a message is lost: each in turn."""
        self._losses += 1
        return self._losses % frames

    # --- what was said -----------------------------------------------------------------------------------------

    def bids(self) -> list[Bid]:
        """All bids in the order in which they were sent."""
        return [message for _, message in self.wire if isinstance(message, Bid)]

    def calls(self) -> list[CallForProposals]:
        """All calls."""
        return [message for _, message in self.wire if isinstance(message, CallForProposals)]

    def awards(self) -> list[Award]:
        """All awards."""
        return [message for _, message in self.wire if isinstance(message, Award)]

    def assigned(self, task: int = 1) -> list[int]:
        """The node-IDs of all machines that hold a task, once for each time they got it."""
        return [
            node for node, machine in self.machines.items() for call in machine.assigned if call.task.number == task
        ]


def caller(silent: bool = False) -> Machine:
    """The compartment that calls."""
    return Machine(CALLER, Costs({}), kind=KindCode.COMPARTMENT, silent=silent)


def fleet(costs: dict[int, int | None], *, slack_ms: int = 0, silent: bool = False) -> list[Machine]:
    """The caller, and a robot for each node-ID with its cost of task 1."""
    robots = [Machine(node, Costs({1: cost}, slack_ms), silent=silent) for node, cost in costs.items()]
    return [caller(silent), *robots]
