"""What compartments say to customers: the part of the history that this system has of its own."""

from dataclasses import dataclass

from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.car_park import Promise
from onboard.contract.messages import Message, Reference
from onboard.history.bounds import drop_oldest
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.car_park.site import CarPark

#: Promises that are kept, the newest: more cars than wait for their drivers anywhere.
PROMISE_LIMIT = 256
#: Announced times that are kept, the newest: more cars than any site has places.
FETCH_TIME_LIMIT = 4_096


@dataclass(frozen=True, slots=True)
class PromiseTold(SystemFact):
    """A customer is told when the car will be there. ``is_first``: it was not known, or is another than before."""

    word: Promise
    is_first: bool


@dataclass(frozen=True, slots=True)
class FetchTimeTold(SystemFact):
    """What the compartment at which a car came in says of a time at which it is to be fetched. ``is_first``: anew."""

    word: FetchTime
    is_first: bool


class CarParkHistory(SystemHistory):
    """The newest promise about each car; what a compartment says of a car that nobody waits for any more stays too."""

    def __init__(self, site: CarPark, tasks: TaskFold) -> None:
        super().__init__(tasks)
        self._bays = {node: bay.number for node, bay in site.compartments.items()}
        #: By the car, the newest.
        self.promises: dict[Reference, Promise] = {}
        #: The newest answer about each car: noted, or why not.
        self.fetch_times: dict[Reference, FetchTime] = {}

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Keep what compartments of the site promise, and what their customers have announced."""
        if isinstance(message, FetchTime):
            return self._fetch_time(message)
        if not isinstance(message, Promise) or message.sender not in self._bays:
            return None
        is_first = self.promises.pop(message.car, None) != message
        self.promises[message.car] = message
        drop_oldest(self.promises, PROMISE_LIMIT, lambda _: True)
        return PromiseTold(message, is_first)

    def _fetch_time(self, word: FetchTime) -> SystemFact | None:
        if word.fetch_word is FetchWord.ASKED or word.sender != word.car.origin:
            return None
        is_first = self.fetch_times.pop(word.car, None) != word
        self.fetch_times[word.car] = word
        drop_oldest(self.fetch_times, FETCH_TIME_LIMIT, lambda _: True)
        return FetchTimeTold(word, is_first)

    def open(self, stations: dict[Reference, int]) -> list[Promise]:
        """Those whose cars are not there yet, by where ``stations`` says that they are; the oldest first."""
        there = {car: self._bays[word.sender] for car, word in self.promises.items()}
        return [word for car, word in self.promises.items() if stations.get(car, there[car]) != there[car]]


def car_park_history(history: History) -> CarParkHistory:
    """A car park's part of a history of its bus."""
    assert isinstance(history.system, CarParkHistory), "the site is a car park"
    return history.system


HISTORY = CarParkHistory
