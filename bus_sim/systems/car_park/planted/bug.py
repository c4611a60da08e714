"""A planted bug: a mistake put into one run on purpose, so that the judges can show that they would find it."""

from collections.abc import Callable
from dataclasses import dataclass

from bus_sim.systems.car_park.simulation import Simulation


@dataclass(frozen=True, slots=True)
class PlantedBug:
    """One bug. ``finds`` is the rule that must find it (``onboard.trace.check``); ``plant`` puts it into a run."""

    name: str
    finds: str
    what: str
    plant: Callable[[Simulation], None]
