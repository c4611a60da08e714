"""What compartments say to customers: the part of the history that this system has of its own."""

from dataclasses import dataclass

from onboard.contract.car_park import Promise
from onboard.contract.messages import Message, Reference
from onboard.history.bounds import drop_oldest
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.car_park.site import CarPark

#: Promises that are kept, the newest: more cars than wait for their drivers anywhere.
PROMISE_LIMIT = 256


@dataclass(frozen=True, slots=True)
class PromiseTold(SystemFact):
    """A customer is told when the car will be there. ``is_first``: it was not known, or is another than before."""

    word: Promise
    is_first: bool


class CarParkHistory(SystemHistory):
    """The newest promise about each car; what a compartment says of a car that nobody waits for any more stays too."""

    def __init__(self, site: CarPark, tasks: TaskFold) -> None:
        super().__init__(tasks)
        self._bays = {node: bay.number for node, bay in site.compartments.items()}
        #: By the car, the newest.
        self.promises: dict[Reference, Promise] = {}

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Keep what compartments of the site promise."""
        if not isinstance(message, Promise) or message.sender not in self._bays:
            return None
        is_first = self.promises.pop(message.car, None) != message
        self.promises[message.car] = message
        drop_oldest(self.promises, PROMISE_LIMIT, lambda _: True)
        return PromiseTold(message, is_first)

    def open(self, stations: dict[Reference, int]) -> list[Promise]:
        """Those whose cars are not there yet, by where ``stations`` says that they are; the oldest first."""
        there = {car: self._bays[word.sender] for car, word in self.promises.items()}
        return [word for car, word in self.promises.items() if stations.get(car, there[car]) != there[car]]


def car_park_history(history: History) -> CarParkHistory:
    """A car park's part of a history of its bus."""
    assert isinstance(history.system, CarParkHistory), "the site is a car park"
    return history.system


HISTORY = CarParkHistory
