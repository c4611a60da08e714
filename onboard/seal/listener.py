"""Who only listens, with the group key: a log's reader, or a judge. It asks nobody, and believes no number unproved."""

from collections.abc import Callable, Collection, Iterator

from onboard.contract.seal import SealAnswer, SealChallenge, SealTo
from onboard.core.frame import Frame
from onboard.seal.gate import Gate, GateSettings
from onboard.seal.heard import HeardNode
from onboard.seal.keys import KEY_BYTES, Keys
from onboard.seal.subjects import Reading
from onboard.seal.tags import following

#: A node-ID that nobody has: nothing is said to who only listens.
_NOBODYS = -1
_NEVER_US = 1 << 62
#: Numbers that a node may have told, of whom none is proved yet.
_CLAIMS = 3


class SealListener(Gate):
    """Hands on what counts for all who are on the bus: ``hear`` each frame in order, with its time in us."""

    def __init__(self, group: bytes, nodes: Collection[int], reading: Reading) -> None:
        """``nodes``: whose frames need a seal."""
        keys = Keys(_NOBODYS, group, dict.fromkeys(nodes, bytes(KEY_BYTES)))
        super().__init__(keys, GateSettings(frozenset(), 1, is_required=True), 0, lambda: 0, reading)
        self._tell_us = _NEVER_US
        self._claims: dict[int, list[int]] = {}

    def proved(self, frame: Frame, now_us: int) -> list[Frame]:
        """The frames that are known to count now, in the order in which they were said."""
        if self.next_us is not None and self.next_us <= now_us:
            self.wake(now_us)
        word = self._reading(frame)
        if isinstance(word, SealAnswer):
            claims = self._claims.setdefault(word.sender, [])
            claims.append(word.life << 32 | word.number)
            del claims[:-_CLAIMS]
        # What two nodes prove to each other, nobody else can follow.
        is_for_two = isinstance(word, SealAnswer | SealChallenge | SealTo)
        return [] if is_for_two else self.hear(frame, now_us)[0]

    def _numbers(self, node: int, heard: HeardNode, low: int) -> Iterator[int]:
        yield from super()._numbers(node, heard, low)
        for claim in self._claims.get(node, ()):
            number = following(claim - 1, low)
            if heard.last is None or number > heard.last:
                yield number


def proving(listener: SealListener, tell: Callable[[Frame, int, str], None]) -> Callable[[Frame, int, str], None]:
    """A tap of a bus that is told only what counts."""

    def hear(frame: Frame, time_us: int, sender: str) -> None:
        for one in listener.proved(frame, time_us):
            tell(one, time_us, sender)

    return hear
