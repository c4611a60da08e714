"""Only who holds a token can refuse it; a word of anybody else keeps nobody from asking."""

from onboard.contract.codes import Reason
from onboard.contract.messages import TokenRefusal
from onboard.core.authority import TokenBook, segment_token
from onboard.core.behaviour import Fleet
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


def test_a_refusal_counts_only_from_whom_i_believe_to_hold_the_token() -> None:
    tokens, mirror, machine = TokenBook(SITE, ME), Mirror(SITE, ME), SITE.machines[ME]
    negotiation = Negotiation(ME, machine.kind, SITE.timing, NoEstimator())
    fleet = Fleet(SITE, machine, tokens, mirror, negotiation)
    witness = Witness(tokens, mirror, 1, has_past=False, statements=lambda _: [])
    hear = RightsTalk(fleet, lambda *_: Reason.NONE, witness).handlers()[TokenRefusal]
    tokens.want(KEY, 0)
    hear(TokenRefusal(OTHER, *KEY, 0, ME, Reason.MIRROR_BEHIND), 1_000)
    assert KEY not in tokens.refused
    assert KEY not in tokens.behind_since_us, "or it would give up an agreed order for a stranger's word"
    assert fleet.drops[Reason.NOT_THE_HOLDER] == 1
    hear(TokenRefusal(STEWARD, *KEY, 0, ME, Reason.MIRROR_BEHIND), 2_000)
    assert tokens.refused[KEY] is Reason.MIRROR_BEHIND
