"""Which machines may rest where at the same time, on any network.

A set of rests is well formed if with a machine at each of them the others still come from every place that is needed to
every other (Cap, Novak, Kleiner, Selecky 2015, "Prioritized planning algorithms for trajectory coordination", section
4; for floors of cells Ma, Li, Kumar and Koenig, AAMAS 2017): then whoever has a task finds a way whatever the others
wait for. Found by taking places away.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic

from onboard.ways.network import Network, Place


@dataclass(frozen=True)
class Rest(Generic[Place]):
    """One machine's rest: the places of which it takes any one, and what its body closes at whichever of them.

    What it serves itself, or lets others come to by going elsewhere, is ``beside`` it.
    """

    places: tuple[Place, ...]
    body: frozenset[Place]
    beside: frozenset[Place] = field(default_factory=frozenset)


def cut_off(
    network: Network[Place], hub: Collection[Place], rests: Collection[Rest[Place]], needed: Iterable[Place]
) -> frozenset[Place]:
    """What could not be reached from the hub and back with a machine at each rest, the rests themselves included.

    ``needed`` are places beside no rest. None lie behind each other if nothing is cut off.
    """
    closed = frozenset[Place]().union(*(rest.body for rest in rests))
    comes, goes = network.from_any(hub, closed=closed), network.to_any(hub, closed=closed)
    lost = {place for place in needed if place not in comes or place not in goes}
    for rest in rests:
        if len(rest.body) == 1 and not rest.beside:
            # One more place: what is reached with it is beside what is reached without.
            is_reached = _touches(network.back, rest.places[0], comes) and _touches(network.ways, rest.places[0], goes)
            lost |= set() if is_reached else set(rest.places)
        else:
            lost |= {*rest.beside, *rest.places} - network.ground(hub, closed=closed - rest.body)
    return frozenset(lost)


def _touches(ways: Mapping[Place, Sequence[tuple[Place, int]]], place: Place, ground: frozenset[Place]) -> bool:
    return any(there in ground for there, _ in ways.get(place, ()))


def lasting_rests(network: Network[Place], rests: Sequence[Place], goals: Iterable[Place]) -> frozenset[Place]:
    """Those of ``rests``, earlier first, at which machines may all stand for ever: whoever is left gets everywhere.

    All are asked about at once, and one by one only where that fails. Where standing takes what another place takes
    too, nobody rests.
    """
    shared = Counter(network.takes.values())
    alone = [place for place in rests if shared[network.takes.get(place, place)] <= 1]
    needed = list(dict.fromkeys(goals))
    if _all_reach(network, alone, needed):
        return frozenset(alone)
    kept: list[Place] = []
    for place in alone:
        if _all_reach(network, [*kept, place], needed):
            kept.append(place)
    return frozenset(kept)


def _all_reach(network: Network[Place], rests: Collection[Place], goals: Collection[Place]) -> bool:
    """Whether all goals and rests reach one another with no rest passed on the way."""
    needed, at_rest = {*goals, *rests}, set(rests)
    if not needed:
        return True
    hub = next((place for place in sorted(needed) if place not in at_rest), None)
    if hub is None:
        # Any place beside a rest will do: all must meet there.
        hub = next((there for there, _ in network.ways.get(min(needed), ()) if there not in at_rest), None)
        if hub is None:
            return len(needed) == 1
    bodies = [Rest((place,), frozenset((place,))) for place in at_rest]
    return not cut_off(network, (hub,), bodies, needed - at_rest)
