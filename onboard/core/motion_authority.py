"""The one function that permits motion (design, section 5)."""

from collections.abc import Callable
from dataclasses import dataclass

from onboard.core.authority import TokenBook, segment_token
from onboard.core.codes import Reason
from onboard.core.site import Segment


def needs_no_proof(segment: Segment) -> Reason:
    """The token of a slot that is always there is enough."""
    return Reason.NONE


@dataclass(frozen=True, slots=True)
class MotionState:
    """What ``authorised`` looks at: the tokens held and whether the machine may move at all.

    ``proof`` says why a slot whose token is held cannot be entered all the same: nobody said that it is there.
    """

    tokens: TokenBook
    position_known: bool
    stopped: bool
    proof: Callable[[Segment], Reason] = needs_no_proof


def authorised(state: MotionState, segment: Segment) -> tuple[bool, Reason]:
    """Whether this machine's body may be in ``segment`` now, and if not, why not.

    Asked before every movement order and again while the movement runs; nothing else permits motion.
    """
    if state.stopped:
        return False, Reason.OPERATOR
    if not state.position_known:
        return False, Reason.POSITION_UNKNOWN
    key = segment_token(segment)
    if not state.tokens.holds(key):
        return False, state.tokens.refused.get(key, Reason.NOT_AUTHORISED)
    reason = state.proof(segment)
    return reason is Reason.NONE, reason
