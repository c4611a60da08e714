"""No forged frame is accepted; the same for as many as one likes: ``python -m tests.seal.forge 100000000``."""

from tests.seal.forge import Forger


def test_none_of_two_thousand_forged_frames_is_accepted() -> None:
    forger = Forger(seed=1)
    assert forger.tries(2_000) == 0
    # The victim was not merely deaf: what node 1 had said before had counted.
    assert forger.victim._nodes[1].last is not None
