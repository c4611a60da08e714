"""Cars, and where one can be."""

import random
from dataclasses import dataclass
from typing import NamedTuple

from onboard.core.site import Station

#: A driver needs this long to drive in or out, s: the range of the SimPy study named in the sources, section 2.3.
DRIVER_S = (10.0, 30.0)
#: Sizes of ordinary passenger cars, mm and kg (plausible, from no statistics): wheelbase low, high, most frequent.
WHEELBASE_MM = (2300, 3100, 2650)
OVERHANGS_MM = (1400, 1800)
HEIGHT_MM = (1400, 1900, 1500)
KG_PER_MM_OF_LENGTH = (0.28, 0.42)
WIDTH_MM = (1600, 2000, 1800)


@dataclass(frozen=True, slots=True)
class CarBody:
    """One car as it is: ``name`` is unique in a run; lengths in mm, mass in kg."""

    name: str
    wheelbase_mm: int
    length_mm: int
    height_mm: int
    mass_kg: int
    #: Without mirrors. Compartments measure it where the site limits it.
    width_mm: int = WIDTH_MM[2]
    #: Its driver asks for a place to charge it at.
    charging: bool = False


class Aboard(NamedTuple):
    """On the shuttle of a robot."""

    node_id: int


#: Where a car is: at a station (place or bay), aboard a robot, or None: outside the park.
Location = Station | Aboard | None


def random_car(name: str, seed: int) -> CarBody:
    """An ordinary car; the same for the same name and seed, whatever else the run draws."""
    chance = random.Random(f"car:{seed}:{name}")
    wheelbase_mm = round(chance.triangular(*WHEELBASE_MM))
    length_mm = wheelbase_mm + chance.randint(*OVERHANGS_MM)
    height_mm = round(chance.triangular(*HEIGHT_MM))
    mass_kg = round(length_mm * chance.uniform(*KG_PER_MM_OF_LENGTH))
    return CarBody(name, wheelbase_mm, length_mm, height_mm, mass_kg, round(chance.triangular(*WIDTH_MM)))
