"""One search for all explorations: breadth first, every reachable state once, each as one whole number.

From the lowest bit a state is each machine's part by number, a count of faults, and the bus with a bit for each word.
What a machine may do about the bus depends on its part, the count and the words that it heeds: that is worked out once
by the model and kept, as what is to be added to the state and said. What more than one part decides is kept by all
parts. So most transitions cost an addition and a look into a table, 1 to 3 us (docs/figures.md).
"""

import time
from collections import defaultdict, deque
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from tests.models.table import Table

#: Bits of a machine's part, and of the count.
_PART_BITS, _COUNT_BITS = 24, 8
_PART, _COUNT = (1 << _PART_BITS) - 1, (1 << _COUNT_BITS) - 1

State = TypeVar("State")


class Verdict(Enum):
    """What becomes of a state: what follows it is explored; it is at its goal; or nothing good follows: all ends."""

    GOES_ON = 1
    OVER = 2
    STOP = 3


class Split(NamedTuple):
    """A state taken apart: what is each machine's, how many faults there were (below 256), and the bus by bits."""

    parts: tuple[Hashable, ...]
    faults: int
    bus: int


class Model(Protocol[State]):
    """What is explored."""

    @property
    def nodes(self) -> Sequence[int]:
        """Its machines."""

    @property
    def stays(self) -> Sequence[int]:
        """What a step may leave of the bus, as bits; steps name these by their places."""

    def begin(self) -> State:
        """The first state."""

    def split(self, state: State) -> Split:
        """Its parts."""

    def join(self, split: Split) -> State:
        """The state of these parts."""

    def heeds(self, i: int) -> int:
        """The words that are anything to machine i, as bits of the bus."""

    def moves(self, state: State, i: int) -> Iterable[State]:
        """What machine i, which is up, may do about its own and the bus; only its own, the count and the bus change."""

    def alone(self, state: State) -> Iterable[tuple[State, int]]:
        """What else may come next whatever is on the bus, and by its place in ``stays`` what that leaves of it."""

    def is_wrong(self, state: State) -> bool:
        """Whether it must not be, whatever is on the bus; asked as soon as it is come to."""

    def verdict(self, state: State) -> Verdict:
        """What is to be made of it, whatever is on the bus; asked before what follows it is looked for."""


class Seen(NamedTuple):
    """How much was seen in how long, s of processor time; whether it was all."""

    states: int
    transitions: int
    is_complete: bool
    spent_s: float


#: What one machine does, by the words it heeds: what is to be added to a state, and what is said then.
_Moves = dict[int, tuple[tuple[int, int], ...]]


class _Here(NamedTuple):
    """What is so wherever all parts and the count are these."""

    verdict: Verdict
    #: Of each machine that moves, the words that it heeds and what it does about them.
    moving: tuple[tuple[int, _Moves], ...] = ()
    #: What else comes next: a state without a bus, what stays of that, and what is said.
    after: tuple[tuple[int, int, int], ...] = ()


@dataclass
class Search(Generic[State]):
    """All states of a model, until one must not be or a limit is reached."""

    model: Model[State]
    #: From which state each was come to first.
    came_from: dict[int, int] = field(default_factory=dict)
    #: The state that must not be, or from which nothing good follows.
    stopped: State | None = None
    _parts: Table[tuple[int, Any]] = field(default_factory=Table)
    #: By part and count: a machine may crash only while faults are left.
    _moves: dict[int, _Moves] = field(default_factory=lambda: defaultdict(dict))
    _here: dict[int, _Here] = field(default_factory=dict)
    #: Parts and counts that are not wrong.
    _sound: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._count_at = _PART_BITS * len(self.model.nodes)
        self._bus_at = self._count_at + _COUNT_BITS
        self._ground = (1 << self._bus_at) - 1

    # --- states as numbers ---------------------------------------------------------------------------------------

    def pack(self, state: State) -> int:
        """A state as a number."""
        parts, faults, bus = self.model.split(state)
        assert faults <= _COUNT, "the count has eight bits"
        packed = bus << self._bus_at | faults << self._count_at
        for i, part in enumerate(parts):
            packed |= self._part(i, part) << i * _PART_BITS
        return packed

    def _part(self, i: int, part: Any) -> int:
        number = self._parts.number((i, part))
        assert number <= _PART, "a part has 24 bits"
        return number

    def unpack(self, packed: int) -> State:
        """The state that a number stands for."""
        numbers = [packed >> i * _PART_BITS & _PART for i in range(len(self.model.nodes))]
        parts = tuple([self._parts.things[number][1] for number in numbers])
        return self.model.join(Split(parts, packed >> self._count_at & _COUNT, packed >> self._bus_at))

    def way(self, state: State) -> list[State]:
        """The states on the shortest way to one, it at the end."""
        packed, found = self.pack(state), [state]
        while self.came_from.get(packed, packed) != packed:
            packed = self.came_from[packed]
            found.append(self.unpack(packed))
        return found[::-1]

    # --- what may come next --------------------------------------------------------------------------------------

    def _look(self, packed: int) -> _Here:
        verdict = self.model.verdict(self.unpack(packed))
        if verdict is not Verdict.GOES_ON:
            return _Here(verdict)
        ground = self.unpack(packed & self._ground)
        after = []
        for one, stays in self.model.alone(ground):
            ahead = self.pack(one)
            after.append((ahead & self._ground, stays, ahead >> self._bus_at))
        moving = [self._moves_of(packed, i) for i in range(len(self.model.nodes))]
        return _Here(verdict, tuple(enumerate(moving)), tuple(after))

    def _moves_of(self, packed: int, i: int) -> _Moves:
        count = packed >> self._count_at & _COUNT
        return self._moves[count << _PART_BITS | packed >> i * _PART_BITS & _PART]

    def _does(self, packed: int, i: int, bus: int) -> tuple[tuple[int, int], ...]:
        """What machine i may do about the words that it heeds: what is added to the ground, and the bus then."""
        ground = packed & self._ground
        moves = [self.pack(one) for one in self.model.moves(self.unpack(bus << self._bus_at | ground), i)]
        found = tuple([((one & self._ground) - ground, one >> self._bus_at << self._bus_at) for one in moves])
        self._moves_of(packed, i)[bus] = found
        return found

    def _is_wrong(self, packed: int) -> bool:
        state = self.unpack(packed)
        if self.model.is_wrong(state):
            self.stopped = state
            return True
        self._sound.add(packed & self._ground)
        return False

    # --- the search ----------------------------------------------------------------------------------------------

    def run(self, said: int = 0, most_states: int = 1 << 62, most_s: float = 1e9) -> Seen:
        """Explore; words of ``said`` are on the bus from the first."""
        first = self.pack(self.model.begin()) | said << self._bus_at
        came_from, known, sound, waiting = self.came_from, self._here, self._sound, deque([first])
        came_from[first] = first
        bus_at, ground_bits, heeds, stays = self._bus_at, self._ground, self.model.heeds, self.model.stays
        began_s, taken, transitions = time.process_time(), 0, 0
        while waiting and self.stopped is None and len(came_from) < most_states:
            state = waiting.popleft()
            ground, bus = state & ground_bits, state >> bus_at
            here = known.get(ground)
            if here is None:
                here = known[ground] = self._look(state)
            if here.verdict is Verdict.STOP:
                self.stopped = self.unpack(state)
                break
            found = []
            for i, moves in here.moving:
                heard = bus & heeds(i)
                done = moves.get(heard)
                if done is None:
                    done = self._does(state, i, heard)
                for more, words in done:
                    found.append(state + more | words)
            for ahead, left, words in here.after:
                found.append(ahead | (bus & stays[left] | words) << bus_at)
            transitions += len(found) - found.count(state)
            for after in found:
                if after not in came_from:
                    came_from[after] = state
                    waiting.append(after)
                    if after & ground_bits not in sound and self._is_wrong(after):
                        break
            taken += 1
            if not taken & 0xFF and time.process_time() - began_s >= most_s:
                break
        is_complete = not waiting and self.stopped is None
        return Seen(len(came_from), transitions, is_complete, time.process_time() - began_s)
