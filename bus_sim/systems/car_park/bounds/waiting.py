"""How long the customers of a run waited, beside two bounds of it that are proven for that very run.

**Bays alone**: bays, doors and persons as they are, machines without way. Everybody comes, or asks, when and at the bay
where he did; each bay takes them in the order that is best for all, and wherever a robot is needed one stands.

Proof for any run without an oracle's complaint: what each of them did with his bay there is an order that
``least_ends_us`` could have chosen. *In*: before he drives in, the bay has been empty behind an open input door for
``REACTION_US``; behind him it takes the locking of the input door, the opening of the output door and a shuttle's
stroke. *Out*: the car is taken from its place in a stroke that begins with the ticket, and the bay's own begins with
the end of that one, before an open output door; then that door is locked, the input door opens, he sees it and drives.
The bay is nobody else's in any of these times: a door opens only while the other is locked, and neither closes while
somebody, or a shuttle, stands in it. Between two of one direction it is turned, whatever else happened meanwhile.
Whose car went out again from the bay where it stood counts with his own acts alone, and what others did (who were
refused, still wait, or came before the figures begin) is left out: both only take something away.

**Free flow** is in ``free_flow``.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from bus_sim.systems.car_park.bounds.bay_order import BayJob, least_ends_us
from bus_sim.systems.car_park.bounds.free_flow import FreeFlow, LeastWays
from bus_sim.systems.car_park.bounds.visits import FROM_BAY, FROM_PLACE, BayVisit
from onboard.core.site import Station
from onboard.ways.site import WaySite


@dataclass(frozen=True)
class WaitBounds:
    """Of so many visits in and out: mean waiting, s, and what it is at least by each bound."""

    visits: int = 0
    waited_s: float = 0.0
    bays_alone_s: float = 0.0
    free_flow_s: float = 0.0

    @classmethod
    def of(cls, site: WaySite, visits: Sequence[BayVisit]) -> "WaitBounds":
        """The bounds of what happened on a site."""
        if not visits:
            return cls()
        flow, scale = FreeFlow.of(site), 1e6 * len(visits)
        return cls(
            len(visits),
            sum(visit.waited_us for visit in visits) / scale,
            bays_alone_us(flow, visits) / scale,
            sum(free_flow_us(flow, LeastWays(site), visits)) / scale,
        )

    @classmethod
    def over(cls, runs: Iterable["WaitBounds"]) -> "WaitBounds":
        """Those of several runs together, as of one."""
        kept = [one for one in runs if one.visits]
        count = sum(one.visits for one in kept)
        if not count:
            return cls()
        sums = (
            (one.visits * one.waited_s, one.visits * one.bays_alone_s, one.visits * one.free_flow_s) for one in kept
        )
        return cls(count, *(sum(column) / count for column in zip(*sums, strict=True)))

    @property
    def to_bays_alone(self) -> float:
        """How many times the first bound was waited; 0 where nobody was served."""
        return self.waited_s / self.bays_alone_s if self.bays_alone_s else 0.0

    @property
    def to_free_flow(self) -> float:
        """How many times the second bound was waited; 0 where nobody was served."""
        return self.waited_s / self.free_flow_s if self.free_flow_s else 0.0

    def line(self) -> str:
        """Mean waiting and both bounds in s, with how many times each of them was waited."""
        bays = f"bays alone {self.bays_alone_s:.1f} s ({self.to_bays_alone:.2f} times)"
        free = f"free flow {self.free_flow_s:.1f} s ({self.to_free_flow:.2f} times)"
        return f"mean {self.waited_s:.1f} s   at least: {bays}   {free}"


def bays_alone_us(flow: FreeFlow, visits: Sequence[BayVisit]) -> int:
    """So long these customers waited at least, all together."""
    jobs: dict[Station, list[BayJob]] = {}
    least_us = 0
    for visit in visits:
        if visit.strokes == FROM_BAY:
            least_us += _own_us(flow, visit)
            continue
        job, through_us = _job(flow, visit)
        jobs.setdefault(visit.bay, []).append(job)
        # From the end of what he does with the bay to his coming, or asking.
        least_us -= job.busy_us - through_us + visit.since_us
    return least_us + sum(least_ends_us(of_bay, flow.turn_us) for of_bay in jobs.values())


def free_flow_us(flow: FreeFlow, ways: LeastWays, visits: Sequence[BayVisit]) -> list[int]:
    """So long each waited at least, alone in an empty park."""
    found = []
    for visit in visits:
        own_us = _own_us(flow, visit)
        if visit.goes_out and visit.strokes != FROM_BAY:
            own_us = flow.out_us(visit.acts) + (flow.handle_us if visit.strokes == FROM_PLACE else 0)
        if visit.place is not None:
            own_us += ways.us(visit.place.segment, visit.bay.segment)
        found.append(own_us)
    return found


def _own_us(flow: FreeFlow, visit: BayVisit) -> int:
    """Who has to wait for no machine: what he sees, and does himself."""
    acts = visit.acts
    return flow.in_us(acts) - (acts.drive_in_us + acts.walk_us - acts.drive_out_us if visit.goes_out else 0)


def _job(flow: FreeFlow, visit: BayVisit) -> tuple[BayJob, int]:
    """What he does with the bay, and so long after its begin he is through."""
    if visit.goes_out:
        fetched_us = visit.since_us + (flow.handle_us if visit.strokes == FROM_PLACE else 0)
        out_us = flow.out_us(visit.acts)
        return BayJob(fetched_us, out_us, goes_out=True), out_us
    in_us = flow.in_us(visit.acts)
    return BayJob(visit.since_us, in_us + flow.turn_us + flow.handle_us, goes_out=False), in_us
