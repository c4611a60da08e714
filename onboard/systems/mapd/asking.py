"""Who is missed is asked for its words: how soon, how many at once, and how often what was said is said again."""

from collections.abc import Iterable

from onboard.contract.messages import SyncRequest
from onboard.core.effects import Effect, Send

#: Whoever is missed is asked this long after everything else was there, or by the desk from when the step could have
#: begun, and again after as long, us: a lost frame costs less than a step.
ASK_US = 500_000
#: So many are asked at once.
_AT_ONCE = 3
#: What was just said is not said again for another who asks, us: all have heard it.
SAID_US = 100_000
#: Tokens are said again for whoever asks at most this often, us: the same loss makes several ask at once.
TOKENS_SAID_US = 1_000_000


def questions(me: int, missed: Iterable[int]) -> list[Effect]:
    """To the first few of those who are missed, each once."""
    others = [node for node in dict.fromkeys(missed) if node != me]
    return [Send(SyncRequest(me, node)) for node in others[:_AT_ONCE]]
