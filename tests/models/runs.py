"""Segments in line that go as one run, explored: shipped books whose words are joined and taken apart as on the wire.

One robot wants a way of two segments and gives it back in one, another wants only the farther one: so their versions
drift apart, and a part of the run is elsewhere. Frames of runs are lost, late and doubled as all are.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from bus_sim.sites import find_site
from onboard.contract.codes import Reason
from onboard.contract.messages import Message
from onboard.contract.runs import singles
from onboard.core.authority import TokenBook, TokenKey, genesis_holder, segment_token
from onboard.core.effects import Effect, Record, Send
from onboard.core.site import Segment
from onboard.systems.car_park.site import car_park
from onboard.wire.runs import in_runs
from tests.core.token_words import hear
from tests.models.at_work import Deed, Entry
from tests.models.snapshot import NOW_US

SITE = car_park(find_site("small"))
NEAR, FAR = WAY = segment_token(Segment(1, 2)), segment_token(Segment(1, 3))
STEWARD = genesis_holder(SITE, NEAR)
#: Who wants all of the way, and who wants its far end.
PASSES, STANDS = 11, 12
WANTS = {STEWARD: (), PASSES: WAY, STANDS: (FAR,)}
#: Attributes of a book by which nothing is decided here: counts, what never changes, and how often it was said.
LEFT_OUT = frozenset(["site", "node", "changes", "drops", "claimants", "gifts", "hints", "backoff"])


class View(NamedTuple):
    """Of one machine that is up: what it holds, what is on its way, and what it has had and given back."""

    held: frozenset[TokenKey]
    leaving: frozenset[TokenKey]
    passed: bool


@dataclass
class Traveller:
    """A book of rights and what its machine wants: all of it, and then to be rid of it."""

    node: int
    entries: tuple[Entry, ...] = ()
    book: TokenBook = field(init=False)

    def __post_init__(self) -> None:
        self.book = TokenBook(SITE, self.node)
        self.book.replay(self.entries)
        self.verdict = Reason.NONE if self.node == STEWARD else Reason.TOKEN_NOT_GRANTABLE_YET

    def starts(self) -> list[Deed]:
        """Power-up with a whole journal: what it holds is said."""
        return _deeds(self.book.statements())

    def hears(self, word: Message) -> list[Deed]:
        """A word of another machine, or as many as it is good for."""
        effects: list[Effect] = []
        for one in singles(word):
            effects += hear(self.book, one, NOW_US, self.verdict)
        return _deeds(effects)

    def waits(self, down: Iterable[int]) -> list[Deed]:
        """A while has passed: what waits is said again, and a way that was passed goes back."""
        book, effects = self.book, list[Effect]()
        # Who has passed wants no more, and has no use for what comes late.
        wanted = [key for key in WANTS[self.node] if key not in book.given]
        if self.node != STEWARD and all(book.holds(key) for key in wanted):
            for key in [key for key in WAY if book.holds(key)]:
                effects += book.give(key, STEWARD, NOW_US)
        for key in wanted:
            effects += book.want(key, NOW_US) if key not in book.given else []
        return _deeds(effects + book.wake(NOW_US))


def _deeds(effects: list[Effect]) -> list[Deed]:
    deeds: list[Deed] = []
    for effect in in_runs(effects):
        if isinstance(effect, Record):
            deeds.append(tuple(effect.entry.items()))
        elif isinstance(effect, Send):
            deeds.append(effect.message)
    return deeds


@dataclass
class RunPart:
    """The steward of a way and those who want it; explored until a version is newer than ``versions``."""

    versions: int = 4
    nodes: tuple[int, ...] = (STEWARD, PASSES, STANDS)
    left_out: frozenset[str] = LEFT_OUT
    prelude: int = 0

    def journal(self, node: int) -> tuple[Entry, ...]:
        """Nothing has moved yet."""
        return ()

    def body(self, node: int) -> Any:
        """None of them has one."""
        return None

    def made(self, node: int, journal: tuple[Entry, ...], body: Any) -> Traveller:
        """With its journal only."""
        return Traveller(node, journal)

    def hears(self, node: int, word: Message) -> bool:
        """All that is said."""
        return True

    def is_within(self, machine: Traveller) -> bool:
        """As long as versions are few."""
        return max(machine.book.seen.values(), default=0) <= self.versions

    def view(self, machine: Traveller) -> View:
        """Which of the way it has."""
        book = machine.book
        held = frozenset(key for key in WAY if book.holds(key))
        passed = all(key in book.given for key in WANTS[machine.node])
        return View(held, frozenset(book.leaving), passed)

    def wrong(self, views: tuple[Any, ...]) -> str:
        """Two that hold one segment."""
        held = [key for view in views if view is not None for key in view.held]
        return "two hold a segment" if len(held) > len(set(held)) else ""

    def is_over(self, views: tuple[Any, ...]) -> bool:
        """All have passed, and all is with its steward again."""
        return all(view is not None and view.passed for view in views) and len(views[0].held) == len(WAY)
