"""Forged frames against one receiver: ``python -m tests.seal.forge COUNT`` says how many were accepted, how fast."""

import random
import sys
import time

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Message, TokenGrant, TokenHeld
from onboard.core.frame import Frame
from tests.seal.nodes import CODEC, SECOND_US, wire_of

#: A forger changes between its ways; each try is one frame and its seals.
_AGAIN_US = SECOND_US // 100


class Forger:
    """Has heard what node 1 said, and says it in its name in five ways (``tries``)."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        wire = wire_of()
        self.past: list[list[Frame]] = []
        for version in range(1, 40):
            self.past.append(wire.say(TokenGrant(1, TokenKind.SEGMENT, version, version, 11 if version % 2 else 5)))
            self.past.append(wire.say(TokenHeld(1, TokenKind.SEGMENT, 100 + version, version)))
        self.victim = wire.gates[11]
        self.now_us = wire.now_us
        self.accepted: list[Message] = []

    def tries(self, count: int) -> int:
        """So many forged frames, each with its seals; how many were accepted."""
        ways = (self._by_chance, self._again, self._to_another, self._cut, self._renumbered)
        for number in range(count):
            self.now_us += _AGAIN_US
            for frame in ways[number % len(ways)]():
                handed, _ = self.victim.hear(frame, self.now_us)
                # A seal that was cut short is no message, whoever it is handed to.
                self.accepted += [word for one in handed if isinstance(word := CODEC.decode_part(one), Message)]
            if self.victim.next_us is not None and self.victim.next_us <= self.now_us:
                self.victim.wake(self.now_us)
        return len(self.accepted)

    def _by_chance(self) -> list[Frame]:
        frame, *seals = self.chance.choice(self.past)
        return [frame, *(one._replace(data=self.chance.randbytes(8)) for one in seals)]

    def _again(self) -> list[Frame]:
        return self.chance.choice(self.past)

    def _to_another(self) -> list[Frame]:
        frame, *seals = self.chance.choice(self.past)
        holder = 11 if frame.data[7] == 5 else 5
        return [frame._replace(data=frame.data[:7] + bytes([holder])), *seals]

    def _cut(self) -> list[Frame]:
        frame, *seals = self.chance.choice(self.past)
        return [frame, *(one._replace(data=one.data[: self.chance.randrange(8)]) for one in seals)]

    def _renumbered(self) -> list[Frame]:
        frame, *seals = self.chance.choice(self.past)
        return [frame, *(one._replace(data=self.chance.randbytes(2) + one.data[2:]) for one in seals)]


def main() -> None:
    """The command line: COUNT and, where it is to be another, SEED."""
    count, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    begun = time.process_time()
    accepted = Forger(seed).tries(count)
    took = time.process_time() - begun
    print(f"{accepted} of {count} forged frames accepted; {1e6 * took / count:.1f} us each")


if __name__ == "__main__":
    main()
