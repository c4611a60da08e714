"""How a device reaches its machine's device bus: as messages; the adapter below turns them into frames and back."""

from collections.abc import Callable
from typing import Protocol

from onboard.contract.messages import Message, StateRequest
from onboard.core.frame import Frame
from onboard.ports.bus import Bus

#: Called with a message and the loop time of its reception, us.
MessageHandler = Callable[[Message, int], None]
#: What a fault makes of a message between a device and its bus: the same, another, or none.
MessageFilter = Callable[[Message], Message | None]


class DeviceBusLink(Protocol):
    """A device's connection to its machine's device bus."""

    def send(self, message: Message) -> None:
        """Say a message; never blocks, never raises for a full queue (the next state tells the same)."""

    def subscribe(self, on_message: MessageHandler) -> None:
        """Hand every message of other nodes of that bus to ``on_message``; several subscribers are served in order."""

    def answer(self, say: Callable[[], None]) -> None:
        """Call ``say`` whenever the controller asks how its devices stand: it sends all state words of one device."""


class Encoder(Protocol):
    """What the adapter needs of a codec."""

    def encode(self, message: Message) -> tuple[Frame, ...]:
        """The frames of a message."""


class Feed(Protocol):
    """What the adapter needs of a decoder."""

    def feed(self, frame: Frame, now_us: int) -> Message | None:
        """The message that this frame completes, or None."""


class BusDeviceLink:
    """A ``DeviceBusLink`` over any CAN bus.

    A bus that carries several machines' devices hands every device every order; messages of node-IDs other than
    ``node_id`` are passed over, as an acceptance filter on the identifier's low byte would. Faults put filters into
    ``outgoing`` (what the sensors say) and ``incoming`` (what the actuators are told); each sees what the one before
    it let through.
    """

    def __init__(self, bus: Bus, encoder: Encoder, decoder: Feed, node_id: int) -> None:
        self.send_refused = 0
        self.outgoing: list[MessageFilter] = []
        self.incoming: list[MessageFilter] = []
        self._bus = bus
        self._encoder = encoder
        self._decoder = decoder
        self._node_id = node_id
        self._handlers: list[MessageHandler] = []
        self.answers: list[Callable[[], None]] = []
        bus.subscribe(self._on_frame)

    def send(self, message: Message) -> None:
        """Encode and queue; frames that the full transmit queue refused are counted in ``send_refused``."""
        passed = _filtered(message, self.outgoing) if self.outgoing else message
        if passed is None:
            return
        for frame in self._encoder.encode(passed):
            if not self._bus.send(frame):
                self.send_refused += 1

    def subscribe(self, on_message: MessageHandler) -> None:
        """Hand every message that reaches the device to one more handler."""
        self._handlers.append(on_message)

    def answer(self, say: Callable[[], None]) -> None:
        """One more device that says how it stands when it is asked."""
        self.answers.append(say)

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        message = self._decoder.feed(frame, time_us)
        if message is None or message.sender != self._node_id:
            return
        if isinstance(message, StateRequest):
            # Sensors answer it: what keeps orders from the actuators does not keep this from them.
            for say in self.answers:
                say()
            return
        if self.incoming:
            message = _filtered(message, self.incoming)
            if message is None:
                return
        for handler in self._handlers:
            handler(message, time_us)


def _filtered(message: Message, filters: list[MessageFilter]) -> Message | None:
    """What the filters let through, in their order."""
    passed: Message | None = message
    for one in filters:
        if passed is None:
            return None
        passed = one(passed)
    return passed
