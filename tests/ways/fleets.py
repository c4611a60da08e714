"""Fleets at work on several floors: robots that were given tasks one after the other, planned around each other."""

import random

from onboard.config.site import parse_site
from onboard.contract.codes import Grade, KindCode, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.occupancy import final_position, itinerary_windows, lift_uses
from onboard.ways.refuges import open_refuges
from onboard.ways.reservations import Reservations
from onboard.ways.sipp import NoRoute, Route, Visit, free_flow_us, plan_route

SECOND = 1_000_000
FLOORS = """
[site]
name = "bench"
[floors]
count = {floors}
positions = {length}
[[lifts]]
name = "LL"
node = 5
end = "left"
[[lifts]]
name = "LR"
node = 6
end = "right"
"""
IN_OUT = """
[[compartments]]
name = "IOC{number}"
node = {number}
at = "p(1,{index})"
"""
ROBOT = """
[[robots]]
name = "MR{number}"
node = {node}
home = "p({floor},{index})"
"""
#: The planner's bound of expansions: what a machine grants one search.
MAX_EXPANSIONS = 4_000


def park(floors: int, length: int, compartments: int) -> CarPark:
    """Floors with a lift at each end, compartments on the lowest, one robot at home on each other floor."""
    text = FLOORS.format(floors=floors, length=length)
    for number in range(1, compartments + 1):
        text += IN_OUT.format(number=number, index=1 + number * length // (compartments + 1))
    for floor in range(2, floors + 1):
        text += ROBOT.format(number=floor - 1, node=9 + floor, floor=floor, index=length // 2)
    return car_park(parse_site(text, "bench"))


class Fleet:
    """Robots with their plans, made one after the other; ``dwell_us`` is how long each handling of a car takes."""

    def __init__(self, site: CarPark, rng: random.Random, dwell_us: int = 15 * SECOND) -> None:
        self.site, self.rng, self.dwell_us = site, rng, dwell_us
        self.reservations = Reservations()
        self.ends = {node: m.home for node, m in site.machines.items() if m.kind is KindCode.ROBOT}
        for node, home in self.ends.items():
            stand = Leg(LegAction.STAND, home.track, home.index, home.index, Side.NEAR, 0)
            self._tell(Itinerary(node, 1, Grade.FIRM, Stamp(0, 1, 1), (stand,)))

    def _tell(self, itinerary: Itinerary) -> None:
        self.reservations.release(itinerary.sender)
        windows, uses = itinerary_windows(self.site, itinerary, 0), lift_uses(self.site, itinerary, 0)
        self.reservations.reserve(itinerary.sender, windows, uses)

    def task(self) -> tuple[Visit, ...]:
        """A random car to park or to fetch."""
        ends = (self.rng.choice(list(self.site.compartments.values())), self.rng.choice(self.site.places))
        return tuple(Visit(one.segment, self.dwell_us) for one in (ends if self.rng.random() < 0.5 else ends[::-1]))

    def busy(self, nodes: list[int]) -> None:
        """Give each of some robots a task within the first minute."""
        for node in nodes:
            start_us = self.rng.randrange(60_000) * 1000
            route = self.query(node, start_us)
            if isinstance(route, Route):
                self.take(node, start_us, route)

    def query(self, node: int, start_us: int) -> Route | NoRoute:
        """A plan for a random task of a robot that stands at its end."""
        visits = self.task()
        standing = [end for other, end in self.ends.items() if other != node]
        refuges = open_refuges(self.site, standing)
        route = plan_route(
            self.site, self.reservations, node, self.ends[node], start_us, visits, refuges, MAX_EXPANSIONS
        )
        self.delayed = isinstance(route, Route) and route.finish_us > free_flow_us(
            self.site, self.ends[node], start_us, visits
        )
        return route

    def take(self, node: int, start_us: int, route: Route) -> None:
        """Make a plan that begins at ``start_us`` the node's firm itinerary, so that later plans go around it."""
        home = self.ends[node]
        legs = [Leg(LegAction.STAND, home.track, home.index, home.index, Side.NEAR, start_us // 1000)]
        legs += [
            Leg(one.action, one.track, one.from_index, one.to_index, Side.NEAR, one.end_us // 1000)
            for one in route.legs
        ]
        itinerary = Itinerary(node, 2, Grade.FIRM, Stamp(0, 1, 1), tuple(legs))
        self.ends[node] = final_position(self.site, itinerary) or home
        self._tell(itinerary)
