"""What is open as all robots see it, for their bids: kept while the same is asked.

Most of a bid is the same for all robots. Each robot of a site that knows the same tasks in the same step is given the
same answer, so a process that runs many of them works it out once for all. Nothing passes from one robot to another:
the answer goes by what is asked alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from onboard.systems.mapd.auction import Availability, Backlog, BidWeights, Share, offered, shares
from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.nearby import Nearby
from onboard.systems.mapd.tasks import TransportTask


@dataclass
class Prospects:
    """The bids of ``robots`` robots on one floor."""

    floor: Floor
    robots: int
    _nearby: Nearby = field(init=False)
    #: What was asked last, and what came of it.
    _asked: tuple[int, BidWeights, Sequence[TransportTask]] | None = None
    _backlog: Backlog = field(init=False)
    _shares: Sequence[Share] = ()

    def __post_init__(self) -> None:
        self._nearby = Nearby(self.floor)

    def bids(
        self, rule: BidWeights, offer: Availability, tasks: Sequence[TransportTask], step: int
    ) -> list[tuple[int, int]]:
        """The bid and the number of each open task to which a way leads, in the order of ``tasks``.

        ``tasks`` are all that are open in this ``step`` as the bidder knows them, and stay as they are.
        """
        asked = step, rule, tasks
        if asked != self._asked:
            self._nearby.see(tasks)
            self._backlog = Backlog.of(self._nearby, tasks, self.robots, step)
            self._shares = shares(self.floor, rule, tasks, self._backlog)
            self._asked = asked
        return offered(rule, offer, self._backlog, self._shares)
