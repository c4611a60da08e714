"""Every interleaving of the shipped token book and witness: a few nodes, one token, and the worst of buses.

What was said once may be heard by any node at any later time, in any order, often or never. Nodes crash between any two
effects and start again from their journal, or from an old copy of it; a node that the site does not have says whatever
it likes. Looked for: two holders; and traps, states from which no node ever holds the token again although all live
and nothing is lost any more. An answer to a question at a restart is heard whole or not at all, within that life; where
a node starts from an old copy all others live, as who is away can be no witness, and what was said before is heard no
more: to change a medium takes longer than any frame.

``python -m tests.models.explore --help`` explores more than the gate does.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from onboard.contract.messages import (
    Message,
    SyncDone,
    SyncRequest,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRequest,
    TokenSeen,
)
from onboard.core.authority import TokenBook, genesis_holder
from onboard.core.effects import Effect, Record, Send
from onboard.holon.witness import Witness
from tests.core.token_words import hear
from tests.models.packed import Search, Split, Verdict
from tests.models.remembered import KEY, NOW_US, SITE, Memory, load, saved, witness_of
from tests.models.table import Table, ones, put

#: No machine of the site.
GHOST = 240
#: One line of a journal: record, version, holder.
Line = tuple[str, int, int]
Journal = tuple[Line, ...]
#: What a node has yet to do: lines for its journal and words for the bus.
Deeds = tuple[Line | Message, ...]


class State(NamedTuple):
    """Of each node: its memory (None while it is down), what it has yet to do, its journal; and the bus.

    All but the counts are numbers of things in the explorer's tables; ``bus`` has a bit for each word said.
    """

    memory: tuple[int | None, ...]
    to_do: tuple[int, ...]
    journal: tuple[int, ...]
    bus: int
    crashes: int
    old_copies: int
    #: Of sealed exploration: each node's gate.
    gates: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Limits:
    """How much is explored: nodes, newest version, crashes, starts from an old copy of the journal; a ghost; CPU s."""

    nodes: int = 3
    versions: int = 2
    crashes: int = 1
    old_copies: int = 0
    has_ghost: bool = False
    most_s: float = 1e9


@dataclass
class Found:
    """What an exploration found; ``two`` and ``trap`` are the first states of their kind."""

    states: int = 0
    transitions: int = 0
    is_complete: bool = False
    two: State | None = None
    trap: State | None = None
    spent_s: float = 0.0
    held_for_a_person: int = 0
    #: A node with a sound journal that holds for a person all the same.
    alarm: State | None = None


@dataclass
class Explorer:
    """What a node does with a word is worked out once for each memory; ``packed.Search`` goes through all states."""

    limits: Limits
    found: Found = field(default_factory=Found)
    _memories: Table[Memory] = field(default_factory=Table)
    _words: Table[Message] = field(default_factory=Table)
    _deeds: Table[Deeds] = field(default_factory=Table)
    _journals: Table[Journal] = field(default_factory=Table)
    _done: dict[tuple[int, int, Message | None], tuple[int, int]] = field(default_factory=dict)
    _seen_starting: dict[tuple[int, int, int], int] = field(default_factory=dict)
    _started: dict[tuple[int, int], tuple[Memory, Deeds]] = field(default_factory=dict)
    _hold: dict[tuple[int, int], bool] = field(default_factory=dict)
    _ends_well: dict[Any, bool] = field(default_factory=dict)
    _ghosts: int = 0

    def __post_init__(self) -> None:
        self.search: Search[State] | None = None
        first = genesis_holder(SITE, KEY)
        others = [node for node in sorted(SITE.machines) if node != first]
        self.nodes = [first, *others][: self.limits.nodes]
        assert self._deeds.number(()) == 0, "nothing to do is number 0"
        self._requests = [TokenRequest(node, *KEY, 0, 0, 0) for node in self.nodes]

    # --- one node ----------------------------------------------------------------------------------------------

    def hears(self, i: int, memory: int, word: Message | None) -> tuple[int, int]:
        """What node i makes of a word, None for the time that passes: its memory after it, and its deeds."""
        case = i, memory, word
        known = self._done.get(case)
        if known is None:
            book, witness = load(self.nodes[i], self.nodes, self._memories.things[memory])
            deeds = _deeds(self._handle(book, witness, word))
            known = self._memories.number(saved(book, witness, self.nodes)), self._deeds.number(deeds)
            self._done[case] = known
        return known

    def _handle(self, book: TokenBook, witness: Witness, word: Message | None) -> list[Effect]:
        if word is None:
            return book.wake(NOW_US)
        if isinstance(word, SyncRequest):
            return witness.on_request(word, NOW_US)
        if isinstance(word, SyncDone):
            return witness.on_done(word, NOW_US)
        if isinstance(word, TokenHeld | TokenGrant | TokenGiven | TokenSeen | TokenRequest):
            witness.hear(word, NOW_US)
        return hear(book, word, NOW_US)

    def starts(self, i: int, journal: int) -> tuple[Memory, Deeds]:
        """Node i begins again with what its journal says: its memory, and what it says."""
        known = self._started.get((i, journal))
        if known is None:
            book = TokenBook(SITE, self.nodes[i])
            book.replay(
                {"record": record, "kind": int(KEY.kind), "number": KEY.number, "version": version, "holder": holder}
                for record, version, holder in self._journals.things[journal]
            )
            witness = witness_of(book, self.nodes, Memory())
            known = self._started[i, journal] = saved(book, witness, self.nodes), _deeds(witness.begin(0))
        return known

    def _sees_start(self, j: int, memory: int, started: int) -> int:
        """A live node hears the first heartbeat of one that was started, and asks it."""
        known = self._seen_starting.get((j, memory, started))
        if known is None:
            book, witness = load(self.nodes[j], self.nodes, self._memories.things[memory])
            witness._was_started(started)
            book.asked.add(started)
            known = self._seen_starting[j, memory, started] = self._memories.number(saved(book, witness, self.nodes))
        return known

    def _bits(self, deeds: Deeds) -> int:
        return sum(1 << self._words.number(word) for word in set(deeds) if isinstance(word, Message))

    # --- all of them -------------------------------------------------------------------------------------------

    def _holders(self, state: State) -> list[int]:
        found = []
        for i, memory in enumerate(state.memory):
            if memory is None:
                continue
            holds = self._hold.get((i, memory))
            if holds is None:
                holds = self._hold[i, memory] = _holds(self.nodes[i], self._memories.things[memory])
            if holds:
                found.append(i)
        return found

    def _on_bus(self, state: State) -> Iterator[Message]:
        return (self._words.things[number] for number in ones(state.bus))

    # What may come next (``packed.Model``). The bus is left as it was, or with no more than a ghost says.
    @property
    def stays(self) -> tuple[int, int]:
        """All of the bus, or none of it."""
        return -1, 0

    def heeds(self, i: int) -> int:
        """Any word may be something to any node."""
        return -1

    def split(self, state: State) -> Split:
        """Each node's memory, deeds, journal and gate."""
        gates = state.gates or (None,) * len(self.nodes)
        parts = tuple(zip(state.memory, state.to_do, state.journal, gates, strict=True))
        return Split(parts, state.crashes | state.old_copies << 4, state.bus)

    def join(self, split: Split) -> State:
        """The state of these parts."""
        parts: Any = split.parts
        memory, to_do, journal, gates = zip(*parts, strict=True)
        has_gates = None not in gates
        return State(
            memory, to_do, journal, split.bus, split.faults & 0xF, split.faults >> 4, gates if has_gates else ()
        )

    def moves(self, state: State, i: int) -> Iterator[State]:
        """It does what it has yet to do, or hears a word, or that time has passed."""
        memory = state.memory[i]
        if memory is None:
            return
        if state.to_do[i]:
            yield self._carry_out(state, i)
        else:
            yield from self._hearings(state, i, memory, [None, *self._on_bus(state), *self._requests])

    def alone(self, state: State) -> Iterator[tuple[State, int]]:
        """A node crashes, starts again, or answers another that asks."""
        for i, memory in enumerate(state.memory):
            if memory is None:
                for one in self._restarts(state, i):
                    yield one, self._left_on_bus(state, one)
                continue
            if state.crashes < self.limits.crashes:
                yield self._crash(state, i), 0
            for j in range(len(self.nodes)):
                if not state.to_do[i] and self._asks(state, j, i) and not state.to_do[j]:
                    yield self._answers(state, i, j), 0

    def is_wrong(self, state: State) -> bool:
        """Two hold the token."""
        return len(self._holders(state)) > 1

    def verdict(self, state: State) -> Verdict:
        """All is seen; the first trap and the first false alarm are kept."""
        if self.found.trap is None and not self.ends_well(state):
            self.found.trap = state
        if self.found.alarm is None and not state.old_copies and self._is_doubtful(state):
            self.found.alarm = state
        return Verdict.GOES_ON

    def _hearings(self, state: State, i: int, memory: int, words: list[Message | None]) -> Iterator[State]:
        node = self.nodes[i]
        for word in words:
            if word is not None and word.sender == node:
                continue
            after, deeds = self.hears(i, memory, word)
            if (after != memory or deeds) and (self._memories.things[after].seen or 0) <= self.limits.versions:
                yield state._replace(memory=put(state.memory, i, after), to_do=put(state.to_do, i, deeds))

    def _asks(self, state: State, j: int, i: int) -> bool:
        """Whether node j waits for an answer of node i."""
        memory = state.memory[j]
        return memory is not None and self.nodes[i] in self._memories.things[memory].asked

    def _crash(self, state: State, i: int) -> State:
        return state._replace(
            memory=put(state.memory, i, None), to_do=put(state.to_do, i, 0), crashes=state.crashes + 1
        )

    def _restarts(self, state: State, i: int) -> Iterator[State]:
        yield self._restarted(state, i, state.journal[i])
        if state.old_copies < self.limits.old_copies and sum(one is None for one in state.memory) == 1:
            journal = self._journals.things[state.journal[i]]
            for length in range(len(journal)):
                old = state._replace(old_copies=state.old_copies + 1, bus=state.bus | self._ghosts)
                yield self._restarted(old, i, self._journals.number(journal[:length]))

    def _restarted(self, state: State, i: int, journal: int) -> State:
        node = self.nodes[i]
        memory, said = self.starts(i, journal)
        others = [
            one if one is None or j == i else self._sees_start(j, one, node) for j, one in enumerate(state.memory)
        ]
        live = frozenset(self.nodes[j] for j, one in enumerate(others) if one is not None and j != i)
        others[i] = self._memories.number(memory._replace(asked=live, is_synced=not live))
        return self._say(state._replace(memory=tuple(others), journal=put(state.journal, i, journal)), i, said)

    def _left_on_bus(self, before: State, after: State) -> int:
        """What can still be heard, by its place in ``stays``: of before a change of the medium nothing."""
        return 1 if after.old_copies > before.old_copies else 0

    def _say(self, state: State, i: int, deeds: Deeds) -> State:
        """Node i says the words of these deeds."""
        return state._replace(bus=state.bus | self._bits(deeds))

    def _carry_out(self, state: State, i: int) -> State:
        deed, *rest = self._deeds.things[state.to_do[i]]
        after = state._replace(to_do=put(state.to_do, i, self._deeds.number(tuple(rest))))
        if isinstance(deed, Message):
            return self._say(after, i, (deed,))
        journal = self._journals.number((*self._journals.things[state.journal[i]], deed))
        return after._replace(journal=put(state.journal, i, journal))

    def _answers(self, state: State, i: int, j: int) -> State:
        """Node i answers node j: all that it vouches for, heard in one go; the others may hear it or not."""
        memory, asking = state.memory[i], state.memory[j]
        assert memory is not None and asking is not None
        memory, answer = self.hears(i, memory, SyncRequest(self.nodes[j], self.nodes[i]))
        to_do: Deeds = ()
        words = [word for word in self._deeds.things[answer] if isinstance(word, Message)]
        for word in words:
            asking, more = self.hears(j, asking, word)
            to_do += self._deeds.things[more]
        asking = self._trusts(state, asking, j)
        memories = put(put(state.memory, i, memory), j, asking)
        after = state._replace(memory=memories, to_do=put(state.to_do, j, self._deeds.number(to_do)))
        return self._say(after, i, tuple(word for word in words if not isinstance(word, SyncDone)))

    def _trusts(self, state: State, asking: int, j: int) -> int:
        """Once all that live have answered, and nobody knew better, a node's rights are its own."""
        memory = self._memories.things[asking]
        live = {node for node, one in zip(self.nodes, state.memory, strict=True) if one is not None}
        if memory.is_synced or memory.doubt or live - memory.answered - {self.nodes[j]}:
            return asking
        return self._memories.number(memory._replace(is_synced=True))

    # --- traps -------------------------------------------------------------------------------------------------

    def ends_well(self, state: State) -> bool:
        """Whether, all alive and nothing lost, somebody comes to hold the token, or a person is told."""
        state = self._quiet(state)
        start = state.memory, state.journal
        known = self._ends_well.get(start)
        if known is None:
            known = self._ends_well[start] = self._play_on(state._replace(bus=0))
        return known

    def _play_on(self, state: State) -> bool:
        for i, one in enumerate(state.memory):
            if one is None:
                state = self._restarted(state, i, state.journal[i])
        for _ in range(4 * self.limits.nodes):
            for i in range(len(self.nodes)):
                for j in range(len(self.nodes)):
                    if self._asks(state, j, i):
                        state = self._quiet(self._answers(state, i, j))
            if self._is_doubtful(state):
                self.found.held_for_a_person += 1
                return True
            if self._holders(state):
                return True
            state = self._all_hear(state._replace(bus=0))
        return False

    def _is_doubtful(self, state: State) -> bool:
        return any(one is not None and self._memories.things[one].doubt for one in state.memory)

    def _quiet(self, state: State) -> State:
        while any(state.to_do):
            state = self._carry_out(state, next(i for i, to_do in enumerate(state.to_do) if to_do))
        return state

    def _all_hear(self, state: State) -> State:
        """Time passes for all, and each hears all that is said, in turn, until nothing new is said."""
        heard: set[tuple[int, Message]] = set()
        for i in range(len(self.nodes)):
            state = self._one_hears(state, i, None)
        while True:
            new = [(i, word) for word in self._on_bus(state) for i in range(len(self.nodes)) if (i, word) not in heard]
            if not new:
                return state
            for i, word in new:
                heard.add((i, word))
                if word.sender != self.nodes[i]:
                    state = self._one_hears(state, i, word)

    def _one_hears(self, state: State, i: int, word: Message | None) -> State:
        memory = state.memory[i]
        assert memory is not None
        after, deeds = self.hears(i, memory, word)
        return self._quiet(state._replace(memory=put(state.memory, i, after), to_do=put(state.to_do, i, deeds)))

    def told(self, state: State) -> str:
        """A state in full, for a person."""
        lines = []
        for i, node in enumerate(self.nodes):
            memory = state.memory[i]
            lines.append(f"node {node}: {'down' if memory is None else self._memories.things[memory]}")
            lines.append(f"    to do {self._deeds.things[state.to_do[i]]}")
            lines.append(f"    journal {self._journals.things[state.journal[i]]}")
        return "\n".join([*lines, f"bus {list(self._on_bus(state))}"])

    # --- the search ----------------------------------------------------------------------------------------------

    def begin(self) -> State:
        """The token is with its first holder; the ghost has said all that it can."""
        nodes = len(self.nodes)
        said: set[Message] = set()
        if self.limits.has_ghost:
            version = self.limits.versions
            for node in self.nodes:
                said.add(TokenGrant(GHOST, *KEY, version, node))
                said.add(TokenGiven(GHOST, *KEY, version, node))
                said.add(TokenDispute(GHOST, *KEY, version, node))
                said.add(TokenSeen(GHOST, *KEY, version, node))
            said.add(TokenHeld(GHOST, *KEY, version))
        memories = [self._memories.number(Memory(answered=frozenset(self.nodes) - {node})) for node in self.nodes]
        journal = self._journals.number(())
        self._ghosts = self._bits(tuple(said))
        return State(tuple(memories), (0,) * nodes, (journal,) * nodes, self._ghosts, 0, 0)

    def run(self) -> Found:
        """Explore until all is seen, two hold the token, or the time is over."""
        found, self.search = self.found, Search(self)
        seen = self.search.run(most_s=self.limits.most_s)
        found.states, found.transitions, found.is_complete, found.spent_s = seen
        found.two = self.search.stopped
        return found


def _holds(node: int, memory: Memory) -> bool:
    at_first = memory.seen is None and genesis_holder(SITE, KEY) == node
    return memory.is_synced and (memory.held is not None or at_first)


def _deeds(effects: list[Effect]) -> Deeds:
    """What goes to the journal and to the bus; questions are noted by who asks."""
    found: list[Line | Message] = []
    for effect in effects:
        if isinstance(effect, Record):
            entry = effect.entry
            found.append((str(entry["record"]), int(entry["version"]), int(entry["holder"])))
        elif isinstance(effect, Send) and not isinstance(effect.message, SyncRequest):
            found.append(effect.message)
    return tuple(found)
