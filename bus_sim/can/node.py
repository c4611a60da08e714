"""One node on a simulated CAN bus: acceptance filters, transmit mailboxes, queues, error counters, a busy processor."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from bus_sim.can.arbitration import is_sendable
from bus_sim.can.error_counters import ErrorCounters
from bus_sim.can.faults import FaultInjector
from bus_sim.virtual_time import Clock
from onboard.core.frame import Frame
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler


class _Routes(Protocol):
    """Who hears whom, as the medium works it out and keeps it."""

    def forget_routes(self) -> None:
        """Something that routes depend on has changed."""


class _Counting(Protocol):
    """Nodes that are off the bus and count before they come back."""

    def begin(self, node: "SimulatedBus") -> None:
        """A node starts to count."""


class Wire(Protocol):
    """What a node asks of the bus that it is attached to (``Medium``)."""

    clock: Clock
    #: Called with every frame that a node takes for sending, its time and the node's name.
    queue_taps: list[Callable[[Frame, int, str], None]]

    @property
    def delivery(self) -> _Routes:
        """From the end of a frame to the receivers."""

    @property
    def recovery(self) -> _Counting:
        """The way back from bus-off."""

    def load(self, node: "SimulatedBus", frame: Frame) -> None:
        """A node puts a frame into one of its mailboxes."""

    def detach(self, node: "SimulatedBus", *, in_good_order: bool) -> None:
        """A node leaves the bus; unless ``in_good_order`` a frame that it is sending breaks off."""


class AcceptanceFilter(NamedTuple):
    """Lets a frame pass where ``frame.arbitration_id & mask == value & mask`` and the format is the same."""

    value: int
    mask: int
    extended: bool = True


@dataclass(frozen=True, slots=True)
class NodeOptions:
    """How a node is built.

    ``mailboxes``: frames that its controller offers to arbitration, by priority among them; 1 is what Linux's mcp251x
    driver uses, so that one sender's frames keep their order. ``transmit_queue``: frames that wait first-in first-out
    behind the mailboxes (Linux ``txqueuelen``). ``receive_queue``: frames that wait for the processor, which takes
    ``processing_us`` for each and calls the handlers when that is over; at 0 the handlers are called at the end of the
    frame. ``restart_after_us``: how long after bus-off recovery begins (Linux ``restart-ms``); None: only by
    ``SimulatedBus.restart``. ``receive_errors``: error frames on the bus are handed to the frame handlers as well.

    Raises ``ValueError`` where a queue or the number of mailboxes is below 1 or a time is negative.
    """

    mailboxes: int = 1
    transmit_queue: int = 1000
    receive_queue: int = 1000
    processing_us: int = 0
    restart_after_us: int | None = 0
    receive_errors: bool = False

    def __post_init__(self) -> None:
        """Refuse what no node can be."""
        for name in ("mailboxes", "transmit_queue", "receive_queue"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name}={getattr(self, name)}: must be 1 or more")
        if self.processing_us < 0 or (self.restart_after_us or 0) < 0:
            raise ValueError("processing_us and restart_after_us must not be negative")


class FrameRoute:
    """Handlers that hear one identifier of one sender, in order of attachment, and how many frames went this way."""

    __slots__ = ("_victims", "everybody", "frames", "handlers", "owners", "prompt", "slow")

    def __init__(self, nodes: Iterable["SimulatedBus"]) -> None:
        self.frames = 0
        self.everybody = list(nodes)
        self.prompt = [node for node in self.everybody if node.is_prompt]
        # A busy node's handlers run later anyway; only its queue's turn among the prompt ones is lost.
        self.slow = [node for node in self.everybody if not node.is_prompt]
        self.handlers: list[FrameHandler] = []
        self.owners: list[SimulatedBus] = []
        for node in self.prompt:
            self.handlers += node.frame_handlers
            self.owners += [node] * len(node.frame_handlers)
        self._victims: dict[FaultInjector, list[SimulatedBus]] = {}

    def victims(self, injector: FaultInjector) -> "list[SimulatedBus]":
        """The nodes on this route that a fault may strike."""
        if injector not in self._victims:
            self._victims[injector] = [n for n in self.everybody if injector.chooses(n.name, n.node_id)]
        return self._victims[injector]


class SimulatedBus:
    """One node's connection to a ``Medium``; implements ``onboard.ports.bus.Bus``. Made by ``Medium.attach``.

    A frame counts as sent once another node has acknowledged it, and is then handed to ``on_sent``; nobody hears
    itself. While the node is off the bus frames wait, and may leave much later, as with SocketCAN.
    """

    def __init__(
        self,
        medium: Wire,
        name: str,
        node_id: int | None,
        filters: Sequence[AcceptanceFilter],
        options: NodeOptions,
    ) -> None:
        self.name = name
        self.node_id = node_id
        self.options = options
        #: TEC and REC, kept by the medium.
        self.counters = ErrorCounters()
        #: Bus ticks before which a suspended transmitter may not start; kept by the medium.
        self.ready_ticks = 0
        #: Frames that were in mailboxes when the node went off the bus; kept by the medium.
        self.held: list[Frame] = []
        #: Where its frames go, by arbitration field; kept by the delivery.
        self.routes: dict[int, FrameRoute] = {}
        #: Handlers of received frames; read by the delivery.
        self.frame_handlers: list[FrameHandler] = []
        self.is_open = True
        self._medium = medium
        self._filters = tuple(filters)
        self._processing_us = options.processing_us
        self._sent_handlers: list[FrameHandler] = []
        self._in_mailboxes = 0
        self._transmit_queue: deque[Frame] = deque()
        self._receive_queue: deque[Frame] = deque()
        self._sent = 0
        self._received = 0
        self._send_refused = 0
        self._receive_overflows = 0

    # --- ports.Bus ---------------------------------------------------------------------------------------------

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """Serve one more subscriber; several are called in the order in which they came."""
        self.frame_handlers.append(on_frame)
        if on_sent is not None:
            self._sent_handlers.append(on_sent)
        self._medium.delivery.forget_routes()

    def send(self, frame: Frame) -> bool:
        """See ``Bus``. Also False for what is no classic CAN frame."""
        if not self.is_open or not is_sendable(frame):
            self._send_refused += 1
            return False
        if self._in_mailboxes < self.options.mailboxes:
            self._into_mailbox(frame)
        elif len(self._transmit_queue) < self.options.transmit_queue:
            self._transmit_queue.append(frame)
        else:
            self._send_refused += 1
            return False
        for tap in self._medium.queue_taps:
            tap(frame, self._medium.clock.now_us(), self.name)
        return True

    def health(self) -> BusHealth:
        """See ``Bus``; ``received`` counts frames that passed the filters and found room."""
        self._medium.delivery.forget_routes()
        counters = self.counters
        return BusHealth(
            counters.state,
            counters.tec,
            counters.rec,
            self._sent,
            self._received,
            self._send_refused,
            self._receive_overflows,
        )

    async def close(self) -> None:
        """Leave in good order: a frame on the wire is finished, frames that wait are dropped."""
        self._leave(in_good_order=True)

    # --- more than a Bus ---------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """Vanish at once: a frame of this node on the wire breaks off, and the others see an error."""
        self._leave(in_good_order=False)

    def restart(self) -> None:
        """Begin recovery of a node that is off the bus and does not do so by itself."""
        if self.is_open and self.counters.state is ErrorState.BUS_OFF:
            self._medium.recovery.begin(self)

    def set_filters(self, filters: Sequence[AcceptanceFilter]) -> None:
        """Replace the acceptance filters; none lets everything pass."""
        self._filters = tuple(filters)
        self._medium.delivery.forget_routes()

    @property
    def processing_us(self) -> int:
        """What the processor needs for one received frame; may be changed while the bus runs."""
        return self._processing_us

    @processing_us.setter
    def processing_us(self, duration_us: int) -> None:
        self._processing_us = duration_us
        self._medium.delivery.forget_routes()

    @property
    def waiting_to_send(self) -> int:
        """Frames in mailboxes and in the transmit queue."""
        return self._in_mailboxes + len(self._transmit_queue)

    # --- for the medium ----------------------------------------------------------------------------------------

    @property
    def is_prompt(self) -> bool:
        """Whether its handlers can be called straight at the end of a frame."""
        return self._processing_us == 0 and not self._receive_queue

    def accepts(self, frame: Frame) -> bool:
        """Whether a frame passes the acceptance filters."""
        if not self._filters:
            return True
        return any(
            frame.is_extended is extended and (frame.arbitration_id ^ value) & mask == 0
            for value, mask, extended in self._filters
        )

    def count_received(self, frames: int) -> None:
        """Add frames that a route handed over."""
        self._received += frames

    def receive(self, frame: Frame, now_us: int) -> None:
        """Take a frame that passed the filters: at once, or into the queue of a busy processor."""
        if self.is_prompt:
            self._received += 1
            self._hand_over(frame, now_us)
        elif len(self._receive_queue) >= self.options.receive_queue:
            self._receive_overflows += 1
        else:
            self._received += 1
            self._receive_queue.append(frame)
            if len(self._receive_queue) == 1:
                self._medium.clock.at_us(now_us + self._processing_us, self._process)

    def transmitted(self, frame: Frame, now_us: int) -> None:
        """A frame was acknowledged: its mailbox is free for the next."""
        self._sent += 1
        self._in_mailboxes -= 1
        if self._transmit_queue:
            self._into_mailbox(self._transmit_queue.popleft())
        if self.is_open:
            for handler in self._sent_handlers:
                handler(frame, now_us)

    # --- inside ------------------------------------------------------------------------------------------------

    def _into_mailbox(self, frame: Frame) -> None:
        self._in_mailboxes += 1
        if self.counters.state is ErrorState.BUS_OFF:
            self.held.append(frame)
        else:
            self._medium.load(self, frame)

    def _process(self, now_us: int) -> None:
        """The processor is done with the oldest frame."""
        frame = self._receive_queue[0]
        self._hand_over(frame, now_us)
        self._receive_queue.popleft()
        if self._receive_queue:
            self._medium.clock.at_us(now_us + self._processing_us, self._process)
        elif self._processing_us == 0:
            self._medium.delivery.forget_routes()

    def _hand_over(self, frame: Frame, now_us: int) -> None:
        if self.is_open:
            for handler in self.frame_handlers:
                handler(frame, now_us)

    def _leave(self, *, in_good_order: bool) -> None:
        if not self.is_open:
            return
        self.is_open = False
        self._transmit_queue.clear()
        self.held.clear()
        self._medium.detach(self, in_good_order=in_good_order)
