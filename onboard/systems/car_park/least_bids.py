"""Which bids for a compartment's calls can be true: by what their bidders have told of their work and their place.

A robot does one thing after the other, so no task ends sooner than its way from the end of the work that it has told
would take with nobody in its way. Who bids less would win what others do sooner, and have all customers wait for it.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import Criterion, KindCode
from onboard.contract.messages import Bid, CallForProposals, Itinerary, Progress, Reference
from onboard.core.negotiation import cost_difference
from onboard.core.serial import from_bus_ms
from onboard.core.site import Segment
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import Program
from onboard.systems.car_park.site import car_park
from onboard.ways.mirror import WayFleet, WayMirror
from onboard.ways.told_way import worked

#: A bid that is less than that by no more than this counts, ms: who moves tells its place every few seconds, and may be
#: done half a second sooner than it told. Honest ones were 3.1 s below it at most, with faults (docs/figures.md).
SLACK_MS = 10_000
#: Calls that are remembered: of a compartment few are open at a time.
MOST_CALLS = 16


class LeastCosts:
    """What robots of a site can bid at the least, as one with this ``mirror`` works it out."""

    def __init__(self, mirror: WayMirror) -> None:
        site = car_park(mirror.site)
        # What ways and handling take; nobody drives by it.
        self._robots = CarParkGeneration(site, site.machines[mirror.node_id], mirror, Program(site))

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """That of any of them, for a call that is opened now (bus ms)."""
        return self._robots.floor(call, now_us)

    def is_possible(self, call: CallForProposals, cost: int, plan: Itinerary | None, seen: Progress | None) -> bool:
        """Whether who has told this plan and this place can do the task for ``cost``, in bus ms, but for the slack.

        Of one that has told neither, or a place from which there is no way, nobody knows.
        """
        # Whatever is told before the deadline is near it, and nothing begins before it is over.
        at_us = call.deadline_ms * 1000
        legs = () if plan is None else plan.legs[: worked(plan)]
        done_us = from_bus_ms(legs[-1].end_ms, at_us) if legs else at_us
        if legs and done_us > at_us:
            least = self._robots.least(call, at_us, Segment(legs[-1].track, legs[-1].to_index), done_us)
        else:
            least = None if seen is None else self._robots.least(call, at_us, Segment(seen.track, seen.index), at_us)
        return least is None or cost_difference(cost, least, Criterion.FINISH_TIME) >= -SLACK_MS


@dataclass
class LeastBids:
    """The calls of one compartment, and which bids for them count."""

    fleet: WayFleet
    #: By number.
    _calls: dict[int, CallForProposals] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._costs = LeastCosts(self.fleet.mirror)
        self.fleet.negotiation.is_sound = self.is_sound

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """The least that any robot could bid for a call of mine, that is opened now (bus ms)."""
        self._calls[call.call] = call
        while len(self._calls) > MOST_CALLS:
            del self._calls[next(iter(self._calls))]
        return self._costs.floor(call, now_us)

    def is_sound(self, task: Reference, bid: Bid) -> bool:
        """Whether a bid is not far less than its bidder can do. The only one that could do it is believed."""
        call, mirror = self._calls.get(bid.call), self.fleet.mirror
        if call is None or bid.initiator != self.fleet.node_id or call.task != task:
            return True
        if self.fleet.negotiation.trust.able(KindCode.ROBOT) <= {bid.sender}:
            return True
        node = bid.sender
        return self._costs.is_possible(call, bid.cost, mirror.itineraries.get(node), mirror.progress.get(node))
