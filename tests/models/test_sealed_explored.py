"""The token book behind its seals, and a forger who has everything but the keys; each rule of the seals is needed."""

from collections.abc import Callable

import pytest

from onboard.core.frame import Frame
from onboard.seal import heard, tags
from tests.models.explorer import Limits
from tests.models.sealed import SealedExplorer

#: A node crashes once, and starts again with its journal or an old copy of it.
CRASH = Limits(nodes=2, versions=2, crashes=1, old_copies=1)
CALM = Limits(nodes=2, versions=2, crashes=0)


def test_never_two_holders_and_never_a_trap_whatever_a_forger_says() -> None:
    explorer = SealedExplorer(CRASH)
    found = explorer.run()
    assert (found.two, found.trap, found.alarm, explorer.own) == (None, None, None, None)
    assert found.is_complete and found.states > 5_000 and explorer.tried > 2_000


def test_a_node_that_asks_nobody_after_a_start_believes_what_was_recorded() -> None:
    assert SealedExplorer(CRASH, asks=False).run().two is not None


def _nothing(_: Frame) -> bytes:
    return b""


def _not_its_sender(frame: Frame) -> bytes:
    return frame.arbitration_id.to_bytes(4, "big")[:3] + frame.data


@pytest.mark.parametrize("covered", [_nothing, _not_its_sender])
def test_a_tag_that_is_not_over_all_of_a_frame_is_found(
    covered: Callable[[Frame], bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (tags, heard):
        monkeypatch.setattr(module, "bytes_of", covered)
    explorer = SealedExplorer(CALM)
    assert explorer.run().trap is not None
    assert explorer.own is not None
