"""Frames that are heard, said again with mistakes or late, and a flood."""

from collections import deque

from bus_sim.attacks.attack import Attack, AttackerNode
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState
from onboard.contract.messages import Heartbeat
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


class BitOffAsSender(BitOff):
    """One frame in five is said again with one bit off, under the number of whoever said it."""

    def as_mine(self, frame: Frame) -> Frame:
        """The frame under the number of whoever said it."""
        return frame


class Echo(_Frames):
    """Every word is said once more at once, as the attacker's own."""

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """Say it again, under the attacker's number."""
        self.node.put(self.as_mine(frame))


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


class Shortened(_Frames):
    """One frame in five is said again with its last bytes gone."""

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """Say one frame in five again, by at least one byte shorter."""
        if frame.data and self.node.chance.random() < _SHARE:
            left = self.node.chance.randrange(len(frame.data))
            self.node.put(self.as_mine(frame)._replace(data=frame.data[:left]))


class Readdressed(_Frames):
    """Frames that were heard, with their seals, are said again under the number of another machine."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._heard: deque[Frame] = deque(maxlen=_MOST)

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """Keep the last ten thousand frames, seals among them."""
        self._heard.append(frame)

    def tick(self, now_us: int) -> None:
        """Take runs of frames that were said one after the other, and say them under a machine drawn by chance."""
        chance = self.node.chance
        if not self._heard:
            return
        begin, node = chance.randrange(len(self._heard)), chance.choice(sorted(self.node.site.machines))
        for at in range(begin, min(begin + _MUTATED, len(self._heard))):
            frame = self._heard[at]
            self.node.put(frame._replace(arbitration_id=frame.arbitration_id & ~_NODE_MASK | node))


class RandomFrames(Attack):
    """Fifty frames a second of pure chance, a third of them of 11 bits or remote."""

    def tick(self, now_us: int) -> None:
        """Five frames at each call, of any identifier and length."""
        chance, me = self.node.chance, self.node.node_id
        for _ in range(_MUTATED):
            data = chance.randbytes(chance.randint(0, 8))
            what = chance.random()
            if what < 0.2:
                self.node.put(Frame(chance.randrange(1 << 11), data, is_extended=False))
            else:
                identifier = chance.randrange(1 << 21) << 8 | me
                self.node.put(Frame(identifier, b"" if what < 0.33 else data, is_remote=what < 0.33))


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
            self.node.put(self.under(self._to_say.popleft()[1]))

    def under(self, frame: Frame) -> Frame:
        """Under whose number a frame of the past is said again."""
        return self.as_mine(frame)


class Recorded(Replay):
    """The last minute, seals and all, is said again under the numbers of those who said it."""

    def under(self, frame: Frame) -> Frame:
        """The frame under the number of whoever said it, so that its seal still fits."""
        return frame


class Flood(Attack):
    """The identifier that wins every arbitration, back to back."""

    def tick(self, now_us: int) -> None:
        """Fill the transmit queue with frames of identifier 0."""
        for _ in range(_DEEP - self.node.waiting()):
            self.node.put(Frame(0, bytes(8)))


class FloodKnown(Attack):
    """Signs of life back to back, so that the bus is full of what all must read."""

    def tick(self, now_us: int) -> None:
        """Fill the transmit queue with heartbeats, each with another digest."""
        site, chance = self.node.site, self.node.chance
        for _ in range(_DEEP - self.node.waiting()):
            digest = chance.randrange(1 << 16)
            self.node.say(
                Heartbeat(
                    self.node.node_id, CONTRACT_VERSION, site.digest, digest, 1, KindCode.ROBOT, MachineState.IDLE
                )
            )
