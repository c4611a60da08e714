"""A cost survives the wire bit for bit; what is none is no offer."""

from dataclasses import replace
from math import inf, nan

import pytest

from onboard.contract.cell import OfferHigh, OfferLow, OfferNodes, OfferNodesMore
from onboard.contract.messages import Reference
from onboard.systems.cell.contracts import Goal
from onboard.systems.cell.fields import from_halves, halves
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.goal_frames import GoalsHeard, goal_messages
from tests.core.negotiation.fleet import a_call


@pytest.mark.parametrize("value", [65.2119063886405, 0.1, 0.0, 1e300, 5e-324])
def test_a_cost_keeps_every_bit(value: float) -> None:
    assert from_halves(*halves(value)) == value


@pytest.mark.parametrize("value", [nan, inf, -inf, -1.0])
def test_what_is_no_cost_is_no_offer(value: float) -> None:
    goals_heard, (high, low) = GoalsHeard(), halves(value)
    for message in (OfferHigh(1, 9, 1, high), OfferLow(1, 9, 1, low), OfferNodes(1, 9, 1, 1, 0, 0, 0, 0)):
        goals_heard.hear(message)
    assert goals_heard.offer(1, Reference(9, 1)) is None


def test_an_offer_with_a_frame_missing_is_none() -> None:
    goals_heard, (high, low) = GoalsHeard(), halves(3.5)
    said = [OfferHigh(1, 9, 1, high), OfferLow(1, 9, 1, low), OfferNodes(1, 9, 1, 1, 2, 0, 0, 0)]
    for message in said[1:]:
        goals_heard.hear(message)
    assert goals_heard.offer(1, Reference(9, 1)) is None
    for message in said:
        goals_heard.hear(message)
    offer = goals_heard.offer(1, Reference(9, 1))
    assert offer is not None and (offer.cost, offer.nodes) == (3.5, (1, 2))


def test_an_offer_of_eight_robots_is_whole_with_its_second_frame_only() -> None:
    goals_heard, (high, low) = GoalsHeard(), halves(3.5)
    for message in (OfferHigh(1, 9, 1, high), OfferLow(1, 9, 1, low), OfferNodes(1, 9, 1, 1, 2, 3, 4, 5)):
        goals_heard.hear(message)
    assert goals_heard.offer(1, Reference(9, 1)) is None
    goals_heard.hear(OfferNodesMore(1, 9, 1, 6, 7, 8))
    offer = goals_heard.offer(1, Reference(9, 1))
    assert offer is not None and offer.nodes == (1, 2, 3, 4, 5, 6, 7, 8)


def test_of_a_goal_of_seven_robots_the_last_is_who_says_it() -> None:
    path = tuple(range(11, 18))
    goal = Goal(Reference(17, 3), Reference(9, 1), Point(1, 2), Point(3, 4), path, 0, 7)
    goals_heard, call = GoalsHeard(), replace(a_call(17), task=goal.task, car=goal.part, depth=7)
    for message in goal_messages(goal):
        goals_heard.hear(message)
    assert goals_heard.goal(call) == goal
