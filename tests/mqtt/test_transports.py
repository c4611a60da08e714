"""Transports for the car park: taken once, done by whoever bids best, told back to the end."""

from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Operation, OperatorAction
from onboard.contract.messages import Award, CallForProposals, OperatorOrder, Reference
from tests.mqtt.ordered import FatalJournal, Ordered, park_and_order, said
from tests.mqtt.played import MemoryJournal
from tests.sites import at_the_key, one_floor
from tests.system.scene import Scene

ORDERS = "onboard/{}/orders/desk"
SMALL = ORDERS.format("small")
FETCH = {"id": "A7", "car": "1.1", "to": "IOC1"}


@pytest.fixture(scope="module")
def fetched() -> tuple[Scene, Ordered]:
    """One car is fetched; the order comes three times, and a different one under its name."""
    orders = [(200, SMALL, FETCH), (200.2, SMALL, FETCH), (215, SMALL, FETCH), (216, SMALL, FETCH | {"car": "1.2"})]
    return park_and_order(at_the_key(find_site("small")), 1, [*orders, (420, SMALL, FETCH)], extra_s=400)


def retrievals(scene: Scene) -> list[Reference]:
    """Tasks to fetch that somebody won, once each."""
    calls = {
        (call.sender, call.call): call.task
        for _, call in scene.all(CallForProposals)
        if call.operation is Operation.RETRIEVE
    }
    won = [calls.get((one.sender, one.call)) for _, one in scene.all(Award) if one.result is CallResult.AWARDED]
    return list(dict.fromkeys(task for task in won if task is not None))


def test_an_order_becomes_one_task_and_its_life_comes_back(fetched: tuple[Scene, Ordered]) -> None:
    scene, ordered = fetched
    scene.assert_sound()
    assert len(retrievals(scene)) == 1
    lives = [life for life in ordered.lives("small", "A7") if life != "refused"]
    assert lives == ["accepted", "called", "awarded", "moving", "done"]
    done = next(one for one in ordered.told("small", "A7") if one["phase"] == "done")
    assert (done["task"], done["car"], done["owner"]) == ("1.2", "1.1", ordered.told("small", "A7")[-1]["owner"])
    assert {one.get("orderedBy") for one in ordered.told("small", "A7")} == {"desk"}
    assert done["owner"] in ("MR1", "MR2") and done["promised"] > "2026-03-01T06:03:20"


def test_the_same_order_again_is_answered_with_how_it_stands(fetched: tuple[Scene, Ordered]) -> None:
    _, ordered = fetched
    phases = [one["phase"] for one in ordered.told("small", "A7")]
    assert (
        phases.count("accepted") == 2
        and phases[-1] == "done"
        and phases.count("done") == 2
        and phases.count("called") == 1
    )


def test_another_order_under_its_name_is_refused_and_changes_nothing(fetched: tuple[Scene, Ordered]) -> None:
    scene, ordered = fetched
    refused = [one for one in ordered.told("small", "A7") if one["phase"] == "refused"]
    assert [(one["reason"], one["path"]) for one in refused] == [("NAME_TAKEN", "$.id")]
    assert {message.car for message in said(scene, OperatorOrder) if isinstance(message, OperatorOrder)} == {
        Reference(1, 1)
    }


@pytest.mark.parametrize("deaths_s", [(200.001,), (212.0, 230.0), (300.0,)])
def test_an_order_is_one_task_though_the_gateway_dies(deaths_s: tuple[float, ...]) -> None:
    scene, ordered = park_and_order(
        find_site("small"), 1, [(200, SMALL, FETCH), (206, SMALL, FETCH)], deaths_s=deaths_s
    )
    scene.assert_sound()
    assert len(retrievals(scene)) == 1
    phases = [one["phase"] for one in ordered.told("small", "A7")]
    assert phases.count("done") == 1 and "refused" not in phases and len(ordered.gateways) == 1 + len(deaths_s)


def test_an_urgent_order_overtakes_those_that_wait() -> None:
    """Ask 14: of three tickets at one desk the urgent one, which came last, is served first."""
    waiting = [(280 + car / 10, SMALL, {"id": f"o{car}", "car": f"1.{car}", "to": "IOC1"}) for car in (1, 2)]
    urgent = (281, SMALL, {"id": "now", "car": "1.3", "to": "IOC1", "priority": 5})
    scene, _ = park_and_order(at_the_key(find_site("small")), 3, [*waiting, urgent], extra_s=130)
    fetched = [call.car.number for _, call in scene.all(CallForProposals) if call.operation is Operation.RETRIEVE]
    assert fetched[0] == 3
    pressed = [one.action for one in said(scene, OperatorOrder) if isinstance(one, OperatorOrder)]
    assert set(pressed) == {OperatorAction.INSERT_TICKET, OperatorAction.URGENT_TICKET}


def test_a_car_is_parked_to_be_charged_by_the_key_of_who_asks_for_it_also_after_a_restart() -> None:
    """The gateway dies right after it has written the order: the wish is in its journal."""
    order = (20.0, ORDERS.format("sizes"), {"id": "n", "from": "In", "charging": True})
    journal = FatalJournal(written=True)
    scene, ordered = park_and_order(find_site("sizes"), 0, [order], journal=journal, extra_s=80)
    pressed = [(one.compartment, one.action) for one in said(scene, OperatorOrder) if isinstance(one, OperatorOrder)]
    compartment = next(one for one in find_site("sizes").machines.values() if one.name == "In")
    assert pressed == [(compartment.node_id, OperatorAction.CHARGING_KEY)]
    assert "to charge at" in ordered.told("sizes", "n")[-1]["why"]


REFUSED: list[tuple[Any, str, str]] = [
    (b"{", "MALFORMED", "$"),
    (b"\xff\xfe", "MALFORMED", "$"),
    (b"[" * 100_00, "MALFORMED", "$"),
    (b'{"id": NaN}', "MALFORMED", "$"),
    (b" " * 70_000, "OVERSIZED", "$"),
    ({}, "MALFORMED", "$.id"),
    ([], "MALFORMED", "$"),
    ({"id": "a b"}, "MALFORMED", "$.id"),
    ({"id": "x", "car": 7}, "MALFORMED", "$.car"),
    ({"id": "x", "color": "red"}, "MALFORMED", "$.color"),
    ({"id": "x", "priority": 10}, "MALFORMED", "$.priority"),
    ({"id": "x", "priority": True}, "MALFORMED", "$.priority"),
    ({"id": "x", "car": "1.1", "to": "IOC1", "before": "soon"}, "MALFORMED", "$.before"),
    ({"id": "x", "car": "1.1", "to": "IOC1", "before": "2026-03-01T06:00:00"}, "MALFORMED", "$.before"),
    ({"id": "x", "car": "1.1", "to": "IOC1", "before": "2026-03-01T06:00:00Z"}, "TOO_LATE", "$.before"),
    ({"id": "x"}, "INCOMPLETE", "$.to"),
    ({"id": "x", "to": "IOC1"}, "INCOMPLETE", "$.car"),
    ({"id": "x", "car": "1.1", "to": "IOC9"}, "UNKNOWN_PLACE", "$.to"),
    ({"id": "x", "from": "p(1,1)N", "to": "IOC1"}, "UNKNOWN_TICKET", "$.from"),
    ({"id": "x", "car": "999.70000", "to": "IOC1"}, "UNKNOWN_TICKET", "$.car"),
    ({"id": "x", "from": "IOC1", "charging": "yes"}, "MALFORMED", "$.charging"),
    ({"id": "x", "from": "IOC1", "charging": True}, "UNSUPPORTED", "$.charging"),
    ({"id": "x", "car": "1.1", "to": "IOC1", "charging": True}, "UNSUPPORTED", "$.charging"),
]


def test_what_cannot_be_taken_is_refused_with_place_and_reason_and_counted() -> None:
    site = one_floor()
    topic = ORDERS.format("test")
    # Two seconds apart, so that none is refused for coming too fast.
    orders = [(10.0 + 2 * number, topic, payload) for number, (payload, _, _) in enumerate(REFUSED)]
    good = {"id": "unknown", "car": "1.9", "to": "IOC1"}
    empty = {"id": "empty", "from": "IOC1"}
    scene, ordered = park_and_order(site, 0, [*orders, (60.0, topic, good), (61.0, topic, empty)], extra_s=110)
    scene.assert_sound()
    told = ordered.told("test")
    refused = [one for one in told if one["phase"] == "refused"]
    assert [(one["reason"], one["path"]) for one in refused[: len(REFUSED)]] == [(r, path) for _, r, path in REFUSED]
    assert all(one["why"] for one in refused)
    desk = ordered.gateways[0].desk
    assert desk is not None and sum(desk.inbox.refused.values()) == len(REFUSED)
    # These two were taken and came to nothing: no such car, and nobody stands in the compartment.
    assert [(one["id"], one["reason"]) for one in refused[len(REFUSED) :]] == [
        *(("unknown", "UNKNOWN_TICKET"), ("empty", "NOT_TAKEN")),
    ]


def test_orders_that_come_too_fast_are_refused_and_none_is_lost_without_a_word() -> None:
    site, topic = one_floor(), ORDERS.format("test")
    burst = [(20.0 + number / 1000, topic, {"id": f"n{number}", "from": "IOC1"}) for number in range(60)]
    _, ordered = park_and_order(site, 0, burst, extra_s=60)
    answered: dict[str, list[str]] = {}
    for one in ordered.told("test"):
        answered.setdefault(one["id"], []).append(one.get("reason", one["phase"]))
    assert len(answered) == 60
    assert sum("TOO_FAST" in words for words in answered.values()) == 40


def test_what_the_disk_cannot_keep_is_not_done() -> None:
    site, topic = one_floor(), ORDERS.format("test")
    journal = MemoryJournal()
    journal.is_full = True
    orders = [(20.0, topic, {"id": "n", "from": "IOC1"})]
    scene, ordered = park_and_order(site, 0, orders, journal=journal, extra_s=60)
    assert [one["reason"] for one in ordered.told("test")] == ["NOT_DURABLE"]
    assert said(scene, OperatorOrder) == []


def test_a_key_is_pressed_once_though_the_gateway_dies_after_it() -> None:
    """The next car in the compartment may be another's."""
    order = (20.0, ORDERS.format("test"), {"id": "n", "from": "IOC1"})
    scene, ordered = park_and_order(one_floor(), 0, [order], deaths_s=(22.0,), extra_s=60)
    assert len(said(scene, OperatorOrder)) == 1
    assert ordered.told("test", "n")[-1]["reason"] == "NOT_TAKEN"
