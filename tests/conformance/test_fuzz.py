"""Live controllers under random and mutated frames: no exception, bounded memory, each drop under its reason.

A minute at most here; a million frames a machine with ``python -m bench.fuzz``.
"""

from functools import cache

import pytest

from bus_sim.campaign.fuzz import Corpus, Fuzzer, record
from bus_sim.sites import find_site
from onboard.contract.codes import Reason
from onboard.core.site import Site
from tests.conformance.cases import CASES
from tests.conformance.runs import one_of_each_kind, site_of
from tests.thinned import is_long

FRAMES = 20_000 if is_long() else 8_000
#: Where a machine's own frames are few, or its device bus is silent, most that can be found is found in so many.
SYSTEM_FRAMES = 8_000 if is_long() else 4_000
#: Items in all tables of one controller; a run of the site without a fuzzer has about a third of it.
MOST_ITEMS = 40_000


@cache
def said_on(name: str) -> Corpus:
    """What all machines of a site are fed with."""
    return record(site_called(name))


def site_called(name: str) -> Site:
    return find_site(name) if name == "small" else site_of(name)


def fuzzer(name: str, machine: str) -> Fuzzer:
    site = site_called(name)
    return Fuzzer(site, site.machine(machine), corpus=said_on(name))


@pytest.mark.parametrize("name", ["IOC1", "ER1", "MR1"])
def test_a_controller_survives_whatever_the_wire_brings(name: str) -> None:
    outcome = fuzzer("small", name).run(FRAMES)
    assert outcome.errors == []
    assert outcome.uncounted == []
    assert max(outcome.sizes) < MOST_ITEMS
    assert outcome.reasons.keys() >= {Reason.UNKNOWN_IDENTIFIER, Reason.SHORT_FRAME, Reason.VALUE_OUT_OF_RANGE}
    assert outcome.reasons.keys() >= {Reason.OTHER_CONTRACT, Reason.OTHER_SITE, Reason.INCOMPLETE_SET}


#: One machine of every kind of the other systems.
MACHINES = [(name, machine) for name in CASES if name != "car-park" for machine in one_of_each_kind(name)]


@pytest.mark.parametrize(("name", "machine"), MACHINES)
def test_a_machine_of_any_system_survives_it_too(name: str, machine: str) -> None:
    outcome = fuzzer(name, machine).run(SYSTEM_FRAMES)
    assert outcome.errors == []
    assert outcome.uncounted == []
    assert max(outcome.sizes) < MOST_ITEMS
    assert outcome.reasons.keys() >= {Reason.UNKNOWN_IDENTIFIER, Reason.SHORT_FRAME, Reason.VALUE_OUT_OF_RANGE}
    assert outcome.reasons.keys() >= {Reason.OTHER_CONTRACT, Reason.OTHER_SITE}


def test_a_drop_that_nobody_counts_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    one = fuzzer("small", "MR1")
    monkeypatch.setattr("onboard.wire.decoder.Decoder.feed", lambda *_: None)
    assert one.run(500).uncounted


def test_an_exception_in_a_controller_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    one = fuzzer("small", "MR1")

    def fall(*_: object) -> bool:
        raise RuntimeError("planted")

    monkeypatch.setattr("onboard.ways.car_words.CarWords.hear", fall)
    assert "RuntimeError: planted" in one.run(2_000).errors


def test_a_controller_that_wakes_for_ever_at_one_moment_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    one = fuzzer("small", "MR1")
    monkeypatch.setattr("onboard.systems.car_park.robot.ParkingRobot.next_wake", lambda _: 0)
    assert any("wakes do not come to rest" in error for error in one.run(500).errors)
