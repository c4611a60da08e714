"""A case small enough for an exact optimum: one compartment, some robots, a few cars, nobody ever in the way.

The abstract problem: a task is taken up by one robot after the other, ways take the planner's free-flow time, the bay
serves one customer at a time, and every place holds one car. All times are whole ms. Rules of decision are played
on it step by step (``play_case``); the clairvoyant optimum is in ``optimum``.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from bus_sim.systems.car_park.bounds.free_flow import Acts, FreeFlow
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.plant.customer import REACTION_US
from onboard.contract.codes import KindCode
from onboard.core.site import Segment, Site, Station
from onboard.ways.roads import roads_of
from onboard.ways.site import way_site

#: Places kept for each car, those nearest to the bay: on both sides of it more than the cars need, and all ways to and
#: from a farther one on the same side are longer.
PLACES_A_CAR = 4


class Visitor(NamedTuple):
    """One car: when it comes and is fetched (None: never), and its driver's acts, ms."""

    arrival_ms: int
    departure_ms: int | None
    drive_in_ms: int
    walk_ms: int
    drive_out_ms: int


@dataclass(frozen=True)
class Case:
    """The data of one small case. ``way_ms`` is between positions: fronts of ``places``, then ``bay``, then ``homes``.

    Durations are rounded down, so that the optimum stays below what the plant does.
    """

    visitors: tuple[Visitor, ...]
    places: tuple[Station, ...]
    bay: int
    homes: tuple[int, ...]
    way_ms: tuple[tuple[int, ...], ...]
    close_ms: int
    open_ms: int
    handle_ms: int
    react_ms: int

    @classmethod
    def of(cls, site: Site, demand: Demand, seed: int) -> "Case":
        """The case of a demand on a site with one compartment. Raises ``ValueError`` where it has several."""
        ways = way_site(site)
        if len(ways.compartments) != 1:
            raise ValueError(f"site {site.name} has {len(ways.compartments)} compartments; a small case has one")
        (station,) = ways.compartments.values()
        homes = [machine.home for machine in site.machines.values() if machine.kind is KindCode.ROBOT]
        roads, least = roads_of(ways), FreeFlow.of(site)
        places = sorted(ways.places, key=lambda place: roads.shortest_us(station.segment, place.segment))
        places = places[: PLACES_A_CAR * len(demand.stays)]
        positions: list[Segment] = [place.segment for place in places]
        positions += [station.segment, *homes]
        visitors = []
        for stay in demand.stays:
            acts = Acts.of(stay, seed)
            leaves_ms = None if stay.departure_us is None else stay.departure_us // 1000
            visitors.append(Visitor(stay.arrival_us // 1000, leaves_ms, *(act_us // 1000 for act_us in acts)))
        count = len(places)
        return cls(
            tuple(visitors),
            tuple(places),
            count,
            tuple(range(count + 1, count + 1 + len(homes))),
            tuple(tuple(roads.shortest_us(here, there) // 1000 for there in positions) for here in positions),
            least.close_us // 1000,
            least.open_us // 1000,
            least.handle_us // 1000,
            REACTION_US // 1000,
        )


class TaskOffer(NamedTuple):
    """What a robot could do about a task: done at ``finish_ms``, the car taken at ``taken_ms``, at ``place``."""

    finish_ms: int
    robot: int
    place: int
    taken_ms: int
    empty_ms: int
    begin_ms: int


#: Picks one of the offers of all robots for a task told at a time (ms).
Rule = Callable[[list[TaskOffer], int], TaskOffer]


def earliest_finish(offers: list[TaskOffer], told_ms: int) -> TaskOffer:
    """Our protocol: the earliest finish wins, then the lower robot, and a robot may still be busy."""
    return min(offers)


def nearest(offers: list[TaskOffer], told_ms: int) -> TaskOffer:
    """The shortest empty way among robots that are free, or become free first."""
    first_ms = max(told_ms, min(offer.begin_ms for offer in offers))
    return min((offer for offer in offers if offer.begin_ms <= first_ms), key=lambda offer: (offer.empty_ms, offer))


def any_robot(seed: int) -> Rule:
    """A robot by chance among those that are free, or become free first; it takes the best place."""
    chance = random.Random(f"small case:{seed}")

    def choose(offers: list[TaskOffer], told_ms: int) -> TaskOffer:
        first_ms = max(told_ms, min(offer.begin_ms for offer in offers))
        free = [offer for offer in offers if offer.begin_ms <= first_ms]
        robot = chance.choice(sorted({offer.robot for offer in free}))
        return min(offer for offer in free if offer.robot == robot)

    return choose


@dataclass
class _CaseState:
    robots: list[tuple[int, int]]
    stored: dict[int, tuple[int, int]] = field(default_factory=dict)
    taken_until: dict[int, int | None] = field(default_factory=dict)
    parked_ms: dict[int, int] = field(default_factory=dict)
    bay_ms: int = 0
    #: From when on who is served next is called for, where that is done ahead.
    looks_ms: int = 0
    waited_ms: list[int] = field(default_factory=list)


def play_case(case: Case, rule: Rule, *, ahead: bool = False) -> int:
    """The customers' total waiting (ms) where each task is given by ``rule`` when the compartment tells it.

    The bay serves as the compartment does: a ticket whose car is stored first, then whoever came first. It tells a task
    with the key, and once the bay is locked; ``ahead`` (``call_at = "arrival"``) as somebody drives in, and the next
    car while the bay works. A robot that is there then waits for the lock.
    """
    state = _CaseState([(home, 0) for home in case.homes])
    coming = {number: one.arrival_ms for number, one in enumerate(case.visitors)}
    leaving: dict[int, int] = {}
    while coming or leaving:
        begin_ms, _, number, fetch = min(
            [(max(at_ms, state.bay_ms, state.stored[number][1]), 0, number, True) for number, at_ms in leaving.items()]
            + [(max(at_ms, state.bay_ms), 1, number, False) for number, at_ms in coming.items()]
        )
        if fetch:
            asked_ms = leaving.pop(number)
            locked_ms = begin_ms + case.close_ms
            told_ms = max(asked_ms, state.stored[number][1], state.looks_ms) if ahead else locked_ms
            _fetch(case, state, rule, number, (asked_ms, min(told_ms, locked_ms), locked_ms))
        else:
            told_ms = begin_ms + case.react_ms + (0 if ahead else case.visitors[number].drive_in_ms)
            _park(case, state, rule, number, (coming.pop(number), told_ms, begin_ms))
            departure_ms = case.visitors[number].departure_ms
            if departure_ms is not None:
                leaving[number] = max(departure_ms, state.parked_ms[number])
    return sum(state.waited_ms)


def _park(case: Case, state: _CaseState, rule: Rule, number: int, times_ms: tuple[int, int, int]) -> None:
    """``times_ms``: when the driver came, his task is told, and the bay is his."""
    visitor, (came_ms, told_ms, begin_ms) = case.visitors[number], times_ms
    out_ms = begin_ms + case.react_ms + visitor.drive_in_ms + visitor.walk_ms
    ready_ms = out_ms + case.close_ms
    offers = []
    for robot, (here, free_ms) in enumerate(state.robots):
        way_ms = case.way_ms[here][case.bay]
        at_ms = max(free_ms, told_ms) + way_ms
        taken_ms = max(at_ms, ready_ms) + case.open_ms + case.handle_ms
        for place in range(len(case.places)):
            finish_ms = taken_ms + case.way_ms[case.bay][place] + case.handle_ms
            until_ms = state.taken_until.get(place, 0)
            if until_ms is not None and until_ms <= finish_ms - case.handle_ms:
                offers.append(TaskOffer(finish_ms, robot, place, taken_ms, way_ms, free_ms))
    offer = rule(offers, told_ms)
    state.robots[offer.robot] = offer.place, offer.finish_ms
    state.stored[number] = offer.place, offer.finish_ms
    state.taken_until[offer.place] = None
    state.parked_ms[number] = out_ms
    state.looks_ms = told_ms
    state.bay_ms = offer.taken_ms + case.close_ms + case.open_ms
    state.waited_ms.append(out_ms - came_ms)


def _fetch(case: Case, state: _CaseState, rule: Rule, number: int, times_ms: tuple[int, int, int]) -> None:
    """``times_ms``: when the car was asked for, its task is told, and the bay is locked."""
    visitor, (asked_ms, told_ms, locked_ms) = case.visitors[number], times_ms
    place, stored_ms = state.stored[number]
    offers = []
    for robot, (here, free_ms) in enumerate(state.robots):
        way_ms = case.way_ms[here][place]
        taken_ms = max(max(free_ms, told_ms) + way_ms, stored_ms, locked_ms) + case.handle_ms
        finish_ms = taken_ms + case.way_ms[place][case.bay] + case.open_ms + case.handle_ms
        offers.append(TaskOffer(finish_ms, robot, place, taken_ms, way_ms, free_ms))
    offer = rule(offers, told_ms)
    state.robots[offer.robot] = case.bay, offer.finish_ms
    state.taken_until[place] = offer.taken_ms
    state.looks_ms = offer.finish_ms + case.close_ms
    gone_ms = offer.finish_ms + case.close_ms + case.open_ms + case.react_ms + visitor.drive_out_ms
    state.bay_ms = gone_ms
    state.waited_ms.append(gone_ms - asked_ms)
