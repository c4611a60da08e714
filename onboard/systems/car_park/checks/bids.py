"""Bids of robots: as everywhere, but that those that cannot be true do not count."""

from collections.abc import Callable

from onboard.contract.codes import Criterion, Grade, KindCode, Operation
from onboard.contract.messages import Bid, CallForProposals, Itinerary, Progress, Reference
from onboard.systems.car_park.least_bids import LeastCosts
from onboard.systems.car_park.site import car_park
from onboard.trace.check.calls import BidsGoDown
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers
from onboard.ways.mirror import WayMirror

JUDGED = (Operation.PARK, Operation.RETRIEVE)


class TrueBidsGoDown(BidsGoDown):
    """As everywhere; a bid that is far less than its bidder can do, by what it has told, does not count.

    The bidder may be the only one that can do the task, and is believed then: no bid is better than its own.
    """

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        # Without the site file nothing is known of ways: all bids count.
        site = car_park(picture.site) if picture.has_site else None
        self._least = None if site is None else LeastCosts(WayMirror(site, min(site.machines)))
        self._plans: dict[int, Itinerary] = {}
        self._progress: dict[int, Progress] = {}

    def handlers(self) -> Handlers:
        """Reads plans beside what the rule for bids needs."""
        return {**super().handlers(), Itinerary: self._on_itinerary}

    def _on_itinerary(self, event: LogEvent[Itinerary]) -> None:
        if event.message.grade is Grade.FIRM:
            self._plans[event.message.sender] = event.message

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        super()._on_progress(event)
        self._progress[event.message.sender] = event.message

    def is_sound(self, bid: Bid, task: Reference) -> bool:
        """No sooner than its way from the end of its work, or from where it is, takes with nobody in its way."""
        seen = self.calls.get((bid.initiator, bid.call))
        if self._least is None or seen is None or not _is_judged(seen.call):
            return True
        node = bid.sender
        return self._least.is_possible(seen.call, bid.cost, self._plans.get(node), self._progress.get(node))


def _is_judged(call: CallForProposals) -> bool:
    return call.kind is KindCode.ROBOT and call.criterion is Criterion.FINISH_TIME and call.operation in JUDGED
