"""Frames that are heard, said again with mistakes or late, and a flood."""

from collections import deque

from bus_sim.attacks.attack import Attack, AttackerNode
from onboard.core.frame import Frame

#: The lowest byte of an identifier is the sender's node-ID.
_NODE_MASK = 0xFF
#: How much of the past is said again, us.
_PAST_US = 60_000_000
#: Frames of the past that are kept.
_MOST = 10_000
#: Share of the frames heard that are said again with a bit off.
_SHARE = 0.2
#: Frames said in a tick: 50 a second.
_MUTATED = 5
#: Frames that the flood keeps waiting, so that the bus is never idle.
_DEEP = 400


class _Frames(Attack):
    """Says frames of others under the attacker's own node-ID."""

    def as_mine(self, frame: Frame) -> Frame:
        """The frame under the attacker's number."""
        return frame._replace(arbitration_id=frame.arbitration_id & ~_NODE_MASK | self.node.node_id)

    def with_bit_off(self, frame: Frame) -> Frame:
        """The frame with one bit of its data turned."""
        if not frame.data:
            return frame
        bit = self.node.chance.randrange(8 * len(frame.data))
        data = bytearray(frame.data)
        data[bit // 8] ^= 1 << bit % 8
        return frame._replace(data=bytes(data))


class BitOff(_Frames):
    """One frame in five is said again with one bit off."""

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """Say one frame in five again with one bit of its data turned."""
        if self.node.chance.random() < _SHARE:
            self.node.put(self.with_bit_off(self.as_mine(frame)))


class Mutated(_Frames):
    """Fifty frames a second, each one that was heard with up to three bits off and now and then another identifier."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._heard: deque[Frame] = deque(maxlen=500)

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """Keep the last 500 frames as material."""
        self._heard.append(frame)

    def tick(self, now_us: int) -> None:
        """Turn one to three bits each in frames that were heard; one in five also gets another identifier."""
        chance = self.node.chance
        for _ in range(_MUTATED if self._heard else 0):
            frame = chance.choice(self._heard)
            for _ in range(chance.randint(1, 3)):
                frame = self.with_bit_off(frame)
            if chance.random() < 0.2:
                frame = frame._replace(arbitration_id=frame.arbitration_id ^ 1 << chance.randrange(8, 29))
            self.node.put(self.as_mine(frame))


class Replay(_Frames):
    """The last minute is said again as it was recorded, at its own pace, over and over."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._past: deque[tuple[int, Frame]] = deque(maxlen=_MOST)
        self._shift_us: int | None = None
        self._to_say: deque[tuple[int, Frame]] = deque()

    def begin(self, now_us: int) -> None:
        """Take the frames of the last minute, and by how many us they are to come later."""
        self._shift_us = min(now_us, _PAST_US)
        self._to_say.extend(one for one in self._past if one[0] >= now_us - _PAST_US)

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """Record, until the attack begins."""
        if self._shift_us is None:
            self._past.append((now_us, frame))

    def tick(self, now_us: int) -> None:
        """Say what is due by now, in its old order and pace."""
        while self._to_say and self._shift_us is not None and self._to_say[0][0] + self._shift_us <= now_us:
            self.node.put(self.as_mine(self._to_say.popleft()[1]))


class Flood(Attack):
    """The identifier that wins every arbitration, back to back."""

    def tick(self, now_us: int) -> None:
        """Fill the transmit queue with frames of identifier 0."""
        for _ in range(_DEEP - self.node.waiting()):
            self.node.put(Frame(0, bytes(8)))
