"""A bid's search in slices: the same bid as at once, and not said where others have planned otherwise meanwhile."""

import pytest

from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import NeededAnswers, Proposal
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.ways.effort import SLICE_STEPS
from onboard.ways.reservations import FOREVER, SlotWindow
from tests.kinds.test_ways_back import carrier_at, fetch, two_lifts, way_back


def asked(searching: CarParkGeneration, call: CallForProposals, slice_steps: int) -> tuple[Proposal, int]:
    """The bid, asked for every millisecond, and the number of slices that it took."""
    searching.effort.slice_steps = slice_steps
    found, slices, now_us = searching.estimate(call, 0), 1, 0
    while isinstance(found, NeededAnswers):
        assert not found.parts
        now_us += 1_000
        found, slices = found.combine((), now_us), slices + 1
        assert slices < 10_000
    assert found is not None
    return found, slices


@pytest.mark.parametrize(("slice_steps", "least"), [(SLICE_STEPS, 1), (1, 4)])
def test_by_slices_it_comes_to_the_same_bid(slice_steps: int, least: int) -> None:
    site = two_lifts()
    searching, at_once = carrier_at(site, way_back(site)), carrier_at(site, way_back(site))
    expected = at_once.estimate(fetch(), 0)
    assert isinstance(expected, Proposal) and expected.stands is None
    found, slices = asked(searching, fetch(), slice_steps)
    assert found._replace(stands=None) == expected
    assert slices >= least
    assert searching.effort.steps > at_once.effort.steps > 0


def test_what_others_plan_while_it_is_searched_is_looked_at_before_the_bid() -> None:
    site = two_lifts()
    searching = carrier_at(site, way_back(site))
    found, _ = asked(searching, fetch(), 1)
    assert found.stands is not None and found.stands(1_000)
    (solution,) = found.program
    through = solution.steps[-1].destination
    reserved = searching.mirror.reservations
    reserved.reserve(77, [SlotWindow(through, 0, FOREVER)])
    assert not found.stands(1_000)
    reserved.release(77)
    assert found.stands(1_000)
