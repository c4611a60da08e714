"""An insider: who has a machine's own keys, beside its ears, and seals what it says as that machine would.

Under the machine's own number it has all keys; under another's only the group key, which proves all but a grant or an
award to its taker. It follows everybody's numbers on the bus, so that what it says is the next that counts.
"""

from bus_sim.seals import SimulatedSeals
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Message
from onboard.contract.seal import Seal, SealAnswer, SealChallenge, SealTo
from onboard.core.frame import Frame
from onboard.seal.keys import Keys
from onboard.seal.sender import SealingSender
from onboard.seal.subjects import Reading
from onboard.seal.tags import following

_NODE_MASK = 0xFF
#: A number that seems to lie further ahead than this is one of before.
_AHEAD = 0x8000
#: The life of a node whose own one was never heard, such as a tool's that is not there.
_LIFE = 1 << 30


class StolenKeys:
    """The keys of ``node`` in the hands of somebody else."""

    def __init__(self, seals: SimulatedSeals, node: int, reading: Reading) -> None:
        own = seals.keys(node)
        others = {other: Keys(other, own.group, {}) for other in own.pairs}
        self._node = node
        self._senders = {one.node: SealingSender(one, 0, reading) for one in (own, *others.values())}
        self._reading = reading

    def hear(self, frame: Frame) -> None:
        """Follow the numbers of all."""
        word = self._reading(frame)
        sender = self._senders.get(word.sender) if isinstance(word, Message) else None
        if sender is None:
            return
        if isinstance(word, SealAnswer):
            sender.number = max(sender.number, word.life << 32 | word.number)
        elif isinstance(word, Seal | SealTo):
            number = following(sender.number, word.counter)
            sender.number = number if number - sender.number < _AHEAD else sender.number

    def answer(self, frame: Frame, now_us: int) -> list[Frame]:
        """What to say to whoever asks for the number of the node whose keys they are."""
        word, own = self._reading(frame), self._senders[self._node]
        if not isinstance(word, SealChallenge) or word.whom not in (NOBODY, self._node):
            return []
        own.number = own.number if own.number >> 32 else _LIFE << 32
        return own.answer(word.sender, word.nonce, now_us)

    def sealed(self, frame: Frame, now_us: int) -> list[Frame]:
        """The frame with seals behind it, as good as the insider can make them."""
        sender = self._senders.get(frame.arbitration_id & _NODE_MASK)
        if sender is None:
            return [frame]
        return [*sender.say(frame, now_us), *sender.seal(now_us)]
