"""Short names of cars for a picture of characters: no two cars ever have the same one."""

from collections import Counter
from collections.abc import Iterable, Mapping
from string import ascii_lowercase

from onboard.contract.base import Reference

#: A car whose short name would be another's too.
UNNAMED = "+"


def bay_letters(bays: Iterable[int]) -> dict[int, str]:
    """A letter for each compartment, by node-ID; none where there is only one, whose cars' numbers are enough.

    Compartments beyond the twenty-sixth have none, so that their cars are ``UNNAMED`` beside those that have.
    """
    ordered = sorted(bays)
    return dict(zip(ordered, ascii_lowercase, strict=False)) if len(ordered) > 1 else {}


def car_labels(cars: Iterable[Reference], letters: Mapping[int, str], width: int) -> dict[Reference, str]:
    """A name of at most ``width`` characters for each car: its compartment's letter and the end of its number.

    Of cars that would share a name, each is ``UNNAMED``; of one compartment's cars that is so from its hundredth on
    where there are three characters.
    """
    names = {car: _name(car, letters, width) for car in cars}
    times = Counter(names.values())
    return {car: name if times[name] == 1 else UNNAMED for car, name in names.items()}


def _name(car: Reference, letters: Mapping[int, str], width: int) -> str:
    letter = letters.get(car.origin, "")
    room = width - len(letter)
    return letter + str(car.number)[-room:] if room > 0 else UNNAMED
