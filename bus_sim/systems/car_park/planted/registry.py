"""All planted bugs by name."""

from bus_sim.systems.car_park.planted import calls, cars, desks, lifts, rights, waits
from bus_sim.systems.car_park.planted.bug import PlantedBug

BUGS: dict[str, PlantedBug] = {
    bug.name: bug for group in (rights, lifts, calls, cars, desks, waits) for bug in group.BUGS
}


def find_bug(name: str) -> PlantedBug:
    """The bug so named. Raises ``KeyError``, with the names that there are, for any other."""
    if name not in BUGS:
        raise KeyError(f"{name}: no such bug; there are {', '.join(BUGS)}")
    return BUGS[name]
