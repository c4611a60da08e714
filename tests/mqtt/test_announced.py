"""A driver says over MQTT when the car will be fetched: noted once by the fleet, told back, and refused in one line."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.codes import OperatorAction
from onboard.contract.messages import OperatorOrder, Reference
from tests.mqtt.ordered import Ordered, park_and_order, said
from tests.system.scene import Scene

#: Power-up is at seven o'clock there.
SITE = replace(find_site("small"), time_zone="Europe/Berlin")
TOPIC = "onboard/small/orders/desk"
CAR = "1.1"
#: Half past eight at the site is so long after power-up, s.
FETCHED_S = 5_400
REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "no-time": ({"car": CAR, "fetch_at": "25:99"}, "MALFORMED", "$.fetch_at"),
    "no-zone": ({"car": CAR, "fetch_at": "2026-03-01T17:30:00"}, "MALFORMED", "$.fetch_at"),
    "past": ({"car": CAR, "fetch_at": "06:59"}, "TOO_LATE", "$.fetch_at"),
    "far": ({"car": CAR, "fetch_at": "2026-03-09T17:30:00Z"}, "TOO_LATE", "$.fetch_at"),
    "not-inside": ({"car": "1.9", "fetch_at": "17:30"}, "UNKNOWN_TICKET", ""),
    "not-from-here": ({"car": "9.9", "fetch_at": "17:30"}, "UNKNOWN_TICKET", "$.car"),
    "whose": ({"fetch_at": "17:30"}, "INCOMPLETE", "$.car"),
    "where": ({"car": CAR, "fetch_at": "17:30", "to": "IOC1"}, "UNSUPPORTED", "$.to"),
    "charged": ({"car": CAR, "fetch_at": "17:30", "charging": True}, "UNSUPPORTED", "$.charging"),
}


@pytest.fixture(scope="module")
def announced() -> tuple[Scene, Ordered]:
    """One car stands inside; its driver says when it will be fetched, changes that, and others make mistakes."""
    bodies = {"A": {"car": CAR, "fetch_at": "08:30"}, "B": {"car": CAR, "fetch_at": "2026-03-01T17:30:00+01:00"}}
    bodies |= {name: body for name, (body, _, _) in REFUSED.items()}
    orders = [(200.0 + 4 * number, TOPIC, {"id": name, **body}) for number, (name, body) in enumerate(bodies.items())]
    return park_and_order(SITE, 1, orders, extra_s=300)


def test_it_is_accepted_done_once_it_is_noted_and_told_to_who_watches(announced: tuple[Scene, Ordered]) -> None:
    scene, ordered = announced
    scene.assert_sound()
    assert ordered.lives("small", "A") == ordered.lives("small", "B") == ["accepted", "done"]
    words = [one for _, one in scene.all(FetchTime, "fleet")]
    assert [one.fetch_word for one in words] == [FetchWord.ASKED, FetchWord.NOTED] * 2
    assert {one.car for one in words} == {Reference(1, 1)}
    assert abs(words[1].fetch_ms - 1_000 * FETCHED_S) < 2_000
    topic = "onboard/small/announcement"
    told = [json.loads(one.payload) for one in ordered.broker.all if one.topic == topic]
    assert [(one["car"], one["by"]) for one in told] == [(CAR, "IOC1")] * 2
    times = [datetime.fromisoformat(one["fetch_at"]) for one in told]
    wanted = [datetime(2026, 3, 1, 7, 30, tzinfo=UTC), datetime(2026, 3, 1, 16, 30, tzinfo=UTC)]
    assert all(abs(one - at) < timedelta(seconds=2) for one, at in zip(times, wanted, strict=True))


def test_nothing_is_fetched_for_it(announced: tuple[Scene, Ordered]) -> None:
    asked = [one.action for one in said(announced[0], OperatorOrder) if isinstance(one, OperatorOrder)]
    assert OperatorAction.INSERT_TICKET not in asked


@pytest.mark.parametrize("name", REFUSED)
def test_a_mistake_is_told_with_its_place(announced: tuple[Scene, Ordered], name: str) -> None:
    _, reason, path = REFUSED[name]
    (told,) = [one for one in announced[1].told("small", name) if one["phase"] == "refused"]
    assert (told["reason"], told.get("path", "")) == (reason, path) and told["why"]
