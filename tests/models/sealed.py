"""Every interleaving of the shipped token book behind the shipped seals, with a forger who has everything but the keys.

The forger has recorded all that was ever said, and says it again at any time, to any node, under any number, with
another taker, or behind the seals of any other word; and grants and rights of all nodes that nobody said. What of it
counts for a node is for the shipped gate of that node to say (``onboard/seal``). Nodes crash, and start again in a new
life with their journal or an old copy of it; two nodes ask each other for their numbers in one go, sooner or later.

Not explored: requests, which anybody may say unproved here; the numbers' lowest 16 bits running over.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from onboard.contract.messages import Message, TokenGrant, TokenHeld
from onboard.core.frame import Frame
from onboard.seal.gate import Gate, GateSettings
from onboard.seal.heard import WAITS_US
from tests.models.explorer import Deeds, Explorer, Limits, State
from tests.models.remembered import KEY
from tests.models.table import put
from tests.seal.nodes import BIT_RATE, CODEC, keys_of

#: A moment at which nothing of an earlier one waits any more.
_LATER_US = 1_000 * WAITS_US


class GateMemory(NamedTuple):
    """A node's own number, and the newest that each node has proved to it, by place; None before the first."""

    number: int
    heard: tuple[int | None, ...]

    @property
    def said(self) -> int:
        """Seals of this life."""
        return self.number & 0xFFFFFFFF


class SealedWord(NamedTuple):
    """A word with its frame and all seals behind it."""

    word: Message
    frames: tuple[Frame, ...]


@dataclass
class SealedExplorer(Explorer):
    """``most_said``: seals that a node says in one life; more is not explored. ``asks``: who starts challenges all."""

    most_said: int = 3
    asks: bool = True
    _sealed: dict[int, SealedWord] = field(default_factory=dict)
    _passes: dict[tuple[int, int, tuple[Frame, ...]], int | None] = field(default_factory=dict)
    _follow: dict[tuple[GateMemory, ...], bool] = field(default_factory=dict)
    #: A word under its own number that counted for a node: it never said it, or said it already.
    own: Message | None = None
    tried: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._plain = Explorer(
            self.limits, self.found, _memories=self._memories, _deeds=self._deeds, _journals=self._journals
        )
        versions = range(1, self.limits.versions + 1)
        self._lies: list[Message] = [TokenHeld(node, *KEY, version) for node in self.nodes for version in versions]
        self._lies += [
            TokenGrant(node, *KEY, version, taker)
            for node in self.nodes
            for version in versions
            for taker in self.nodes
            if taker != node
        ]

    # --- gates -------------------------------------------------------------------------------------------------

    def _gate(self, i: int, memory: GateMemory) -> Gate:
        others = frozenset(self.nodes) - {self.nodes[i]}
        gate = Gate(
            keys_of(self.nodes[i], self.nodes),
            GateSettings(others, BIT_RATE, is_required=True),
            0,
            lambda: memory.number,
            CODEC.decode_part,
        )
        gate._sender.number = memory.number
        for node, last in zip(self.nodes, memory.heard, strict=True):
            if node in others:
                gate._nodes[node].last = last
        return gate

    def _say(self, state: State, i: int, deeds: Deeds) -> State:
        memory, bus = state.gates[i], state.bus
        for word in deeds:
            if isinstance(word, Message):
                gate = self._gate(i, memory)
                frames = [one for frame in CODEC.encode(word) for one in gate.say(frame, 0)] + gate.seal(0)
                memory = memory._replace(number=gate._sender.number)
                bus |= 1 << self._sealed_number(SealedWord(word, tuple(frames)))
        return state._replace(bus=bus, gates=put(state.gates, i, memory))

    def _sealed_number(self, sealed: SealedWord) -> int:
        number = self._words.number(sealed)  # type: ignore[arg-type]  # the bus is of sealed words here
        self._sealed[number] = sealed
        return number

    def _heard_by(self, i: int, memory: GateMemory, sender: int, frames: tuple[Frame, ...]) -> GateMemory | None:
        """What node i's gate is once frames under a node's number counted for it; None where they do not."""
        at = self.nodes.index(sender)
        last = memory.number if at == i else memory.heard[at]
        if last is None:
            return None
        known = (i, last, frames)
        if known not in self._passes:
            self.tried += 1
            gate, handed = self._gate(i, memory), []
            for frame in frames:
                handed += gate.hear(frame, 0)[0]
            gate.wake(_LATER_US)
            passed = last if at == i else gate._nodes[sender].last
            self._passes[known] = passed if handed else None
        after = self._passes[known]
        return None if after is None else memory._replace(heard=put(memory.heard, at, after))

    # --- steps -------------------------------------------------------------------------------------------------

    def begin(self) -> State:
        """All follow each other; nothing was said yet."""
        state = super().begin()
        number = 1 << 32
        gates = [GateMemory(number, tuple(None if i == j else number for j in self._places)) for i in self._places]
        return state._replace(gates=tuple(gates), bus=0)

    @property
    def _places(self) -> range:
        return range(len(self.nodes))

    def alone(self, state: State) -> Iterator[tuple[State, int]]:
        """As without seals; and two nodes ask each other for their numbers."""
        yield from super().alone(state)
        for i in self._places:
            for j in self._places:
                if i < j and state.memory[i] is not None and state.memory[j] is not None:
                    after = self._asked_each_other(state, i, j)
                    if after != state:
                        yield after, 0

    def _asked_each_other(self, state: State, i: int, j: int) -> State:
        gates = state.gates
        for one, other in ((i, j), (j, i)):
            asking, answering = self._gate(one, gates[one]), self._gate(other, gates[other])
            if asking._nodes[self.nodes[other]].last is not None:
                last = gates[one].heard[other]
                if last is not None and last >> 32 == gates[other].number >> 32:
                    continue
            for question in asking.begin(0):
                answering.hear(question, 0)
            for answer in answering.wake(_LATER_US):
                asking.hear(answer, _LATER_US)
            number = answering._sender.number
            heard = put(gates[one].heard, other, asking._nodes[self.nodes[other]].last)
            gates = put(gates, one, gates[one]._replace(heard=heard))
            gates = put(gates, other, gates[other]._replace(number=number))
            if heard != state.gates[one].heard:
                # The first sign of life of a life is sealed: who follows it sees the start, and nobody else.
                state = self._sees(state, one, other)
        return state._replace(gates=gates)

    def _sees(self, state: State, j: int, i: int) -> State:
        memory, before = state.memory[j], state.gates[j].heard[i]
        if memory is None or (before is not None and before >> 32 == state.gates[i].number >> 32):
            return state
        return state._replace(memory=put(state.memory, j, self._sees_start(j, memory, self.nodes[i])))

    def _hearings(self, state: State, i: int, memory: int, words: list[Message | None]) -> Iterator[State]:
        yield from super()._hearings(state, i, memory, [None, *self._requests])
        said = [sealed for number, sealed in self._sealed.items() if state.bus >> number & 1]
        for sender, word, frames in self._forged(said):
            gate = self._heard_by(i, state.gates[i], sender, frames)
            if gate is not None:
                if sender == self.nodes[i]:
                    # It would hold, as for a twin.
                    self.own = word
                    continue
                after = state._replace(gates=put(state.gates, i, gate))
                heard = list(super()._hearings(after, i, memory, [word]))
                # A word that changes nothing moves the number on all the same.
                yield from heard or [after]

    def _forged(self, said: list[SealedWord]) -> Iterator[tuple[int, Message, tuple[Frame, ...]]]:
        """Sender, word and frames: all that was said, true or changed, and every lie behind any seals."""
        for sealed in said:
            seals = sealed.frames[1:]
            yield sealed.word.sender, sealed.word, sealed.frames
            for node in self.nodes:
                if node != sealed.word.sender:
                    frames = tuple(
                        one._replace(arbitration_id=one.arbitration_id & ~0xFF | node) for one in sealed.frames
                    )
                    yield node, replace(sealed.word, sender=node), frames
            for word in (*self._lies, *(other.word for other in said)):
                if word.sender == sealed.word.sender and word != sealed.word:
                    yield word.sender, word, (*CODEC.encode(word), *seals)
        for word in self._lies:
            yield word.sender, word, tuple(CODEC.encode(word))

    def _carry_out(self, state: State, i: int) -> State:
        if state.gates[i].said > self.most_said:
            return state
        return super()._carry_out(state, i)

    def _restarted(self, state: State, i: int, journal: int) -> State:
        life = (state.gates[i].number >> 32) + 1
        # Planted: it believes the first number that anybody says.
        heard = tuple(None if self.asks or j == i else 0 for j in self._places)
        gates = put(state.gates, i, GateMemory(life << 32, heard))
        memory, said = self.starts(i, journal)
        live = frozenset(self.nodes[j] for j, one in enumerate(state.memory) if one is not None and j != i)
        begun = self._memories.number(memory._replace(asked=live, is_synced=not live))
        memories, journals = put(state.memory, i, begun), put(state.journal, i, journal)
        return self._say(state._replace(memory=memories, journal=journals, gates=gates), i, said)

    def _left_on_bus(self, before: State, after: State) -> int:
        return 0

    def _asks(self, state: State, j: int, i: int) -> bool:
        """Question and answer each need that the other follows."""
        follows = all(
            state.gates[one].heard[other] is not None
            and state.gates[one].heard[other] >> 32 == state.gates[other].number >> 32
            for one, other in ((i, j), (j, i))
            if self.asks
        )
        return super()._asks(state, j, i) and follows and state.gates[i].said <= self.most_said

    # --- traps -------------------------------------------------------------------------------------------------

    def ends_well(self, state: State) -> bool:
        """The book comes to rest as without seals, and all can be made to follow each other again."""
        followed = state
        for i in self._places:
            for j in self._places:
                if i < j and state.memory[i] is not None and state.memory[j] is not None:
                    followed = self._asked_each_other(followed, i, j)
        return self._plain.ends_well(followed._replace(gates=(), bus=0)) and self._can_follow(state)

    def _can_follow(self, state: State) -> bool:
        known = self._follow.get(state.gates)
        if known is None:
            up = state._replace(memory=tuple(one or 0 for one in state.memory))
            for i in self._places:
                for j in self._places:
                    if i < j:
                        up = self._asked_each_other(up, i, j)
            known = all(self._counts(up, i, j) for i in self._places for j in self._places if i != j)
            self._follow[state.gates] = known
        return known

    def _counts(self, state: State, i: int, j: int) -> bool:
        word = TokenHeld(self.nodes[i], *KEY, 1)
        gate = self._gate(i, state.gates[i])
        frames = [one for frame in CODEC.encode(word) for one in gate.say(frame, 0)] + gate.seal(0)
        return self._heard_by(j, state.gates[j], self.nodes[i], tuple(frames)) is not None

    def told(self, state: State) -> str:
        """A state in full, for a person."""
        said = [sealed.word for number, sealed in self._sealed.items() if state.bus >> number & 1]
        return "\n".join([super().told(state._replace(bus=0)), f"gates {state.gates}", f"said {said}"])


def explore_sealed(limits: Limits, most_said: int) -> None:
    """Explore, and print what was found."""
    explorer = SealedExplorer(limits, most_said=most_said)
    found = explorer.run()
    print(
        f"{limits}, {most_said} seals a life: {found.states:,} states, {found.transitions:,} transitions, "
        f"{explorer.tried:,} words tried at a gate, {found.spent_s:.1f} s, "
        f"{'complete' if found.is_complete else 'not complete'}, for a person {found.held_for_a_person}"
    )
    for what, state in (("two holders", found.two), ("trap", found.trap), ("false alarm", found.alarm)):
        print(f"{what}:", "none" if state is None else f"\n{explorer.told(state)}")
    print(f"under its own number: {explorer.own or 'none'}")
