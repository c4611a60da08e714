"""Only who holds a token can refuse it; a word of anybody else keeps nobody from asking."""

from collections.abc import Iterator

from onboard.contract.codes import Reason
from onboard.contract.messages import TokenRefusal, TokenRequest
from onboard.core.authority import TokenBook, segment_token
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Negotiation
from onboard.core.site import Segment
from onboard.holon.rights import RightsTalk
from onboard.holon.witness import Witness
from onboard.work.plain import NoEstimator
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ME, OTHER = 1, 11, 12
KEY = segment_token(Segment(1, 7))


def talk_of(node: int, verdicts: Iterator[Reason]) -> RightsTalk:
    tokens, mirror, machine = TokenBook(SITE, node), Mirror(SITE, node), SITE.machines[node]
    negotiation = Negotiation(node, machine.kind, SITE.timing, NoEstimator())
    witness = Witness(tokens, mirror, 1, has_past=False, statements=lambda _: [])
    return RightsTalk(Fleet(SITE, machine, tokens, mirror, negotiation), lambda *_: next(verdicts), witness)


def test_who_asks_seldom_is_told_once_that_the_holder_sees_another_order_by_now() -> None:
    later, behind = Reason.TOKEN_NOT_GRANTABLE_YET, Reason.MIRROR_BEHIND
    steward = talk_of(STEWARD, iter([later, later, behind, behind, behind, behind]))
    hear, request = steward.handlers()[TokenRequest], TokenRequest(ME, *KEY, 0, 3, OTHER)
    repeat_us = SITE.timing.token_repeat_us

    def refusals(effects: list[Effect]) -> list[Reason]:
        said = (effect.message for effect in effects if isinstance(effect, Send))
        return [message.reason for message in said if isinstance(message, TokenRefusal)]

    assert refusals(hear(request, 0)) == [later]
    looks = [refusals(steward.serve_petitions(number * repeat_us)) for number in (1, 2, 3)]
    assert looks == [[], [behind], []]
    assert refusals(hear(request, 4 * repeat_us)) == [behind]
    assert refusals(steward.serve_petitions(5 * repeat_us)) == []


def test_a_refusal_counts_only_from_whom_i_believe_to_hold_the_token() -> None:
    talk = talk_of(ME, iter(()))
    tokens, fleet, hear = talk.tokens, talk.fleet, talk.handlers()[TokenRefusal]
    tokens.want(KEY, 0)
    hear(TokenRefusal(OTHER, *KEY, 0, ME, Reason.MIRROR_BEHIND), 1_000)
    assert KEY not in tokens.refused
    assert KEY not in tokens.behind_since_us, "or it would give up an agreed order for a stranger's word"
    assert fleet.drops[Reason.NOT_THE_HOLDER] == 1
    hear(TokenRefusal(STEWARD, *KEY, 0, ME, Reason.MIRROR_BEHIND), 2_000)
    assert tokens.refused[KEY] is Reason.MIRROR_BEHIND
