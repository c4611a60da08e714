"""Forged frames against one receiver: ``python -m tests.seal.forge FRAMES [SEED]`` says how many were accepted."""

import random
import sys
import time
from collections import Counter
from collections.abc import Callable

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Message, TokenGrant, TokenHeld
from onboard.contract.seal import SealAnswer, SealTo
from onboard.core.frame import Frame
from tests.seal.nodes import CODEC, SECOND_US, wire_of

#: Most tries wait until what the last one left is forgotten; of so many, the first ones are a flood.
_AGAIN_US, _FLOOD_US, _ROUND, _FLOODED = 6 * SECOND_US // 10, SECOND_US // 100, 512, 32
#: Words of the victim's giver that the forger remembers.
_KEPT = 512
_GIVER, _OTHER, _VICTIM = 1, 5, 11
_BITS = tuple(1 << bit for bit in range(8))


class Forger:
    """Has heard all that node 1 said to node 11 and to others, and says it in its name in every other way (``tries``).

    Node 1 goes on: once in a round it says something, which must count, and is remembered.
    """

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self._wire = wire_of()
        log = self._wire.log
        self._answers = [
            [frame, log[at + 1]]
            for at, frame in enumerate(log)
            if isinstance(said := CODEC.decode_part(frame), SealAnswer)
            and said.sender == _GIVER
            and isinstance(CODEC.decode_part(log[at + 1]), SealTo)
        ]
        self.past: list[list[Frame]] = []
        self.victim = self._wire.gates[_VICTIM]
        self.accepted: list[Message] = []
        self.frames: Counter[str] = Counter()
        #: Words of node 1 that did not count: the victim was deaf.
        self.missed = 0
        self._round = 0
        for _ in range(8):
            self._giver_speaks()

    def tries(self, count: int) -> int:
        """At least so many forged frames, each word with its seals; how many words were accepted."""
        ways: tuple[Callable[[], list[Frame]], ...] = (
            self._by_chance,
            self._again,
            self._to_another,
            self._under_another,
            self._behind_another,
            self._turned,
            self._cut,
            self._renumbered,
            self._one_bit,
            self._asked_of_old,
        )
        end = self.frames.total() + count
        while self.frames.total() < end:
            self._giver_speaks()
            for number in range(_ROUND):
                self._wire.now_us += _FLOOD_US if number < _FLOODED else _AGAIN_US
                way = ways[number % len(ways)]
                self._say(way())
        return len(self.accepted)

    def _say(self, frames: list[Frame]) -> None:
        victim, now_us = self.victim, self._wire.now_us
        for frame in frames:
            handed, _ = victim.hear(frame, now_us)
            for one in handed:
                # A seal that was cut short is no message, whoever it is handed to.
                word = CODEC.decode_part(one)
                if isinstance(word, Message):
                    self.accepted.append(word)
        if victim.next_us is not None and victim.next_us <= now_us:
            victim.wake(now_us)

    def _giver_speaks(self) -> None:
        self._wire.now_us += SECOND_US
        self.victim.wake(self._wire.now_us)
        self._round += 1
        token, version, holder = self._round & 0xFFF, self._round & 0xFFFF, (_VICTIM, _OTHER)[self._round & 1]
        before = len(self._wire.heard[_VICTIM])
        for said in (
            TokenGrant(_GIVER, TokenKind.SEGMENT, token, version, holder),
            TokenHeld(_GIVER, TokenKind.SEGMENT, token, version),
        ):
            frames = self._wire.say(said)
            sealed = [one for one in frames if one.arbitration_id & 0xFF == _GIVER]
            if len(self.past) < _KEPT:
                self.past.append(sealed)
            else:
                self.past[self.chance.randrange(_KEPT)] = sealed
        self.missed += 2 - (len(self._wire.heard[_VICTIM]) - before)
        for heard in self._wire.heard.values():
            heard.clear()
        self._wire.log.clear()

    # --- its ways ----------------------------------------------------------------------------------------------

    def _any(self) -> list[Frame]:
        return self.past[int(self.chance.random() * len(self.past))]

    def _noted(self, way: str, frames: list[Frame]) -> list[Frame]:
        self.frames[way] += len(frames)
        return frames

    def _by_chance(self) -> list[Frame]:
        frame, *seals = self._any()
        return self._noted("forged", [frame, *(_with(one, self.chance.randbytes(8)) for one in seals)])

    def _again(self) -> list[Frame]:
        return self._noted("replayed", self._any())

    def _to_another(self) -> list[Frame]:
        frame, *seals = self._any()
        holder = _VICTIM if frame.data[7] == _OTHER else _OTHER
        return self._noted("re-addressed", [_with(frame, frame.data[:7] + bytes([holder])), *seals])

    def _under_another(self) -> list[Frame]:
        frames = [one._replace(arbitration_id=one.arbitration_id & ~0xFF | _OTHER) for one in self._any()]
        return self._noted("re-addressed", frames)

    def _behind_another(self) -> list[Frame]:
        return self._noted("forged", [self._any()[0], *self._any()[1:]])

    def _turned(self) -> list[Frame]:
        return self._noted("replayed", self._any()[::-1])

    def _cut(self) -> list[Frame]:
        frame, *seals = self._any()
        length = self.chance.getrandbits(3)
        return self._noted("forged", [frame, *(_with(one, one.data[:length]) for one in seals)])

    def _renumbered(self) -> list[Frame]:
        frame, *seals = self._any()
        number = self.chance.randbytes(2)
        return self._noted("replayed", [frame, *(_with(one, number + one.data[2:]) for one in seals)])

    def _one_bit(self) -> list[Frame]:
        frame, *seals = self._any()
        at, bit = self.chance.getrandbits(3), _BITS[self.chance.getrandbits(3)]
        changed = bytearray(frame.data)
        changed[at] ^= bit
        return self._noted("forged", [_with(frame, bytes(changed)), *seals])

    def _asked_of_old(self) -> list[Frame]:
        """The answers that node 1 gave at the start, to other questions: numbers would begin there again."""
        return self._noted("replayed", [*self.chance.choice(self._answers), *self._any()])


def _with(frame: Frame, data: bytes) -> Frame:
    return Frame(frame.arbitration_id, data)


def main() -> None:
    """The command line: FRAMES and, where it is to be another, SEED."""
    if not 2 <= len(sys.argv) <= 3 or not all(word.isdecimal() for word in sys.argv[1:]):
        print("usage: python -m tests.seal.forge FRAMES [SEED]", file=sys.stderr)
        raise SystemExit(2)
    count, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    forger = Forger(seed)
    begun = time.process_time()
    accepted = forger.tries(count)
    took, said = time.process_time() - begun, forger.frames
    ways = ", ".join(f"{many:,} {way}" for way, many in sorted(said.items()))
    print(f"{accepted} words of {said.total():,} frames accepted ({ways}); {1e6 * took / said.total():.1f} us each")
    print(f"words of their true sender that did not count: {forger.missed}")
    raise SystemExit(1 if accepted or forger.missed else 0)


if __name__ == "__main__":
    main()
