"""The robots of the model: each call goes to whoever is done first, as by the bids; then they go to a refuge.

As in the plant no car is left where no robot could fetch it by one itinerary (``to_fetch_from``): on sites that are
driven one way round that matters.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from bus_sim.systems.car_park.design.offers import Offers
from bus_sim.systems.car_park.design.retreats import Retreats
from bus_sim.systems.car_park.design.robots import RobotModel, Trip, Work, Works
from bus_sim.systems.car_park.design.times import AWARD_US, REACH_US
from bus_sim.systems.car_park.design.ways import ModelTraffic
from onboard.contract.codes import KindCode
from onboard.contract.messages import Reference
from onboard.core.site import Segment, Station
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.pipeline import ENTERED_US
from onboard.systems.car_park.place_costs import PlaceCosts
from onboard.systems.car_park.site import ANY_CLASS, CarPark

#: Calls after which turns that are long over are dropped.
TIDY_EVERY = 4


class ServedCall(NamedTuple):
    """What came of a call, us: when the car was set down (retrieval) or taken (parking) at the bay, and parked."""

    at_bay_us: int
    done_us: int
    place: Station | None = None


class FleetModel:
    """All robots of a site in its traffic."""

    def __init__(self, site: CarPark) -> None:
        self.site = site
        self.traffic = ModelTraffic(site)
        robots = [one for one in site.machines.values() if one.kind is KindCode.ROBOT]
        self.robots = [RobotModel(one.node_id, one.home) for one in robots]
        for one in self.robots:
            self.traffic.stands(*one.resting)
        #: Places without a car, or with one that is about to be taken: since when, or from when on.
        self.free = dict.fromkeys(to_fetch_from(site, site.places), 0)
        self._by_front: dict[Segment, list[Station]] = {}
        self._calls = 0
        self._retreats = Retreats(site, self.traffic, self.robots)
        self._offers = Offers(site, self.traffic, self.robots, self._retreats)
        self._costs = PlaceCosts(site)
        self._door_us = site.timing.door_us + REACH_US
        self._start_us = site.timing.call_window_us + AWARD_US

    # --- tasks -------------------------------------------------------------------------------------------------

    def park(self, front: Segment, call_us: int, ready_us: int, car: Reference) -> ServedCall | None:
        """A car is taken from a bay that is locked at ``ready_us`` to the place that suits; None: none is free."""
        if not self.free:
            return None
        # Whoever bids does not know how long the driver takes.
        bid_us = call_us + ENTERED_US + self.site.timing.door_us
        free = {place for place, since_us in self.free.items() if since_us <= call_us} or {*self.free}
        costs_us = self._costs.by(self.site.place, car, ANY_CLASS, [*free], call_us)
        trip = self._give(lambda: self._parkings(front, bid_us, free, costs_us), call_us, ready_us)
        place = trip.work.place
        assert place is not None, "a parking ends at a place"
        del self.free[place]
        return ServedCall(trip.take_us[1], trip.done_us, place)

    def _parkings(
        self, front: Segment, ready_us: int, free: Collection[Station], costs_us: Mapping[int, int]
    ) -> Iterator[Work]:
        """Works by place, the soonest and cheapest first."""
        seen: set[Segment] = set()
        for place in self._suited(front, costs_us):
            # Both sides of a segment are reached alike.
            if place in free and place.segment not in seen:
                seen.add(place.segment)
                cost_us = costs_us.get(place.number, 0)
                yield Work(front, place.segment, ready_us, 0, self._door_us, 0, place, cost_us)

    def _suited(self, front: Segment, costs_us: Mapping[int, int]) -> list[Station]:
        nearest, roads = self._nearest(front), self.traffic.roads
        if not costs_us:
            return nearest
        return sorted(nearest, key=lambda one: roads.shortest_us(front, one.segment) + costs_us.get(one.number, 0))

    def retrieve(self, place: Station, front: Segment, call_us: int, ready_us: int) -> ServedCall:
        """A car is brought from its place to a bay that is empty and locked at ``ready_us``."""
        work = Work(place.segment, front, 0, ready_us, 0, self._door_us)
        trip = self._give(lambda: iter([work]), call_us)
        self.free[place] = trip.take_us[1]
        return ServedCall(trip.leave_us[1], trip.done_us)

    def _nearest(self, front: Segment) -> list[Station]:
        """All places, the nearest to a bay first; of places as near the site's order."""
        found = self._by_front.get(front)
        if found is None:
            roads = self.traffic.roads
            found = sorted(self.site.places, key=lambda one: roads.shortest_us(front, one.segment))
            self._by_front[front] = found
        return found

    def _give(self, works: Works, call_us: int, ready_us: int | None = None) -> Trip:
        """Each robot offers the soonest of these that it can tell; whose bid is the best has it.

        Where nobody can, they are called again once somebody has less in hand. ``ready_us`` is when the car can be
        taken, where that is another time than is bid for.
        """
        self._calls += 1
        if self._calls % TIDY_EVERY == 0:
            self.traffic.forget(call_us)
        start_us = self.traffic.now_us = call_us + self._start_us
        best = self._offers.best(works, start_us)
        while best is None:
            ends_us = [end_us for one in self.robots for end_us in one.in_hand_us(start_us, self.traffic.roads)]
            # Where one itinerary tells it of nobody, whatever is in hand, it is done all the same.
            start_us = self.traffic.now_us = min(ends_us, default=start_us)
            best = self._offers.best(works, start_us, any_way=not ends_us)
        trip, robot = best
        if not trip.yielding:
            trip = self._offers.past_retreats(robot, works, start_us, trip) or trip
        yielding = trip.yielding
        self._retreats.hold_back(yielding)
        if ready_us is not None:
            trip = self._offers.renewed(robot, trip.work._replace(take_ready_us=ready_us), start_us)
        self._carry_out(trip, robot, start_us)
        self._retreats.go_back(yielding, start_us)
        return trip

    def _carry_out(self, trip: Trip, robot: RobotModel, start_us: int) -> None:
        traffic, node, work = self.traffic, robot.node, trip.work
        robot.steps_us = [*robot.in_hand_us(start_us, self.traffic.roads), *trip.steps_us]
        traffic.stands_no_more(*robot.resting)
        traffic.give_back(robot.retreat[trip.kept :])
        traffic.take(trip.first)
        traffic.take(trip.second)
        traffic.stands(work.take, *trip.take_us, node)
        traffic.stands(work.leave, *trip.leave_us, node)
        robot.given_us = start_us
        robot.busy_us += trip.done_us - max(start_us, robot.free_us)
        robot.distance_mm += sum(leg.distance_mm for leg in (*trip.first, *trip.second))
        robot.at, robot.free_us = work.leave, trip.done_us
        robot.retreat = self._retreats.way_back(robot, robot.at, robot.free_us)
        traffic.take(robot.retreat)
        traffic.stands(*robot.resting)
