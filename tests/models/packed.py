"""The search of ``Explorer`` with each state as one whole number: many times as fast, and a tenth of the memory.

A state is, from the lowest bit: each node's part (its memory, deeds and journal, by number), the counts, and the bus.
What one node may do depends on its part and the bus alone, and changes no more than these: it is worked out once by
``Explorer`` itself, and kept as what is to be added to the state. What more than one part decides is kept by all parts.
"""

import time
from dataclasses import dataclass, field
from typing import NamedTuple

from tests.models.explorer import Explorer, Found, State
from tests.models.table import Table

#: Bits of a node's part, and of each of the two counts.
_PART_BITS, _COUNT_BITS = 20, 2
_PART, _COUNT = (1 << _PART_BITS) - 1, (1 << _COUNT_BITS) - 1


class _Local(NamedTuple):
    """One node's part of a state: its place among the nodes, and memory, deeds and journal by number."""

    i: int
    memory: int | None
    to_do: int
    journal: int


class _Here(NamedTuple):
    """What is so wherever all parts and counts are these, whatever is on the bus."""

    #: More than one hold the token; nobody ever will again; a node with a sound journal holds for a person.
    is_two: bool
    is_trap: bool
    is_alarm: bool
    #: Parts of the nodes that are up, each with what it does about the bus.
    moving: tuple[tuple[int, dict[int, tuple[int, ...]]], ...]
    #: What comes next but by the bus: a state without one, what stays of the bus (-1: all), and what is said then.
    after: tuple[tuple[int, int, int], ...]


@dataclass
class PackedSearch:
    """One search of an explorer's states, all of them; as ``Explorer.run``."""

    explorer: Explorer
    _locals: Table[_Local] = field(default_factory=Table)
    _moves: list[dict[int, tuple[int, ...]]] = field(default_factory=list)
    _here: dict[int, _Here] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._count_at = _PART_BITS * len(self.explorer.nodes)
        self._bus_at = self._count_at + 2 * _COUNT_BITS
        limits = self.explorer.limits
        assert max(limits.crashes, limits.old_copies) <= _COUNT, "a count has two bits"

    # --- states as numbers ---------------------------------------------------------------------------------------

    def pack(self, state: State) -> int:
        """A state as a number."""
        packed = state.bus << self._bus_at
        packed |= (state.crashes | state.old_copies << _COUNT_BITS) << self._count_at
        parts = zip(state.memory, state.to_do, state.journal, strict=True)
        for i, (memory, to_do, journal) in enumerate(parts):
            packed |= self._part(_Local(i, memory, to_do, journal)) << i * _PART_BITS
        return packed

    def _part(self, local: _Local) -> int:
        number = self._locals.number(local)
        if number == len(self._moves):
            self._moves.append({})
            assert number <= _PART, "a part has 20 bits"
        return number

    def unpack(self, packed: int) -> State:
        """The state that a number stands for."""
        numbers = [packed >> i * _PART_BITS & _PART for i in range(len(self.explorer.nodes))]
        _, memory, to_do, journal = zip(*(self._locals.things[number] for number in numbers), strict=True)
        counts = packed >> self._count_at
        crashes, old_copies = counts & _COUNT, counts >> _COUNT_BITS & _COUNT
        return State(memory, to_do, journal, packed >> self._bus_at, crashes, old_copies)

    # --- what may come next --------------------------------------------------------------------------------------

    def _look(self, ground: int) -> _Here:
        """All that parts and counts decide, without a bus."""
        explorer, state = self.explorer, self.unpack(ground)
        after: list[State] = []
        moving = []
        for i, memory in enumerate(state.memory):
            if memory is None:
                after += explorer._restarts(state, i)
                continue
            if state.crashes < explorer.limits.crashes:
                after.append(explorer._crash(state, i))
            part = ground >> i * _PART_BITS & _PART
            moving.append((i, self._moves[part]))
            if not state.to_do[i]:
                asking = [j for j in range(len(explorer.nodes)) if explorer._asks(state, j, i) and not state.to_do[j]]
                after += [explorer._answers(state, i, j) for j in asking]
        return _Here(
            len(explorer._holders(state)) > 1,
            not explorer.ends_well(state),
            not state.old_copies and explorer._is_doubtful(state),
            tuple(moving),
            tuple(
                (
                    self.pack(one._replace(bus=0)),
                    0 if one.old_copies > state.old_copies else -1,
                    one.bus << self._bus_at,
                )
                for one in after
            ),
        )

    def _does(self, packed: int, i: int, bus: int) -> tuple[int, ...]:
        """What node i may do with this bus, each as what is to be added to the state."""
        explorer, state = self.explorer, self.unpack(packed)
        memory = state.memory[i]
        assert memory is not None
        if state.to_do[i]:
            found = [explorer._carry_out(state, i)]
        else:
            words = [None, *explorer._on_bus(state), *explorer._requests]
            found = list(explorer._hearings(state, i, memory, words))
        added = tuple([self.pack(one) - packed for one in found])
        self._moves[packed >> i * _PART_BITS & _PART][bus] = added
        return added

    # --- the search ----------------------------------------------------------------------------------------------

    def run(self) -> Found:
        """Explore until all is seen, two hold the token, or the time is over."""
        explorer, found, known = self.explorer, self.explorer.found, self._here
        first = self.pack(explorer.begin())
        bus_at, ground_bits = self._bus_at, (1 << self._bus_at) - 1
        seen, waiting = {first}, [first]
        add, push = seen.add, waiting.append
        began_s, taken, transitions = time.process_time(), 0, 0
        while waiting:
            state = waiting.pop()
            ground, bus = state & ground_bits, state >> bus_at
            here = known.get(ground)
            if here is None:
                here = known[ground] = self._look(ground)
                self._judge(here, state)
                if here.is_two:
                    break
            said = state - ground
            for i, moves in here.moving:
                added = moves.get(bus)
                if added is None:
                    added = self._does(state, i, bus)
                transitions += len(added)
                for more in added:
                    after = state + more
                    if after not in seen:
                        add(after)
                        push(after)
            transitions += len(here.after)
            for ahead, stays, words in here.after:
                after = ahead + (said & stays | words)
                if after not in seen:
                    add(after)
                    push(after)
            taken += 1
            if not taken & 0xFFFF and time.process_time() - began_s >= explorer.limits.most_s:
                break
        found.states, found.transitions = len(seen), transitions
        found.is_complete = not waiting and found.two is None
        found.spent_s = time.process_time() - began_s
        return found

    def _judge(self, here: _Here, packed: int) -> None:
        """Keep the first state of each kind that must not be."""
        found = self.explorer.found
        if here.is_two:
            found.two = self.unpack(packed)
        if here.is_trap and found.trap is None:
            found.trap = self.unpack(packed)
        if here.is_alarm and found.alarm is None:
            found.alarm = self.unpack(packed)
