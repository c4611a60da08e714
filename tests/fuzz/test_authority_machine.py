"""Tokens under whatever a bus and a power supply may do: never two holders, and everything settles in the end."""

from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from onboard.contract.codes import Reason
from onboard.contract.messages import Message
from onboard.core.authority import TokenBook, TokenKey, segment_token, station_token
from onboard.core.effects import Effect, Record, Send
from onboard.core.site import Segment
from tests.core.token_words import hear
from tests.sites import one_floor

SITE = one_floor(2)
NODES = (1, 11, 12)
KEYS = (segment_token(Segment(1, 3)), segment_token(Segment(1, 12)), station_token(SITE.places[0]))
#: Most messages kept: one that is older is as good as lost.
MOST_SAID = 60

nodes, keys = st.sampled_from(NODES), st.sampled_from(KEYS)
#: After so many effects the power fails; most of the time it does not.
cuts = st.sampled_from([99] * 6 + [0, 1, 2])


class Tokens(RuleBasedStateMachine):
    """Whatever was said may be heard by any node, at any later time, in any order, often or never."""

    def __init__(self) -> None:
        super().__init__()
        self.books = {node: TokenBook(SITE, node) for node in NODES}
        self.journals: dict[int, list[dict[str, str | int]]] = {node: [] for node in NODES}
        self.said: list[Message] = []
        self.now_us = 0

    def carry_out(self, node: int, effects: list[Effect], cut: int = 99) -> None:
        for number, effect in enumerate(effects):
            if number >= cut:
                break
            if isinstance(effect, Record):
                self.journals[node].append(dict(effect.entry))
            elif isinstance(effect, Send):
                self.said = [*self.said, effect.message][-MOST_SAID:]
        if cut < 99:
            self.books[node] = TokenBook(SITE, node)
            self.books[node].replay(self.journals[node])

    def hear(self, node: int, message: Message, *, is_willing: bool, cut: int = 99) -> None:
        book = self.books[node]
        if message.sender == node:
            return
        verdict = Reason.NONE if is_willing else Reason.TOKEN_NOT_GRANTABLE_YET
        self.carry_out(node, hear(book, message, self.now_us, verdict), cut)

    @rule(node=nodes, key=keys, cut=cuts)
    def wants(self, node: int, key: TokenKey, cut: int) -> None:
        self.carry_out(node, self.books[node].want(key, self.now_us), cut)

    @rule(key=keys, to=nodes, cut=cuts)
    def gives(self, key: TokenKey, to: int, cut: int) -> None:
        for node, book in list(self.books.items()):
            if node != to and book.holds(key):
                self.carry_out(node, book.give(key, to, self.now_us), cut)

    @rule(key=keys, to=nodes, after=st.integers(0, 1))
    def dies_giving(self, key: TokenKey, to: int, after: int) -> None:
        self.gives(key, to, after)

    @rule(back=st.integers(0, 3))
    def all_hear(self, back: int) -> None:
        for node in NODES:
            self.hears(node, back, True, 99)

    @rule(node=nodes, back=st.integers(0, 12), is_willing=st.booleans(), cut=cuts)
    def hears(self, node: int, back: int, is_willing: bool, cut: int) -> None:
        if self.said:
            self.hear(node, self.said[-1 - back % len(self.said)], is_willing=is_willing, cut=cut)

    @rule(node=nodes, later_ms=st.integers(0, 3_000), cut=cuts)
    def wakes(self, node: int, later_ms: int, cut: int) -> None:
        self.now_us += later_ms * 1_000
        self.carry_out(node, self.books[node].wake(self.now_us), cut)

    @invariant()
    def nobody_shares(self) -> None:
        for key in KEYS:
            holders = [node for node, book in self.books.items() if book.holds(key)]
            assert len(holders) <= 1, f"{key} is held by {holders}"

    def teardown(self) -> None:
        """Once nothing is lost any more and everybody is willing, each token has one holder again."""
        for _ in range(12):
            self.now_us += 5_000_000
            self.said = []
            for node in NODES:
                self.carry_out(node, self.books[node].wake(self.now_us))
                self.carry_out(node, self.books[node].statements())
            while self.said:
                message, *self.said = self.said
                for node in NODES:
                    self.hear(node, message, is_willing=False)
        for key in KEYS:
            assert sum(book.holds(key) for book in self.books.values()) == 1, f"{key} is lost"


TestTokens = Tokens.TestCase
TestTokens.settings = settings(
    max_examples=80,
    stateful_step_count=50,
    deadline=None,
    derandomize=True,
    database=None,
    phases=(Phase.generate,),  # shrinking takes longer than the gate has; do it by hand where one fails
)
