"""What a machine says that stands for rights to be made anew: in bursts that the bus has room for, once."""

from dataclasses import replace

import pytest

from onboard.contract.codes import RegenerationPhase, TokenKind
from onboard.contract.messages import Message, Regeneration, TokenHeld
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.site import Site
from onboard.holon.regeneration import BURST, FORGOTTEN_US, PAUSE_US, SAY_AGAIN_US, Regenerating
from tests.sites import one_floor

OPERATOR, LOST, NODE = 251, 1, 11
SITE = one_floor(robots=2)
SECOND = 1_000_000
#: So many bursts it has to say.
BURSTS = 3


class Standing:
    """One machine with many rights, which an operator has frozen; he says so again each second."""

    def __init__(self, site: Site) -> None:
        tokens = TokenBook(site, NODE)
        for number in range(BURSTS * BURST):
            tokens.held[TokenKey(TokenKind.CAR, LOST << 16 | number)] = 1
        self.part = Regenerating(tokens, Mirror(site, NODE), lambda _: [], lambda *_: [])
        self.now_us = SECOND
        #: When what was said of rights.
        self.said: list[tuple[int, Message]] = []

    def stands(self, until_us: int) -> None:
        freeze = Regeneration(OPERATOR, RegenerationPhase.FREEZE, 1, LOST, 0, 0, 0)
        for due_us in range(self.now_us, until_us, 10_000):
            self.now_us = due_us
            self._note(self.part.on_word(freeze, due_us) if due_us % SECOND == 0 else self.part.wake(due_us))

    def _note(self, effects: list[Effect]) -> None:
        words = [one.message for one in effects if isinstance(one, Send)]
        self.said += [(self.now_us, word) for word in words if isinstance(word, TokenHeld)]

    def bursts_us(self) -> list[int]:
        return sorted({time_us for time_us, _ in self.said})


@pytest.mark.parametrize("bitrate", [1_000_000, 125_000, 20_000])
def test_a_burst_of_each_machine_is_over_before_the_next(bitrate: int) -> None:
    site = replace(SITE, bitrate=bitrate)
    standing = Standing(site)
    standing.stands(60 * SECOND)
    first, second, third, *_ = standing.bursts_us()
    all_us = len(site.machines) * BURST * 140 * SECOND // bitrate
    assert second - first == third - second >= max(PAUSE_US, all_us)


def test_nothing_is_begun_anew_before_all_was_said() -> None:
    """On a slow bus one burst takes longer than a missed word is waited for."""
    standing = Standing(replace(SITE, bitrate=10_000))
    standing.stands(4 * SAY_AGAIN_US)
    assert len(standing.bursts_us()) >= 2
    assert len(set(standing.said)) == len(standing.said), "nothing was said twice"


def test_who_still_asks_behind_all_that_was_said_has_missed_something() -> None:
    standing = Standing(SITE)
    standing.stands(SECOND + SAY_AGAIN_US // 2)
    words = [word for _, word in standing.said]
    assert len(words) == BURSTS * BURST
    standing.stands(2 * SECOND + 2 * SAY_AGAIN_US)
    assert [word for _, word in standing.said] == words * 2


def test_a_freeze_that_nobody_says_any_more_is_over() -> None:
    standing = Standing(SITE)
    standing.stands(2 * SECOND)
    assert standing.part.is_frozen
    standing.part.wake(standing.now_us + FORGOTTEN_US + SECOND)
    assert not standing.part.is_frozen
