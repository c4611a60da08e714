"""A few nodes and their gates, and a wire between them that a test can do everything with."""

import random
from collections.abc import Callable, Iterable

from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.seal.gate import Gate, GateSettings
from onboard.seal.keys import KEY_BYTES, Keys
from onboard.wire.codec import fleet_codec

CODEC = fleet_codec()
NODES = (1, 5, 11)
BIT_RATE = 500_000
SECOND_US = 1_000_000


def keys_of(node: int, nodes: Iterable[int] = NODES) -> Keys:
    """Keys that every test draws alike."""
    chance = random.Random(7)
    group = chance.randbytes(KEY_BYTES)
    pairs = {(one, other): chance.randbytes(KEY_BYTES) for one in nodes for other in nodes if one < other}
    return Keys(node, group, {other: pairs[min(node, other), max(node, other)] for other in nodes if other != node})


def gate_of(node: int, life: int = 1, *, is_required: bool = True, nonce: Callable[[], int] | None = None) -> Gate:
    """A gate of the three nodes' site, which has asked nobody yet."""
    chance = random.Random(f"{node} {life}")
    settings = GateSettings(frozenset(NODES) - {node}, BIT_RATE, is_required)
    return Gate(keys_of(node), settings, life, nonce or (lambda: chance.getrandbits(48)), CODEC.decode_part)


class Wire:
    """All gates on one bus: frames arrive at all others at once and in order; ``log`` has all of them."""

    def __init__(self, gates: dict[int, Gate]) -> None:
        self.gates = gates
        self.now_us = 0
        self.log: list[Frame] = []
        self.heard: dict[int, list[Message]] = {node: [] for node in gates}

    def begin(self, *nodes: int) -> None:
        """These nodes, or all, ask all others, and time passes until they are answered."""
        for node in nodes or tuple(self.gates):
            self.put(self.gates[node].begin(self.now_us), node)
        self.wait(SECOND_US)

    def wait(self, for_us: int) -> None:
        """Let time pass."""
        end_us = self.now_us + for_us
        while self.now_us < end_us:
            self.now_us += 20_000
            for node, gate in self.gates.items():
                if gate.next_us is not None and gate.next_us <= self.now_us:
                    self.put(gate.wake(self.now_us), node)

    def say(self, message: Message) -> list[Frame]:
        """A node says something and its seal; what of it went on the bus."""
        before, gate = len(self.log), self.gates[message.sender]
        for frame in CODEC.encode(message):
            self.put(gate.say(frame, self.now_us), message.sender)
        self.put(gate.seal(self.now_us), message.sender)
        return self.log[before:]

    def put(self, frames: Iterable[Frame], by: int = 0) -> None:
        """Frames on the bus that come from node ``by``, or from a stranger's."""
        for frame in list(frames):
            self.log.append(frame)
            for node in [one for one in self.gates if one != by]:
                self.arrive(node, frame)

    def arrive(self, node: int, frame: Frame) -> None:
        """One node alone hears a frame."""
        handed, said = self.gates[node].hear(frame, self.now_us)
        for one in handed:
            word = CODEC.decode_part(one)
            assert isinstance(word, Message)
            self.heard[node].append(word)
        self.put(said, node)


def wire_of(*, is_required: bool = True) -> Wire:
    """All three nodes, each of which can follow the others."""
    wire = Wire({node: gate_of(node, is_required=is_required) for node in NODES})
    wire.begin()
    return wire
