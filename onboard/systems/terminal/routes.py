"""Ways through the network: several routes between two areas, shortest first (row M25)."""

import heapq

from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import RestartPolicy
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.systems.terminal.site import EntityKind, Terminal


def routes(
    site: Terminal, origin: int, goal: int, count: int, avoid: frozenset[int] = frozenset()
) -> list[tuple[int, ...]]:
    """Up to ``count`` ways from one entity to another without a circle, by their free-flow duration.

    Both ends belong to a way; ``avoid`` are entities not to be entered. Stations are never passed through, and a way
    that only adds a circle to a shorter one is none.
    """
    found: list[tuple[int, ...]] = []
    heap: list[tuple[int, tuple[int, ...]]] = [(0, (origin,))]
    taken: dict[int, int] = {}
    while heap and len(found) < count:
        spent_us, way = heapq.heappop(heap)
        here = way[-1]
        if here == goal:
            found.append(way)
            continue
        taken[here] = taken.get(here, 0) + 1
        if taken[here] > count:
            continue
        entity = site.entities[here]
        before = way[-2] if len(way) > 1 else 0
        for after in entity.leads_to:
            if after in way or after in avoid:
                continue
            if site.entities[after].kind is EntityKind.STATION and after != goal:
                continue
            heapq.heappush(heap, (spent_us + entity.crossing_us(before, after), (*way, after)))
    return found


def free_flow_us(site: Terminal, origin: int, goal: int) -> int | None:
    """Least duration from the beginning of one entity to the beginning of another, alone; None where no way leads."""
    ways = routes(site, origin, goal, 1)
    if not ways:
        return None
    way = ways[0]
    return sum(
        site.entities[here].crossing_us(way[number - 1] if number else 0, way[number + 1])
        for number, here in enumerate(way[:-1])
    )


def least_end_ms(site: Terminal, call: CallForProposals, now_us: int) -> int:
    """Bus ms before which nobody can have done a transport: picked up when it is called for and carried straight."""
    opened_us = from_bus_ms(call.deadline_ms, now_us) - RestartPolicy().window_us(call.attempt, site.timing)
    return to_bus_ms(opened_us + (carry_us(site, call) or 0))


def carry_us(site: Terminal, call: CallForProposals) -> int | None:
    """The least from docking at a box's station to having put it down at its target; None where no way leads."""
    source = site.entities.get(call.from_station)
    if source is None or not source.area or call.to_station not in site.entities:
        return None
    way_us = free_flow_us(site, source.area, call.to_station)
    return None if way_us is None else way_us + 2 * (site.dock_us + site.handle_us + site.undock_us)
