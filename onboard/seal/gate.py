"""Between a node and the fleet bus: what it says is sealed, what others say is handed on by its seal.

Every frame of a node of the site counts only with a seal behind it, but a sign of life that says nothing new, and an
emergency stop, which holds from anybody. What has a taker counts for the taker by the key of the two alone. A receiver
that does not know a node's number, as after a start, challenges it; until that is answered nothing of it counts.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from onboard.contract.constants import MAX_NODE_ID, NOBODY
from onboard.contract.messages import EmergencyStop, Heartbeat, Message
from onboard.contract.seal import Seal, SealAnswer, SealChallenge, SealFault, SealTo, SealWord
from onboard.core.frame import Frame
from onboard.seal.heard import (
    MOST_TWIN_SEALS,
    MOST_WAITING,
    TWIN_SEALS_US,
    WAITS_US,
    HeardNode,
    WaitingFrame,
    readings,
    readings_among_twins,
)
from onboard.seal.keys import Keys
from onboard.seal.sender import SealingSender
from onboard.seal.subjects import Reading, frame_of, taker_of
from onboard.seal.tags import following, tag_of, tag_over

_NODE_MASK = 0xFF
#: A node whose seals do not fit is challenged again after so long, and after twice as long each time, us.
_ASK_US, _ASK_MOST_US = 250_000, 8_000_000
#: Seals in a row that do not fit make a node one that is challenged: so many of numbers that could come next, behind
#: which a frame may have been lost, or two of others, as of a life that I do not know. One may be anybody's.
_MISFITS, _NEAR = 8, 256
#: Challenges of one node that wait for an answer.
_ASKED = 4
#: At most one word about faults in this time, us: a heartbeat's period.
_TELL_US = 2_000_000
#: Answers of all nodes together take at most this share of the bus, per cent; an answer is two frames of 160 bits.
_ANSWER_PERCENT, _ANSWER_BITS = 10, 320
#: Answers that one node may say at once.
_ANSWERS_AT_ONCE = 2
#: For so long at least a start waits for answers, us; beyond the time that all answers need.
_START_US = 500_000
_MOST_COUNTED = 65_535
#: What two nodes prove to each other, and others cannot judge.
_OF_NUMBERS = (SealTo, SealChallenge, SealAnswer)
#: What this side of the gate alone knows how to read.
_OF_SEALS = (Seal, SealFault, *_OF_NUMBERS)


@dataclass(frozen=True, slots=True)
class GateSettings:
    """``others``: nodes that are challenged at a start. ``is_required``: whether what has no seal is kept away."""

    others: frozenset[int]
    bit_rate: int
    is_required: bool

    @property
    def answer_us(self) -> int:
        """Between two answers of one node."""
        return _ANSWER_BITS * 100 * 1_000_000 * (len(self.others) + 1) // (_ANSWER_PERCENT * self.bit_rate)


class Gate:
    """Sans I/O: ``say`` and ``hear`` frames, ``wake`` at ``next_us``; times are loop time, us.

    ``nonce`` gives 48 bits by chance. ``faults`` counts what did not fit, by node and by what was wrong.
    """

    def __init__(
        self, keys: Keys, settings: GateSettings, life: int, nonce: Callable[[], int], reading: Reading
    ) -> None:
        self.faults: Counter[tuple[int, SealWord]] = Counter()
        self.is_open = False
        self.next_us: int | None = None
        self._keys, self._settings, self._nonce, self._reading = keys, settings, nonce, reading
        self._sender = SealingSender(keys, life, reading)
        self._nodes = {node: HeardNode() for node in keys.pairs}
        self._own = HeardNode()
        self._asked: deque[tuple[int, int]] = deque()
        self._answer_even_us = 0
        self._open_us = 0
        self._ask_again_us = 0
        self._told: dict[tuple[int, SealWord], int] = {}
        self._tell_us = 0
        self._twins_until_us, self._twin_seals = 0, 0

    # --- out ---------------------------------------------------------------------------------------------------

    @property
    def waits_for_seal(self) -> bool:
        """Whether ``seal`` has something to say."""
        return self._sender.waits

    def say(self, frame: Frame, now_us: int) -> list[Frame]:
        """What goes on the bus for a frame of this node."""
        return self._sender.say(frame, now_us)

    def seal(self, now_us: int) -> list[Frame]:
        """The seal of what was said since the last one; to be called once a decision has been said."""
        return self._sender.seal(now_us)

    def begin(self, now_us: int) -> list[Frame]:
        """Challenge all: ``is_open`` once they have answered, or their time is over."""
        whole_us = _START_US + 2 * len(self._settings.others) * self._settings.answer_us
        self._open_us, self._ask_again_us = now_us + whole_us, now_us + whole_us // 2
        self.is_open = not self._settings.others
        # Twice the same: whoever misses it has to be asked alone, and answers behind all others.
        said = 2 * self._challenge(NOBODY, now_us)
        self._set_next(now_us)
        return said

    def wake(self, now_us: int) -> list[Frame]:
        """What is due: answers, challenges again, and words about faults."""
        said: list[Frame] = []
        if now_us >= self._open_us:
            self.is_open = True
        if not self.is_open and now_us >= self._ask_again_us:
            said += self._challenge_again(now_us)
        for node, heard in (*self._nodes.items(), (self._keys.node, self._own)):
            while heard.waiting and now_us - heard.waiting[0].since_us >= WAITS_US:
                self._pass_over(node, (heard.waiting.popleft(),))
        while self._asked and now_us >= self._answer_us:
            whom, nonce = self._asked.popleft()
            self._answer_even_us = max(self._answer_even_us, now_us) + self._settings.answer_us
            said += self._sender.answer(whom, nonce, now_us)
            self._look_open()
        said += self._tell(now_us)
        self._set_next(now_us)
        return said

    @property
    def _answer_us(self) -> int:
        return self._answer_even_us - (_ANSWERS_AT_ONCE - 1) * self._settings.answer_us

    def _challenge(self, whom: int, now_us: int) -> list[Frame]:
        nonce = self._nonce()
        for node in self._nodes if whom == NOBODY else (whom,):
            heard = self._nodes[node]
            heard.nonces.append(nonce)
            heard.patience_us = min(2 * heard.patience_us, _ASK_MOST_US) if whom != NOBODY else _ASK_US
            heard.ask_us = now_us + (heard.patience_us or _ASK_US)
        return [frame_of(SealChallenge(self._keys.node, whom, nonce))]

    def _challenge_again(self, now_us: int) -> list[Frame]:
        """One by one those who have not answered by now: asked together, all would answer once more."""
        missing = [node for node in sorted(self._settings.others) if self._nodes[node].last is None]
        self._ask_again_us = now_us + _START_US + len(missing) * self._settings.answer_us
        return [frame for node in missing for frame in self._challenge(node, now_us)]

    def _tell(self, now_us: int) -> list[Frame]:
        """One word about what has been counted since it was told, if it is time."""
        if now_us < self._tell_us:
            return []
        for (node, fault), count in self.faults.items():
            if self._told.get((node, fault)) != min(count, _MOST_COUNTED):
                self._told.pop((node, fault), None)
                self._told[node, fault] = min(count, _MOST_COUNTED)
                # Whose turn it was is looked at last.
                self.faults[node, fault] = self.faults.pop((node, fault))
                self._tell_us = now_us + _TELL_US
                word = frame_of(SealFault(self._keys.node, node, fault, self._told[node, fault]))
                return self._sender.say(word, now_us) + self._sender.seal(now_us)
        return []

    def _set_next(self, now_us: int) -> None:
        """When ``wake`` is due: the earliest of all that waits."""
        due = [heard.waiting[0].since_us + WAITS_US for heard in (*self._nodes.values(), self._own) if heard.waiting]
        if not self.is_open:
            due.append(min(self._open_us, self._ask_again_us))
        if self._asked:
            due.append(self._answer_us)
        if any(self._told.get(key) != min(count, _MOST_COUNTED) for key, count in self.faults.items()):
            due.append(self._tell_us)
        self.next_us = max(now_us, min(due)) if due else None

    # --- in ----------------------------------------------------------------------------------------------------

    def hear(self, frame: Frame, now_us: int) -> tuple[list[Frame], list[Frame]]:
        """What is handed on for a frame of another node, in order, and what is to be said because of it."""
        word = self._reading(frame)
        if not isinstance(word, Message):
            return [frame], []
        handed: list[Frame] = []
        said: list[Frame] = []
        if word.sender == self._keys.node and isinstance(word, _OF_NUMBERS):
            # Nobody hears itself: somebody asks or answers in my name, and only I can tell that it was not me.
            self.faults[word.sender, SealWord.FALSE_SEAL] += 1
        match word:
            case _ if word.sender != self._keys.node and word.sender not in self._nodes:
                handed = self._of_stranger(word, frame)
            case Seal():
                handed, said = self._on_seal(word, now_us)
            case SealTo():
                handed = self._on_seal_to(word, now_us)
            case SealChallenge():
                said = self._on_challenge(word, now_us)
            case SealAnswer():
                self._keep_answer(word, frame)
            case SealFault():
                self._keep(word, frame, now_us, is_done=True)
            case _:
                handed = self._on_word(word, frame, now_us)
        if self.next_us is None or self._asked:
            self._set_next(now_us)
        return handed, said

    def _of_stranger(self, word: Message, frame: Frame) -> list[Frame]:
        """Whoever has no key here: as if there were no seals, he is judged by who he is, his seals as well.

        What people's tools say needs a key like any other.
        """
        if word.sender <= MAX_NODE_ID or isinstance(word, EmergencyStop):
            return [frame]
        self.faults[word.sender, SealWord.UNSEALED] += 1
        return [] if self._settings.is_required or isinstance(word, _OF_SEALS) else [frame]

    def _on_word(self, word: Message, frame: Frame, now_us: int) -> list[Frame]:
        heard = self._nodes.get(word.sender)
        if heard is not None and isinstance(word, Heartbeat) and heard.needs_no_seal(word, now_us):
            # It may be sealed all the same, where its sender had sealed nothing for long.
            heard.free = WaitingFrame(frame, now_us, is_done=True)
            return [frame]
        is_stop = isinstance(word, EmergencyStop) and word.sender != self._keys.node
        is_done = is_stop or not self._settings.is_required
        self._keep(word, frame, now_us, is_done=is_done)
        return [frame] if is_done else []

    def _keep(self, word: Message, frame: Frame, now_us: int, *, is_done: bool) -> None:
        heard = self._own if word.sender == self._keys.node else self._nodes.get(word.sender)
        if heard is None:
            return
        heard.waiting.append(WaitingFrame(frame, now_us, is_done, taker_of(word) == self._keys.node))
        if len(heard.waiting) > MOST_WAITING:
            self._pass_over(word.sender, (heard.waiting.popleft(),))
        due_us = now_us + WAITS_US
        self.next_us = due_us if self.next_us is None else min(self.next_us, due_us)

    def _on_seal(self, seal: Seal, now_us: int) -> tuple[list[Frame], list[Frame]]:
        if seal.sender == self._keys.node:
            return self._on_own_seal(seal), []
        heard = self._nodes.get(seal.sender)
        if heard is None:
            return [], []
        looks_deeper: bool | None = None
        for number in self._numbers(seal.sender, heard, seal.counter):
            found = self._fitting(seal, number, heard.waiting)
            if found is not None:
                return self._take_up(seal.sender, heard, number, found, now_us), []
            if heard.free is not None and self._fitting(seal, number, [heard.free]):
                heard.proved(number, now_us)
                return [], []
            if looks_deeper is None:
                looks_deeper = self._may_look_deeper(heard, now_us)
            found = self._first(seal, number, readings_among_twins(list(heard.waiting))) if looks_deeper else None
            if found is not None:
                return self._take_up(seal.sender, heard, number, found, now_us), []
        if heard.last is None:
            self._drop_all(seal.sender, heard, SealWord.NOT_FRESH)
            return [], self._ask(seal.sender, heard, now_us)
        return [], self._misfit(seal, heard, now_us)

    def _numbers(self, node: int, heard: HeardNode, low: int) -> Iterator[int]:  # listeners ask whose
        """What the number of a seal may be, from its lowest bits."""
        if heard.last is not None:
            yield following(heard.last, low)

    def _take_up(
        self, node: int, heard: HeardNode, number: int, found: Sequence[WaitingFrame], now_us: int
    ) -> list[Frame]:
        """Of all that waited, what the seal is over counts; whatever was said between comes to nothing."""
        waiting = list(heard.waiting)
        heard.waiting.clear()
        self._pass_over(node, [one for one in waiting if one not in found])
        heard.proved(number, now_us)
        # What I act on myself needs the key that only we two have: it was handed on by that, or not at all.
        self._pass_over(node, [one for one in found if one.needs_my_key])
        return self._accept(heard, [one for one in found if not one.needs_my_key])

    def _accept(self, heard: HeardNode, found: Sequence[WaitingFrame]) -> list[Frame]:
        """Take up what sealed words tell of their sender; those that were not handed on yet."""
        handed: list[Frame] = []
        for one in found:
            word = self._reading(one.frame)
            heard.places.note(word, one.frame)
            if isinstance(word, Heartbeat):
                heard.told(word)
            if not one.is_done:
                handed.append(one.frame)
        return handed

    def _on_seal_to(self, seal: SealTo, now_us: int) -> list[Frame]:
        heard = self._nodes.get(seal.sender)
        if heard is None:
            return []
        key = self._keys.pairs[seal.sender]
        if heard.answer is None and heard.last is None and heard.claim is not None:
            # It may be behind an answer that was lost, whose number follows those told to others.
            number = following(heard.claim, seal.counter)
            heard.answer = frame_of(SealAnswer(seal.sender, number & 0xFFFFFFFF, number >> 32))
        if heard.answer is not None:
            self._on_answer(seal, heard, key, now_us)
            return []
        mine = [one for one in heard.waiting if one.needs_my_key]
        if heard.last is None or not mine:
            return []
        number = following(heard.last, seal.counter)
        for one in reversed(mine):
            covered = heard.places.with_grant(self._reading(one.frame), one.frame)
            if seal.tag == tag_of(key, number, covered, self._keys.node):
                heard.proved(number, now_us)
                heard.own_last = number
                handed = [] if one.is_done else [one.frame]
                one.is_done, one.needs_my_key = True, False
                return handed
        self.faults[seal.sender, SealWord.FALSE_SEAL] += 1
        return []

    def _keep_answer(self, word: SealAnswer, frame: Frame) -> None:
        """It counts by the seal behind it."""
        if word.sender in self._nodes:
            heard = self._nodes[word.sender]
            heard.answer, heard.claim = frame, word.life << 32 | word.number

    def _on_answer(self, seal: SealTo, heard: HeardNode, key: bytes, now_us: int) -> None:
        frame, heard.answer = heard.answer, None
        answer = self._reading(frame) if frame is not None else None
        if frame is None or not isinstance(answer, SealAnswer):
            return
        number = answer.life << 32 | answer.number
        if not any(seal.tag == tag_of(key, number, (frame,), self._keys.node, nonce) for nonce in heard.nonces):
            return
        if number < heard.own_last:
            # It begins again where it was: keys of old, whose recorded words would count once more.
            self.faults[seal.sender, SealWord.REPLAYED] += 1
            return
        # It proved that this is its number now: all that anybody recorded of it has a lower one.
        heard.proved(number, now_us)
        heard.own_last = number
        heard.nonces.clear()
        heard.patience_us = 0
        self._look_open()

    def _look_open(self) -> None:
        """Open once I can follow all others, and they me."""
        can_follow = all(self._nodes[node].last is not None for node in self._settings.others)
        self.is_open = self.is_open or (can_follow and not self._asked)

    def _on_challenge(self, word: SealChallenge, now_us: int) -> list[Frame]:
        if word.whom not in (NOBODY, self._keys.node) or word.sender not in self._keys.pairs:
            return []
        if word.nonce == self._nodes[word.sender].asked:
            return []
        self._nodes[word.sender].asked = word.nonce
        mine = [one for one in self._asked if one[0] == word.sender]
        if len(mine) >= _ASKED:
            self._asked.remove(mine[0])
        self._asked.append((word.sender, word.nonce))
        heard = self._nodes[word.sender]
        # Who asks all has begun a life, and I cannot follow its numbers.
        return self._ask(word.sender, heard, now_us) if word.whom == NOBODY else []

    def _ask(self, node: int, heard: HeardNode, now_us: int) -> list[Frame]:
        if now_us < heard.ask_us:
            return []
        heard.patience_us = heard.patience_us or _ASK_US
        return self._challenge(node, now_us)

    def _misfit(self, seal: Seal, heard: HeardNode, now_us: int) -> list[Frame]:
        """Old words said again are named as that; else it is a forgery, or I have missed too much."""
        assert heard.last is not None
        number = following(heard.last, seal.counter) - 0x10000
        old = self._fitting(seal, number, heard.waiting) if number > 0 else None
        if old is not None:
            for one in old:
                heard.waiting.remove(one)
            self._count(seal.sender, SealWord.REPLAYED, old)
            return []
        self.faults[seal.sender, SealWord.FALSE_SEAL] += 1
        heard.misfits += 1 if number + 0x10000 - heard.last <= _NEAR else _MISFITS // 2
        return self._ask(seal.sender, heard, now_us) if heard.misfits >= _MISFITS else []

    def _on_own_seal(self, seal: Seal) -> list[Frame]:
        """Under my own number: what I have said is a replay; what I have not, but could have, is a clone's."""
        newer = following(self._sender.number, seal.counter)
        for number in (newer - 0x10000, newer):
            found = self._fitting(seal, number, self._own.waiting) if number > 0 else None
            if found is None:
                continue
            for one in found:
                self._own.waiting.remove(one)
            if number == newer:
                return [one.frame for one in found if not one.is_done]
            self.faults[seal.sender, SealWord.REPLAYED] += len(found)
            return []
        self.faults[seal.sender, SealWord.FALSE_SEAL] += 1
        return []

    def _fitting(self, seal: Seal, number: int, waiting: Iterable[WaitingFrame]) -> Sequence[WaitingFrame] | None:
        """What of the frames that wait the seal is over, under that number; None where that is nothing."""
        return self._first(seal, number, readings(list(waiting)))

    def _may_look_deeper(self, heard: HeardNode, now_us: int) -> bool:
        """Whether it is to be tried which of the frames that wait are another's: for so many seals in a while only."""
        if len(heard.waiting) < 3:
            return False
        if now_us >= self._twins_until_us:
            self._twins_until_us, self._twin_seals = now_us + TWIN_SEALS_US, 0
        self._twin_seals += 1
        return self._twin_seals <= MOST_TWIN_SEALS

    def _first(
        self, seal: Seal, number: int, sequences: Iterable[Sequence[WaitingFrame]]
    ) -> Sequence[WaitingFrame] | None:
        for found in sequences:
            if seal.tag == tag_over(self._keys.group, number, b"".join([one.said for one in found])):
                return found
        return None

    def _drop_all(self, node: int, heard: HeardNode, why: SealWord) -> None:
        self._count(node, why, list(heard.waiting))
        heard.waiting.clear()

    def _pass_over(self, node: int, frames: Sequence[WaitingFrame]) -> None:
        self._count(node, SealWord.UNSEALED, frames)

    def _count(self, node: int, why: SealWord, frames: Sequence[WaitingFrame]) -> None:
        """These came to nothing, or should have. A seal behind nothing is no fault that could be told."""
        if frames:
            self.faults[node, why] += len(frames)
