"""Which frames of a bus are sealed, frame by frame, for people: with the group key also whose seal is right."""

from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from onboard.contract.messages import Heartbeat, Message
from onboard.contract.seal import Seal, SealAnswer, SealChallenge, SealTo, SealWord
from onboard.core.frame import Frame
from onboard.seal.heard import MOST_WAITING, WAITS_US, HeardNode, WaitingFrame
from onboard.seal.listener import SealListener
from onboard.seal.subjects import Reading


class SealMark(Enum):
    """What is told of one frame. The first two without a key: whether a seal stands behind it, whatever it is worth."""

    SEALED = "sealed"
    UNSEALED = "unsealed"
    RIGHT = "seal right"
    WRONG = "seal wrong"
    AGAIN = "seal right, said again"
    NOT_FRESH = "seal of a number not known yet"
    #: A sign of life that says nothing new, of a node whose seals are right.
    UNCHANGED = "unsealed, nothing new"


class Marked(NamedTuple):
    """A frame whose mark is known now; None for a frame that no seal is about, or that two nodes alone can judge."""

    frame: Frame
    mark: SealMark | None


_FALLEN = {
    SealWord.UNSEALED: SealMark.UNSEALED,
    SealWord.REPLAYED: SealMark.AGAIN,
    SealWord.NOT_FRESH: SealMark.NOT_FRESH,
}
#: What is no word of its own, but proves others or asks for proof.
_OF_SEALS = Seal | SealTo | SealChallenge | SealAnswer


class SealMarks:
    """Feed it every frame of one bus in order, with its time in us. ``counts`` is by sender and mark."""

    def __init__(self, nodes: Collection[int], reading: Reading, group: bytes | None = None) -> None:
        """``group``: the group key, None for who has none. ``nodes``: who is of the site or a tool of its people."""
        self.counts: Counter[tuple[int, SealMark]] = Counter()
        #: The frames that are known to count since the last call; without a key each, as it comes.
        self.counting: Sequence[Frame] = ()
        self._reading, self._nodes = reading, frozenset(nodes)
        self._proof = None if group is None else _Proof(group, nodes, reading)
        self._waiting: dict[int, deque[tuple[Frame, int, bool]]] = {}

    def hear(self, frame: Frame, now_us: int) -> list[Marked]:
        """The frames whose mark is known now, this one or earlier ones; each frame's is told once.

        At most ``WAITS_US`` after it, as long as frames come.
        """
        if self._proof is None:
            return self._told(self._by_seal(frame, self._reading(frame), now_us))
        self.counting = self._proof.proved(frame, now_us)
        return self._told(self._proof.settled())

    def end(self) -> list[Marked]:
        """The bus is over: what still waits has no seal."""
        left = [Marked(frame, SealMark.UNSEALED) for waiting in self._waiting.values() for frame, *_ in waiting]
        self._waiting.clear()
        if self._proof is not None:
            self._proof.end()
            left = self._proof.settled()
        return self._told(left)

    def _told(self, marked: Iterable[Marked]) -> list[Marked]:
        told = list(marked)
        for frame, mark in told:
            if mark is not None:
                self.counts[frame.arbitration_id & 0xFF, mark] += 1
        return told

    # --- without a key -----------------------------------------------------------------------------------------

    def _by_seal(self, frame: Frame, word: object, now_us: int) -> Iterator[Marked]:
        self.counting = (frame,)
        for waiting in self._waiting.values():
            while waiting and now_us - waiting[0][1] >= WAITS_US:
                yield Marked(waiting.popleft()[0], SealMark.UNSEALED)
        if not isinstance(word, Message) or isinstance(word, _OF_SEALS):
            yield Marked(frame, None)
        if not isinstance(word, Message):
            return
        waiting = self._waiting.setdefault(word.sender, deque())
        if isinstance(word, Seal):
            yield from (Marked(one, SealMark.SEALED) for one, *_ in waiting)
            waiting.clear()
        elif not isinstance(word, _OF_SEALS):
            # The seal of a sign of life stands right behind it.
            while waiting and (waiting[0][2] or len(waiting) >= MOST_WAITING):
                yield Marked(waiting.popleft()[0], SealMark.UNSEALED)
            waiting.append((frame, now_us, isinstance(word, Heartbeat)))


class _Proof(SealListener):
    """Notes of each frame what the gate makes of it."""

    def __init__(self, group: bytes, nodes: Collection[int], reading: Reading) -> None:
        super().__init__(group, nodes, reading)
        self._settled: list[Marked] = []
        #: Signs of life that counted at once, by sender: a seal may still follow.
        self._unchanged: dict[int, tuple[Frame, int]] = {}
        #: Frames that a false seal came behind, by ``id``; each waits in a ``HeardNode`` as long as it is here.
        self._belied: dict[int, Frame] = {}

    def proved(self, frame: Frame, now_us: int) -> list[Frame]:
        for node in [node for node, (_, us) in self._unchanged.items() if now_us - us >= WAITS_US]:
            self._end_unchanged(node, SealMark.UNCHANGED)
        word = self._reading(frame)
        if not isinstance(word, Message) or isinstance(word, _OF_SEALS) or word.sender not in self._nodes:
            is_word = isinstance(word, Message) and not isinstance(word, _OF_SEALS)
            self._settled.append(Marked(frame, SealMark.UNSEALED if is_word else None))
            return self._seal_proved(word, frame, now_us) if isinstance(word, Seal) else super().proved(frame, now_us)
        self._end_unchanged(word.sender, SealMark.UNCHANGED)
        handed = super().proved(frame, now_us)
        if isinstance(word, Heartbeat) and frame in handed:
            self._unchanged[word.sender] = frame, now_us
        return handed

    def _seal_proved(self, seal: Seal, frame: Frame, now_us: int) -> list[Frame]:
        heard, false = self._nodes.get(seal.sender), (seal.sender, SealWord.FALSE_SEAL)
        before = self.faults[false], heard and heard.last
        handed = super().proved(frame, now_us)
        if heard is not None and self.faults[false] > before[0]:
            self._belied.update((id(one.frame), one.frame) for one in heard.waiting)
        elif heard is not None and heard.last != before[1]:
            self._end_unchanged(seal.sender, SealMark.RIGHT)
        return handed

    def settled(self) -> list[Marked]:
        """What is known by now and was not told yet."""
        settled, self._settled = self._settled, []
        return settled

    def end(self) -> None:
        """What still waits for a seal has none."""
        for heard in self._nodes.values():
            self._settle(list(heard.waiting), SealMark.UNSEALED)
            heard.waiting.clear()
        for node in tuple(self._unchanged):
            self._end_unchanged(node, SealMark.UNCHANGED)

    def _end_unchanged(self, node: int, mark: SealMark) -> None:
        frame, _ = self._unchanged.pop(node, (None, 0))
        if frame is not None:
            self._settled.append(Marked(frame, mark))

    def _accept(self, heard: HeardNode, found: Sequence[WaitingFrame]) -> list[Frame]:
        self._settle(found, SealMark.RIGHT)
        return super()._accept(heard, found)

    def _count(self, node: int, why: SealWord, frames: Sequence[WaitingFrame]) -> None:
        super()._count(node, why, frames)
        self._settle(frames, _FALLEN[why])

    def _settle(self, frames: Sequence[WaitingFrame], mark: SealMark) -> None:
        for one in frames:
            is_belied = self._belied.pop(id(one.frame), None) is not None
            self._settled.append(Marked(one.frame, SealMark.WRONG if is_belied and mark is SealMark.UNSEALED else mark))
