"""What is open as all robots see it, for their bids: kept while the same is asked.

Most of a bid is the same for all robots. Each robot of a site that knows the same tasks in the same step is given the
same answer, so a process that runs many of them works it out once for all. Nothing passes from one robot to another:
the answer goes by what is asked alone.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.systems.mapd.auction import Availability, Backlog, BidWeights, Share, shares, until_free
from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.nearby import Nearby
from onboard.systems.mapd.tasks import TransportTask
from onboard.ways.steps import FAR

#: Bids are put in order as far as this beyond the cheapest that was not looked at, hundredths of a step.
SPAN = 1_000


class Beginning(NamedTuple):
    """The open tasks that begin in one cell: steps to it from each cell; what each adds to a bid, and its number."""

    steps: Sequence[int]
    least: int
    tasks: Sequence[tuple[int, int]]


@dataclass
class BidList:
    """One robot's bids, worked out no farther than they are looked at: of a great many tasks few ever are.

    ``fixed`` is in each of them, and ``weight`` for each step from ``cell`` to where its task begins.
    """

    cell: int
    weight: int
    fixed: int
    shares: Mapping[int, Share]
    beginnings: Sequence[Beginning]
    #: The least bid of each beginning that was not looked at; None before the first look.
    _afar: list[tuple[int, Sequence[tuple[int, int]]]] | None = None
    #: Bids, with their tasks, of all other beginnings that were not looked at.
    _rest: list[tuple[int, int]] = field(default_factory=list)

    def bid(self, number: int) -> int | None:
        """The bid for a task; None for one that is not open, or to which no way leads."""
        share = self.shares.get(number)
        if share is None or (empty := share.steps[self.cell]) >= FAR:
            return None
        return self.fixed + self.weight * empty + share.part

    def look_on(self) -> list[tuple[int, int]]:
        """The cheapest that were not looked at, and their tasks, in order; empty once all were."""
        if self._afar is None:
            cell, weight, fixed = self.cell, self.weight, self.fixed
            self._afar = [
                (fixed + weight * empty + least, tasks)
                for steps, least, tasks in self.beginnings
                if (empty := steps[cell]) < FAR
            ]
        afar, rest = self._afar, self._rest
        if not afar and not rest:
            return []
        limit = SPAN + min([bid for bid, _ in afar] + [bid for bid, _ in rest])
        for bid, tasks in afar:
            if bid <= limit:
                others = bid - tasks[0][0]
                rest += [(others + part, number) for part, number in tasks]
        self._afar = [one for one in afar if one[0] > limit]
        self._rest = [one for one in rest if one[0] > limit]
        return sorted(one for one in rest if one[0] <= limit)


@dataclass
class Prospects:
    """The bids of ``robots`` robots on one floor."""

    floor: Floor
    robots: int
    _nearby: Nearby = field(init=False)
    #: What was asked last, and what came of it.
    _asked: tuple[int, BidWeights, Sequence[TransportTask]] | None = None
    _backlog: Backlog = field(init=False)
    _shares: Mapping[int, Share] = field(default_factory=dict)
    _beginnings: Sequence[Beginning] = ()

    def __post_init__(self) -> None:
        self._nearby = Nearby(self.floor)

    def offers(self, rule: BidWeights, offer: Availability, tasks: Sequence[TransportTask], step: int) -> BidList:
        """The bids for ``tasks``, all that are open in this ``step`` as the bidder knows them; nobody changes them."""
        asked = step, rule, tasks
        if asked != self._asked:
            self._nearby.see(tasks)
            self._backlog = Backlog.of(self._nearby, tasks, self.robots, step)
            known = shares(self.floor, rule, tasks, self._backlog)
            self._shares, self._beginnings = {share.number: share for share in known}, _beginnings(tasks, known)
            self._asked = asked
        wait = until_free(rule, offer, self._backlog)
        return BidList(offer.cell, rule.empty, wait, self._shares, self._beginnings)


def _beginnings(tasks: Sequence[TransportTask], known: Sequence[Share]) -> list[Beginning]:
    """The same tasks by the cells in which they begin."""
    pickups = {task.number: task.pickup for task in tasks}
    found: defaultdict[int, list[Share]] = defaultdict(list)
    for share in known:
        found[pickups[share.number]].append(share)
    return [_beginning(some) for some in found.values()]


def _beginning(some: Sequence[Share]) -> Beginning:
    parts = sorted((share.part, share.number) for share in some)
    return Beginning(some[0].steps, parts[0][0], parts)
