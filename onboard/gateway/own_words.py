"""What a gateway puts on the fleet bus: under its own node-ID, and only what the DBC lets a gateway say.

The computer with the gateway is the one node of the bus that an IP network reaches. This bounds a mistake of the
program; whoever rules that computer sends what it likes, and meets the machines' own rule (onboard/holon/admission.py).
"""

from collections.abc import Callable

from onboard.contract.codes import KindCode
from onboard.contract.messages import EmergencyStop, Message
from onboard.core.frame import Frame
from onboard.wire.codec import Codec


class OwnWords:
    """``kept_back`` counts messages that were not its own, and went nowhere."""

    def __init__(self, codec: Codec, node_id: int, send: Callable[[Frame], bool]) -> None:
        self.kept_back = 0
        self._codec, self._node_id, self._send = codec, node_id, send

    def say(self, message: Message) -> None:
        """Put a message of this gateway's on the bus, or keep it back and count it."""
        is_gateways = KindCode.OBSERVER in self._codec.speakers.get(type(message), ())
        # A stop is an operator's to say; no order from a broker becomes one (docs/mqtt.md).
        if message.sender != self._node_id or not is_gateways or isinstance(message, EmergencyStop):
            self.kept_back += 1
            return
        for frame in self._codec.encode(message):
            self._send(frame)
