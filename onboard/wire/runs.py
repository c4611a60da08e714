"""Effects of one decision, with words about segments in line joined (``onboard/contract/runs.py``)."""

from collections.abc import Sequence

from onboard.contract.runs import is_joined, joined
from onboard.core.effects import Effect, Record, Send


def in_runs(effects: Sequence[Effect]) -> Sequence[Effect]:
    """The same effects, words that can be joined said as one behind the records of all of them.

    Only records are passed by: nothing that is said, done or told otherwise comes earlier or later among the others.
    """
    if len(effects) < 2:
        # Most decisions are one word, or none.
        return effects
    found: list[Effect] = []
    waiting: list[Send] = []
    for effect in effects:
        if isinstance(effect, Send) and is_joined(effect.message):
            waiting.append(effect)
            continue
        if waiting and not isinstance(effect, Record):
            found += _said(waiting)
            waiting = []
        found.append(effect)
    return found + _said(waiting)


def _said(waiting: list[Send]) -> list[Effect]:
    return [Send(one) for one in joined([each.message for each in waiting])]
