"""Cars that left while this machine heard nothing: who kept them names them no more, however often it tells all."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import CarAt, Reference
from onboard.ways.car_words import KnownCar

#: In so many answers in a row a car is missing that is there no more: the first may have been heard in part, and of
#: each later one the word about the car may have been lost (docs/reliability.md, "Outages of minutes").
ANSWERS = 3


@dataclass
class MissedCars:
    """What the answers of each keeper lacked; ``cars`` is what this machine believes."""

    cars: Mapping[Reference, KnownCar]
    #: By keeper: how many of its answers were over since it named each car last.
    _answers: dict[int, dict[Reference, int]] = field(default_factory=dict)

    def named(self, word: CarAt) -> None:
        """Its keeper, or who says so, has told where a car is."""
        self._answers.get(word.sender, {}).pop(word.car, None)

    def answered(self, keeper: int) -> list[Reference]:
        """A keeper has told all that it has: the cars that it has not named for ``ANSWERS`` answers."""
        before = self._answers.get(keeper, {})
        kept = (car for car, one in self.cars.items() if one.custodian == keeper and one.station != OUTSIDE)
        lacking = {car: before.get(car, 0) + 1 for car in kept}
        self._answers[keeper] = {car: times for car, times in lacking.items() if times < ANSWERS}
        return [car for car, times in lacking.items() if times >= ANSWERS]
