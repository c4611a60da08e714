"""The robot's task-generation function that asks the lifts before it bids (row P39, ``rides = "before"``).

It plans on the mirror, calls each ride of that plan, and bids with what the lifts answer: they know the options that
they have given to others, which no mirror shows. Where a lift answers later than planned, the robot plans anew with
that lift taken until then, and asks again for what has changed.
"""

from dataclasses import dataclass

from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import NeededAnswers, Proposal, SubCallAnswer
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.systems.car_park.alternatives import Alternative
from onboard.systems.car_park.generation import CarParkGeneration, Solution
from onboard.systems.car_park.program import CarStep
from onboard.systems.car_park.ride_calls import answer_for, ride_terms, rides_of
from onboard.ways.lift_uses import ride_us
from onboard.ways.lifts import platform
from onboard.ways.occupancy import itinerary_windows
from onboard.ways.reservations import SlotWindow, Use

#: A ride planned this much earlier than the lift has answered still counts as what it answered: the sub-call told its
#: begin in steps of 100 ms, rounded up, and ends are whole milliseconds.
TOLERANCE_US = 110_000
#: Rounds of questions for one bid. What a further round would change is called for after winning.
MAX_ROUNDS = 2


@dataclass
class AskingGeneration(CarParkGeneration):
    """As its base, but an estimate with rides in it needs the lifts' answers first."""

    def answer(
        self, call: CallForProposals, solution: Solution, alternatives: list[Alternative], now_us: int
    ) -> Proposal | NeededAnswers:
        """The bid where the best solution rides no lift; else what the lifts must be asked."""
        return self._next(call, solution, alternatives, (), 1, now_us)

    def renewed(self, call: CallForProposals, promised: Solution, now_us: int) -> Solution:
        """What was promised, as the lifts hold it for that, unless the robot or the others have moved meanwhile."""
        kept, origin, _ = self._start(call, now_us, behind_bids=False)
        if origin == promised.origin and now_us <= promised.start_us and not self._is_taken(call, promised, now_us):
            return promised._replace(kept=kept)
        return super().renewed(call, promised, now_us)

    def _is_taken(self, call: CallForProposals, promised: Solution, now_us: int) -> bool:
        offer = self._offer(call, promised._replace(kept=0))
        windows = itinerary_windows(self.site, offer, now_us, promised.start_us)
        return bool(self.mirror.reservations.conflicts(self.machine.node_id, windows))

    # --- questions ---------------------------------------------------------------------------------------------

    def _next(
        self,
        call: CallForProposals,
        solution: Solution,
        alternatives: list[Alternative],
        answers: tuple[SubCallAnswer, ...],
        number: int,
        now_us: int,
    ) -> Proposal | NeededAnswers:
        """Ask for the rides that no lift has promised yet in round ``number``, or bid."""
        rides = rides_of(solution.steps)
        open_rides = [step for step in rides if not self._is_promised(call, step, answers, now_us)]
        if not open_rides or number > MAX_ROUNDS:
            found = [answer_for(ride_terms(self.site, call, step), answers) for step in rides if step not in open_rides]
            parts = tuple(sorted({answer.part for answer in found if answer is not None}))
            return self.proposal(call, solution, alternatives)._replace(parts=parts)

        def combine(heard: tuple[SubCallAnswer, ...], then_us: int) -> Proposal | NeededAnswers | None:
            return self._combine(call, solution, alternatives, heard, number + 1, then_us)

        wanted = tuple(ride_terms(self.site, call, step) for step in open_rides)
        return NeededAnswers(to_bus_ms(solution.finish_us), wanted, combine)

    def _combine(
        self,
        call: CallForProposals,
        solution: Solution,
        alternatives: list[Alternative],
        answers: tuple[SubCallAnswer, ...],
        number: int,
        now_us: int,
    ) -> Proposal | NeededAnswers | None:
        late = self._late_uses(call, solution, answers, now_us)
        if late:
            again, alternatives = self._solve_around(call, late, now_us)
            if again is None:
                return None
            solution = again
        return self._next(call, solution, alternatives, answers, number, now_us)

    def _is_promised(
        self, call: CallForProposals, step: CarStep, answers: tuple[SubCallAnswer, ...], now_us: int
    ) -> bool:
        answer = answer_for(ride_terms(self.site, call, step), answers)
        return answer is not None and abs(from_bus_ms(answer.cost, now_us) - step.end_us) <= TOLERANCE_US

    def _late_uses(
        self, call: CallForProposals, solution: Solution, answers: tuple[SubCallAnswer, ...], now_us: int
    ) -> list[Use]:
        """For each ride that its lift does not give so early: the lift taken by others until it does."""
        late = []
        free_us = dict.fromkeys((step.track for step in rides_of(solution.steps)), now_us)
        for step in rides_of(solution.steps):
            answer = answer_for(ride_terms(self.site, call, step), answers)
            end_us = step.end_us if answer is None else from_bus_ms(answer.cost, now_us)
            begin_us = end_us - ride_us(self.site, step.track, step.from_index, step.to_index)
            if end_us > step.end_us + TOLERANCE_US and begin_us > free_us[step.track]:
                steward = self.site.stewards[step.track]
                late.append(Use(step.track, step.from_index, step.from_index, free_us[step.track], begin_us, steward))
            free_us[step.track] = end_us
        return late

    def _solve_around(
        self, call: CallForProposals, late: list[Use], now_us: int
    ) -> tuple[Solution | None, list[Alternative]]:
        """All solutions with some lifts taken for a while; the mirror is as it was afterwards."""
        reservations = self.mirror.reservations
        for use in late:
            reservations.reserve(use.owner, [SlotWindow(platform(use.lift_track), use.from_us, use.to_us)], [use])
        try:
            return self.solve(call, now_us)
        finally:
            for owner in sorted({use.owner for use in late}):
                reservations.release(owner)
