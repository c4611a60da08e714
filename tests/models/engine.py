"""Every interleaving of a few shipped machines on the worst of buses, with crashes between any two effects.

What was said may be heard by any machine at any later time, in any order, often or never. Looked for: what must never
be (``Part.wrong``), and traps: states from which the goal is not reached though all live and nothing is lost any more.

What a machine does about an event is done in order; it crashes before any of it, or hears its next word behind all of
it: for words that come as late as they like, nothing in between differs from this. What a machine makes of an event is
worked out once, in its shipped code, and remembered by what decides it (``snapshot.essence``).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

from onboard.contract.messages import CallForProposals, Message
from tests.models.at_work import AtWork, Deed, Entry, Moved
from tests.models.packed import Search, Split, Verdict
from tests.models.snapshot import WHILE_US, copied, essence
from tests.models.table import Table, ones, put

#: Whiles in which all must have come to its end once nothing fails any more.
PATIENCE = 16


class Lasting(NamedTuple):
    """What outlives a controller: its journal's entries and its body's state."""

    journal: tuple[tuple[tuple[str, str | int], ...], ...]
    body: Any


class State(NamedTuple):
    """Of each machine what decides what it does (None while it is down) and what outlives it; and the bus.

    All but the count are numbers of things in the engine's tables; ``bus`` has a bit for each word said.
    """

    minds: tuple[int | None, ...]
    lasting: tuple[int, ...]
    bus: int
    crashes: int


class Explored(Protocol):
    """One machine that words and time drive; each method returns what it does in order."""

    def starts(self) -> list[Deed]:
        """Power-up."""

    def hears(self, word: Message) -> list[Deed]:
        """A word of another machine."""

    def waits(self, down: Iterable[int]) -> list[Deed]:
        """A while has passed; who is ``down`` has been silent for long."""

    def sleeps(self) -> list[Deed]:
        """A while has passed in which it did nothing."""


class Part(Protocol):
    """What is explored: which machines, how they begin, what must not be, and what is to come about."""

    nodes: tuple[int, ...]
    #: Attributes of machines that decide nothing here.
    left_out: frozenset[str]
    #: Whiles that pass without any fault before the exploration begins.
    prelude: int

    def journal(self, node: int) -> tuple[Entry, ...]:
        """What is in a machine's journal at first."""

    def body(self, node: int) -> Any:
        """How its body stands at first."""

    def made(self, node: int, journal: tuple[Entry, ...], body: Any) -> Any:
        """The machine, at power-up."""

    def hears(self, node: int, word: Message) -> bool:
        """Whether a word is anything to a machine: what it is deaf to is lost for it."""

    def is_within(self, machine: Any) -> bool:
        """Whether what comes after is explored still: where numbers only grow, it ends somewhere."""

    def view(self, machine: Any) -> Any:
        """What ``wrong`` and ``is_over`` look at of one machine that is up."""

    def wrong(self, views: tuple[Any, ...]) -> str:
        """What must never be, in words; None stands for a machine that is down."""

    def is_over(self, views: tuple[Any, ...]) -> bool:
        """Whether the goal is reached."""


@dataclass(frozen=True)
class Limits:
    """How much is explored: crashes, states, CPU s.

    With ``sleeps`` a machine may do nothing for a while instead, and remember all: one of its crashes.
    """

    crashes: int = 1
    most_states: int = 1 << 62
    most_s: float = 1e9
    sleeps: bool = False


@dataclass
class Found:
    """What an exploration found: how often it stepped, and the first state of each kind that must not be."""

    states: int = 0
    transitions: int = 0
    is_complete: bool = False
    spent_s: float = 0.0
    why: str = ""
    wrong: State | None = None
    trap: State | None = None
    #: How often shipped code was run; all else was remembered.
    runs: int = 0


#: How a state was come to: who did what, and how many effects of it were carried out (-1 for all).
Step = tuple[str, int, Any, int]


@dataclass
class Engine:
    """What machines do is worked out once; ``packed.Search`` goes through all states, the nearest first."""

    part: Part
    limits: Limits
    found: Found = field(default_factory=Found)
    _minds: Table[Any] = field(default_factory=Table)
    _machines: list[Explored] = field(default_factory=list)
    _views: list[Any] = field(default_factory=list)
    _within: list[bool] = field(default_factory=list)
    _words: Table[Message] = field(default_factory=Table)
    _deeds: Table[tuple[Deed, ...]] = field(default_factory=Table)
    _lasting: Table[Lasting] = field(default_factory=Table)
    _done: dict[tuple[int, int, Any], tuple[int, int]] = field(default_factory=dict)
    _hearings: dict[tuple[int, int, int], list[tuple[int, int, int]]] = field(default_factory=dict)
    _after: dict[tuple[int, int, int], tuple[int, int]] = field(default_factory=dict)
    _started: dict[tuple[int, int], tuple[int, int]] = field(default_factory=dict)
    _ends_well: dict[Any, bool] = field(default_factory=dict)
    _fresh: int = 0
    #: The words that each machine hears at all, as bits of the bus.
    _heeded: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.nodes = self.part.nodes
        self.search = Search[State](self)
        #: All that is on the bus, or all but what is too late for who hears it after a while.
        self.stays = [-1, -1]
        self._judged: dict[Any, str] = {}
        self._heeded = [0] * len(self.nodes)
        assert self._deeds.number(()) == 0, "nothing to do is number 0"

    # --- one machine ---------------------------------------------------------------------------------------------

    def _mind(self, i: int, machine: Explored) -> int:
        number = self._minds.number((i, essence(machine, self.part.left_out)))
        if number == len(self._machines):
            self._machines.append(machine)
            self._views.append(self.part.view(machine))
            self._within.append(self.part.is_within(machine))
        return number

    def _does(self, i: int, mind: int, event: Any) -> tuple[int, int]:
        """What machine i makes of an event: a word by number, who is down while a while passes, or its body's own."""
        known = self._done.get((i, mind, event))
        if known is None:
            self.found.runs += 1
            if isinstance(event, int):
                machine = copied(self._machines[mind])
                deeds = machine.hears(self._words.things[event])
            elif isinstance(event, frozenset):
                machine = copied(self._machines[mind], WHILE_US)
                deeds = machine.waits(event)
            elif event == "sleeps":
                machine = copied(self._machines[mind], WHILE_US)
                deeds = machine.sleeps()
            else:
                machine = copied(self._machines[mind])
                deeds = machine.meets(event)
            known = self._mind(i, machine), self._deeds.number(tuple(deeds))
            self._done[i, mind, event] = known
        return known

    def starts(self, i: int, lasting: int) -> tuple[int, int]:
        """Machine i at power-up, and its first deeds."""
        known = self._started.get((i, lasting))
        if known is None:
            self.found.runs += 1
            kept = self._lasting.things[lasting]
            machine = self.part.made(self.nodes[i], tuple(dict(line) for line in kept.journal), kept.body)
            deeds = machine.starts()
            known = self._started[i, lasting] = self._mind(i, machine), self._deeds.number(tuple(deeds))
        return known

    def _carried_out(self, lasting: int, deeds: int, most: int) -> tuple[int, int]:
        """What lasts, and what is on the bus, after the first so many deeds."""
        known = self._after.get((lasting, deeds, most))
        if known is None:
            (journal, body), said = self._lasting.things[lasting], 0
            for deed in self._deeds.things[deeds][:most]:
                match deed:
                    case Message():
                        said |= 1 << self._word(deed)
                    case Moved(state=state):
                        body = state
                    case _:
                        journal = (*journal, deed)
            known = self._after[lasting, deeds, most] = self._lasting.number(Lasting(journal, body)), said
        return known

    def _word(self, word: Message) -> int:
        known = len(self._words.things)
        number = self._words.number(word)
        if number == known:
            for i, node in enumerate(self.nodes):
                self._heeded[i] |= (node != word.sender and self.part.hears(node, word)) << number
        if isinstance(word, CallForProposals):
            self._fresh |= 1 << number
            self.stays[1] = ~self._fresh
        return number

    # --- all of them ---------------------------------------------------------------------------------------------

    def heeds(self, i: int) -> int:
        """The words that machine i hears at all."""
        return self._heeded[i]

    def split(self, state: State) -> Split:
        """What decides what each does and what outlives it."""
        return Split(tuple(zip(state.minds, state.lasting, strict=True)), state.crashes, state.bus)

    def join(self, split: Split) -> State:
        """The state of these parts."""
        parts: Any = split.parts
        minds, lasting = zip(*parts, strict=True)
        return State(minds, lasting, split.bus, split.faults)

    def moves(self, state: State, i: int) -> Iterator[State]:
        """It hears any word."""
        return (after for after, _ in self._hears(state, i))

    def alone(self, state: State) -> Iterator[tuple[State, int]]:
        """One starts or crashes, or a while passes."""
        yield from ((after, 0) for after, _ in self._at_any_time(state))
        yield from ((after, 1) for after, _ in self._later(state))

    def steps(self, state: State) -> Iterator[tuple[State, Step]]:
        """All states that may come next, and how."""
        for i in range(len(self.nodes)):
            yield from self._hears(state, i)
        yield from self._at_any_time(state)
        yield from self._later(state)

    def _hears(self, state: State, i: int) -> Iterator[tuple[State, Step]]:
        mind = state.minds[i]
        for word, after, deeds in [] if mind is None else self._heard(i, mind, state.bus):
            yield from self._outcomes(state, i, after, deeds, ("hears", i, word, -1))

    def _at_any_time(self, state: State) -> Iterator[tuple[State, Step]]:
        minds, lasting, bus, crashes = state
        for i, mind in enumerate(minds):
            if mind is None:
                after, deeds = self.starts(i, lasting[i])
                yield from self._outcomes(state, i, after, deeds, ("starts", i, None, -1))
            elif crashes < self.limits.crashes:
                yield State(put(minds, i, None), lasting, bus, crashes + 1), ("crashes", i, None, -1)

    def _later(self, state: State) -> Iterator[tuple[State, Step]]:
        yield from self._while(state)
        if self.limits.sleeps and state.crashes < self.limits.crashes:
            yield from self._sleep(state)

    def _heard(self, i: int, mind: int, bus: int) -> list[tuple[int, int, int]]:
        """Each word on the bus by which anything changes with machine i: the word, its mind after it and its deeds."""
        bus &= self._heeded[i]
        known = self._hearings.get((i, mind, bus))
        if known is None:
            known = []
            for word in ones(bus):
                after, deeds = self._does(i, mind, word)
                if (after != mind or deeds) and self._within[after]:
                    known.append((word, after, deeds))
            self._hearings[i, mind, bus] = known
        return known

    def _outcomes(self, state: State, i: int, after: int, deeds: int, step: Step) -> Iterator[tuple[State, Step]]:
        """All deeds are done, or the machine crashes after some of them."""
        minds, lasting, bus, crashes = state
        count = len(self._deeds.things[deeds]) if deeds else 0
        kept, said = self._carried_out(lasting[i], deeds, count)
        yield State(put(minds, i, after), put(lasting, i, kept), bus | said, crashes), step
        if crashes < self.limits.crashes:
            for most in range(1, count + 1):
                kept, said = self._carried_out(lasting[i], deeds, most)
                down = State(put(minds, i, None), put(lasting, i, kept), bus | said, crashes + 1)
                yield down, (step[0], i, step[2], most)

    def _while(self, state: State) -> Iterator[tuple[State, Step]]:
        """A while passes for all that are up; one of them may crash in the middle of what it does then."""
        down = frozenset(self.nodes[i] for i, mind in enumerate(state.minds) if mind is None)
        base = state._replace(bus=state.bus & ~self._fresh)
        done = []
        for i, mind in enumerate(state.minds):
            if mind is not None:
                after, deeds = self._does(i, mind, down)
                if not self._within[after]:
                    return
                done.append((i, after, deeds))
        whole = base
        for i, after, deeds in done:
            whole = self._all_done(whole, i, after, deeds)
        yield whole, ("waits", -1, down, -1)
        if state.crashes < self.limits.crashes:
            for i, _, deeds in done:
                rest = base
                for j, other, more in done:
                    if j != i:
                        rest = self._all_done(rest, j, other, more)
                for most in range(1, len(self._deeds.things[deeds]) + 1):
                    kept, said = self._carried_out(rest.lasting[i], deeds, most)
                    minds, lasting = put(rest.minds, i, None), put(rest.lasting, i, kept)
                    yield State(minds, lasting, rest.bus | said, state.crashes + 1), ("waits", i, down, most)

    def _sleep(self, state: State) -> Iterator[tuple[State, Step]]:
        """A while passes for all that are up but one, which sleeps through it, and is silent for the others."""
        up = [(i, mind) for i, mind in enumerate(state.minds) if mind is not None]
        down = {self.nodes[i] for i, mind in enumerate(state.minds) if mind is None}
        for sleeper, _ in up:
            after = state._replace(bus=state.bus & ~self._fresh, crashes=state.crashes + 1)
            silent = frozenset(down | {self.nodes[sleeper]})
            done = [(i, *self._does(i, mind, "sleeps" if i == sleeper else silent)) for i, mind in up]
            if all(self._within[mind] for _, mind, _ in done):
                for i, mind, deeds in done:
                    after = self._all_done(after, i, mind, deeds)
                yield after, ("sleeps", sleeper, silent, -1)

    def _all_done(self, state: State, i: int, after: int, deeds: int) -> State:
        kept, said = self._carried_out(state.lasting[i], deeds, len(self._deeds.things[deeds]))
        return State(put(state.minds, i, after), put(state.lasting, i, kept), state.bus | said, state.crashes)

    def _seen(self, state: State) -> tuple[Any, ...]:
        return tuple([None if mind is None else self._views[mind] for mind in state.minds])

    def _judged_by(self, state: State) -> Any:
        """All that ``wrong`` looks at."""
        return state.minds

    # --- traps ---------------------------------------------------------------------------------------------------

    def ends_well(self, state: State) -> bool:
        """Whether, all alive and nothing lost, the goal is reached; what was on the bus before was heard by nobody."""
        path: list[Any] = []
        good = False
        state = state._replace(bus=0)
        for i, mind in enumerate(state.minds):
            if mind is None:
                state = self._all_done(state, i, *self.starts(i, state.lasting[i]))
        for _ in range(PATIENCE):
            key = state.minds, state.bus
            known = self._ends_well.get(key)
            if known is not None:
                good = known
                break
            path.append(key)
            state = self._all_hear(state)
            if self.part.is_over(self._seen(state)):
                good = True
                break
            state = self._passes(state._replace(bus=0))
        for key in path if good else path[:1]:
            self._ends_well[key] = good
        return good

    def _all_hear(self, state: State, heard: list[int] | None = None) -> State:
        """Each hears all that is said, but what it has ``heard``, in turn, until nothing new is said."""
        heard = [0] * len(self.nodes) if heard is None else heard
        while True:
            new = [state.bus & heeds & ~known for heeds, known in zip(self._heeded, heard, strict=True)]
            if not any(new):
                return state
            for i, bits in enumerate(new):
                heard[i] |= bits
                for word in ones(bits):
                    mind = state.minds[i]
                    assert mind is not None
                    state = self._all_done(state, i, *self._does(i, mind, word))

    def said(self, state: State, word: Message) -> State:
        """The same with a word on the bus that somebody said before."""
        return state._replace(bus=state.bus | 1 << self._word(word))

    def machine(self, state: State, i: int) -> AtWork:
        """Machine i in a state in which it is up."""
        mind = state.minds[i]
        assert mind is not None
        machine = self._machines[mind]
        assert isinstance(machine, AtWork)
        return machine

    # --- the search ----------------------------------------------------------------------------------------------

    def begin(self) -> State:
        """All were started, by their journals of before, and heard each other until the part begins."""
        lasting = []
        for node in self.nodes:
            journal = tuple(tuple(entry.items()) for entry in self.part.journal(node))
            lasting.append(self._lasting.number(Lasting(journal, self.part.body(node))))
        state = State((None,) * len(self.nodes), tuple(lasting), 0, 0)
        for i in range(len(self.nodes)):
            state = self._all_done(state, i, *self.starts(i, state.lasting[i]))
        for _ in range(self.part.prelude):
            state = self._passes(self._all_hear(state)._replace(bus=0))
        return state

    def _passes(self, state: State) -> State:
        """A while passes for all, who all are up."""
        for i, mind in enumerate(state.minds):
            assert mind is not None
            state = self._all_done(state, i, *self._does(i, mind, frozenset()))
        return state

    def is_wrong(self, state: State) -> bool:
        """What must never be; it is told in ``found``."""
        what = self._judged_by(state)
        why = self._judged.get(what)
        if why is None:
            why = self._judged[what] = self.part.wrong(self._seen(state))
        if why:
            self.found.wrong, self.found.why = state, why
        return bool(why)

    def verdict(self, state: State) -> Verdict:
        """Whether it is a trap, or at its goal."""
        if not self.ends_well(state):
            self.found.trap, self.found.why = state, "a trap"
            return Verdict.STOP
        return Verdict.OVER if self.part.is_over(self._seen(state)) else Verdict.GOES_ON

    def run(self, late: Iterable[Message] = ()) -> Found:
        """Explore until all is seen, something is wrong or a trap, or the limit is reached.

        Words that are ``late`` are on the bus from the first.
        """
        found, limits = self.found, self.limits
        said = sum({1 << self._word(word) for word in late})
        found.states, found.transitions, found.is_complete, found.spent_s = self.search.run(
            said, limits.most_states, limits.most_s
        )
        return found

    def way(self, state: State) -> list[tuple[State, Step]]:
        """The states on the shortest way to one, each with what was done in it."""
        states = self.search.way(state)
        return [
            (before, next(step for one, step in self.steps(before) if one == after))
            for before, after in pairwise(states)
        ]

    def doing(self, state: State, i: int, event: Any) -> tuple[Deed, ...]:
        """What machine i does about an event in a state; while it is down, at power-up."""
        mind = state.minds[i]
        _, deeds = self.starts(i, state.lasting[i]) if mind is None else self._does(i, mind, event)
        return self._deeds.things[deeds]

    def journal(self, state: State, i: int) -> tuple[tuple[tuple[str, str | int], ...], ...]:
        """What is in machine i's journal."""
        return self._lasting.things[state.lasting[i]].journal

    def told(self, state: State) -> str:
        """How a state was come to, and what it is, for a person."""
        lines = [self._told_step(step) for _, step in self.way(state)]
        for i, node in enumerate(self.nodes):
            mind = state.minds[i]
            lines.append(f"node {node}: {'down' if mind is None else self._views[mind]}")
            lines += [f"    {dict(line)}" for line in self.journal(state, i)]
        return "\n".join(lines)

    def _told_step(self, step: Step) -> str:
        what, i, about, most = step
        who = "all" if i < 0 else f"node {self.nodes[i]}"
        text = f"{who} {what}"
        if what == "hears":
            text += f" {self._words.things[about]}"
        return text if most < 0 else f"{text}, and crashes after {most} of its deeds"
