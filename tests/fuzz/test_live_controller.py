"""Live controllers under random and mutated frames: no exception, bounded memory, each drop under its reason.

A minute at most here; a million frames a machine with ``python -m bench.fuzz``.
"""

import pytest

from bus_sim.campaign.fuzz import NO_REST, Fuzzer
from bus_sim.sites import find_site
from onboard.core.codes import Reason

FRAMES = 20_000
#: Items in all tables of one controller; a run of the site without a fuzzer has about a third of it.
MOST_ITEMS = 40_000


@pytest.mark.parametrize("name", ["IOC1", "ER1", "MR1"])
def test_a_controller_survives_whatever_the_wire_brings(name: str) -> None:
    site = find_site("small")
    outcome = Fuzzer(site, site.machine(name)).run(FRAMES)
    assert outcome.errors == []
    assert outcome.uncounted == []
    assert max(outcome.sizes) < MOST_ITEMS
    assert outcome.reasons.keys() >= {Reason.UNKNOWN_IDENTIFIER, Reason.SHORT_FRAME, Reason.VALUE_OUT_OF_RANGE}
    assert outcome.reasons.keys() >= {Reason.OTHER_CONTRACT, Reason.OTHER_SITE, Reason.INCOMPLETE_SET}


def test_a_drop_that_nobody_counts_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    fuzzer = Fuzzer(find_site("small"), find_site("small").machine("MR1"))
    monkeypatch.setattr("onboard.wire.decoder.Decoder.feed", lambda *_: None)
    assert fuzzer.run(500).uncounted


def test_an_exception_in_a_controller_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    fuzzer = Fuzzer(find_site("small"), find_site("small").machine("MR1"))

    def fall(*_: object) -> bool:
        raise RuntimeError("planted")

    monkeypatch.setattr("onboard.core.mirror.Mirror.on_car", fall)
    assert "RuntimeError: planted" in fuzzer.run(2_000).errors


def test_a_controller_that_wakes_for_ever_at_one_moment_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    fuzzer = Fuzzer(find_site("small"), find_site("small").machine("MR1"))
    monkeypatch.setattr("onboard.kinds.car_park.robot.Robot.next_wake", lambda _: 0)
    assert NO_REST in fuzzer.run(500).errors
