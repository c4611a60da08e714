"""A cost survives the wire bit for bit; what is none is no offer."""

from math import inf, nan

import pytest

from onboard.contract.cell import OfferHigh, OfferLow, OfferNodes
from onboard.contract.messages import Reference
from onboard.systems.cell.fields import from_halves, halves
from onboard.systems.cell.goal_frames import GoalsHeard


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
