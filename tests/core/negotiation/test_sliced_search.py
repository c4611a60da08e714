"""A search that takes several turns: it asks nobody, ends before the deadline, and what it found must still hold."""

from collections.abc import Iterator
from dataclasses import dataclass

from onboard.contract.messages import Bid, CallForProposals, Message
from onboard.core.negotiation import NeededAnswers, Proposal
from tests.core.negotiation.fleet import START_US, Costs, Machine, a_call

DEADLINE_US = START_US + 1_000_000
#: What one turn takes a machine.
TURN_US = 40_000


@dataclass
class Slow(Costs):
    """It knows its cost after so many turns, and what it has found first does not hold when it would be said."""

    turns: int = 3
    stale: int = 0
    searches: int = 0

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:  # type: ignore[override]  # that of its base is over at once
        """The first turn."""
        self.searches += 1
        return self._go_on(call, now_us, self.turns)

    def _go_on(self, call: CallForProposals, now_us: int, turns: int) -> Proposal | NeededAnswers | None:
        if turns > 1:
            return NeededAnswers(call.deadline_ms, (), lambda _, then_us: self._go_on(call, then_us, turns - 1))
        found, number = super().estimate(call, now_us), self.searches
        return found if found is None else found._replace(stands=lambda _: number > self.stale)


def said(robot: Machine) -> Iterator[tuple[int, Message]]:
    """All that a robot says of a call, with the time of saying it; it is woken when it is done with a turn."""
    robot.receive(a_call(), START_US)
    now_us = START_US
    while now_us < DEADLINE_US:
        yield from ((now_us, message) for message in robot.wake(now_us))
        due_us = robot.next_wake()
        now_us = max(DEADLINE_US if due_us is None else due_us, now_us + TURN_US)


def test_a_bid_that_takes_turns_to_find_asks_nobody() -> None:
    costs = Slow({1: 0}, turns=5)
    robot = Machine(11, costs)
    ((time_us, bid),) = said(robot)
    assert isinstance(bid, Bid) and time_us >= START_US + 4 * TURN_US
    assert (robot.negotiation.counters.sub_calls_opened, costs.searches) == (0, 1)


def test_what_does_not_hold_any_more_is_not_said_but_searched_again() -> None:
    costs = Slow({1: 0}, turns=3, stale=2)
    ((time_us, bid),) = said(Machine(11, costs))
    assert isinstance(bid, Bid) and costs.searches == 3
    assert time_us >= START_US + 8 * TURN_US


def test_who_finds_nothing_that_holds_in_time_is_silent() -> None:
    for costs in (Slow({1: 0}, turns=1_000), Slow({1: 0}, turns=2, stale=1_000)):
        robot = Machine(11, costs)
        assert list(said(robot)) == []
        assert costs.searches > 10 or costs.turns > 100
        assert robot.committed == set()
