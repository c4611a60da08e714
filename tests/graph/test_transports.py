"""Transports to a factory graph: a desk calls for them, and whichever robot does it best has them (row G28)."""

from typing import Any

import pytest

from onboard.contract.codes import TaskPhase
from onboard.contract.graph import VisitList
from onboard.contract.messages import CallForProposals, TaskReport
from tests.graph.test_named_orders import run
from tests.mqtt.ordered import NODE

ORDERS = "onboard/made/orders"
DESK = 9


def order(name: str = "T1", start: str = "1", end: str = "5", **more: Any) -> dict[str, Any]:
    return {"id": name, "from": start, "to": end} | more


@pytest.mark.parametrize("deaths_s", [(), (20.002,), (22.5, 40.0)])
def test_a_transport_is_called_for_by_the_desk_and_its_life_comes_back(deaths_s: tuple[float, ...]) -> None:
    """Given twice; also over the death of the gateway."""
    played, ordered = run([(20.0, ORDERS, order()), (35.0, ORDERS, order())], deaths_s=deaths_s)
    assert played.is_good
    calls = {
        (one.sender, one.task, one.from_station, one.to_station)
        for _, one in played.messages
        if isinstance(one, CallForProposals)
    }
    (mine,) = [one for one in calls if one[1].origin == NODE]
    assert (mine[0], *mine[2:]) == (DESK, 1, 5)
    done = {
        one.sender
        for _, one in played.messages
        if isinstance(one, TaskReport) and one.task == mine[1] and one.phase is TaskPhase.DONE
    }
    assert len(done - {DESK}) == 1
    lives = ordered.lives("made", "T1")
    assert lives[0] == "accepted" and lives[-1] == "done" and "refused" not in lives
    assert deaths_s or lives == ["accepted", "called", "awarded", "done"]
    over = ordered.told("made", "T1")[-1]
    assert over["owner"] == "R1", "it stands next to it"


def test_the_desk_keeps_a_transport_over_its_own_restart() -> None:
    """Power fails right after it has answered; nobody says the order again."""
    played, ordered = run([(20.0, ORDERS, order())], faults=("crash:target=D,at_s=20.03,restart_s=3",))
    assert played.is_good and ordered.lives("made", "T1")[-1] == "done"
    lists = [t for t, one in played.messages if isinstance(one, VisitList) and one.sender == NODE]
    assert len(lists) == 1


def test_what_cannot_be_a_transport_is_refused_with_the_place() -> None:
    wrong = [
        (order(start="77"), "UNKNOWN_PLACE", "$.from"),
        (order(end="p(1,1)"), "UNKNOWN_PLACE", "$.to"),
        ({"id": "x", "from": "1"}, "INCOMPLETE", "$.to"),
        (order(car="1.1"), "UNSUPPORTED", "$.car"),
    ]
    played, ordered = run([(20.0 + 2 * place, ORDERS, one) for place, (one, *_) in enumerate(wrong)])
    assert [(one["reason"], one["path"]) for one in ordered.told("made")] == [(why, path) for _, why, path in wrong]
    assert not [one for _, one in played.messages if isinstance(one, VisitList) and one.sender == NODE]
