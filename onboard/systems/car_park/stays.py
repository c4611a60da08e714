"""How long cars stay, learned from what the bus tells: by the hour in which they came, or as their drivers say it.

The hour is that of bus time in a day of 24 hours: no wall clock is needed, only that people's days are alike. Each
machine learns by itself, from power-up on, and nothing is said of it; so two may differ, and only in their own choice.
"""

from collections import deque
from dataclasses import dataclass, field

from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Message, Reference
from onboard.core.serial import from_bus_ms

HOUR_US = 3_600_000_000
_HOURS = 24
#: Stays remembered of each hour, and of all together: some weeks of a garage, and its last days.
MOST_OF_HOUR, MOST_OF_ALL = 64, 256
#: Of fewer the mean of all is taken.
FEWEST = 3
#: Cars whose coming is remembered: more than any site has places. The oldest are forgotten.
MOST_CARS = 4_096


@dataclass
class Stays:
    """What one machine has heard of cars that came and went. Times are bus time in us."""

    _since_us: dict[Reference, int] = field(default_factory=dict)
    #: When drivers mean to come for their cars, as the compartments have it at which these came in.
    announced_us: dict[Reference, int] = field(default_factory=dict)
    _of_hour: dict[int, deque[int]] = field(default_factory=dict)
    _of_all: deque[int] = field(default_factory=lambda: deque(maxlen=MOST_OF_ALL))
    #: Most cars that were inside at one time.
    most: int = 0

    def hear(self, message: Message, now_us: int) -> None:
        """A car is somewhere inside for the first time, or has left; or when its driver will come for it."""
        if isinstance(message, FetchTime):
            if message.fetch_word is FetchWord.NOTED and message.sender == message.car.origin:
                self.announced_us.pop(message.car, None)
                self.announced_us[message.car] = from_bus_ms(message.fetch_ms, now_us)
                while len(self.announced_us) > MOST_CARS:
                    del self.announced_us[next(iter(self.announced_us))]
            return
        if not isinstance(message, CarAt) or message.station == ANY_STATION:
            return
        if message.station != OUTSIDE:
            self._since_us.setdefault(message.car, now_us)
            while len(self._since_us) > MOST_CARS:
                del self._since_us[next(iter(self._since_us))]
            self.most = max(self.most, len(self._since_us))
            return
        self.announced_us.pop(message.car, None)
        since_us = self._since_us.pop(message.car, None)
        if since_us is not None:
            self._of_hour.setdefault(_hour(since_us), deque(maxlen=MOST_OF_HOUR)).append(now_us - since_us)
            self._of_all.append(now_us - since_us)

    def expected_us(self, came_us: int) -> int | None:
        """How long who comes at a time stays on average; None before anything is known."""
        known = self._of_hour.get(_hour(came_us), ())
        stays = known if len(known) >= FEWEST else self._of_all
        return sum(stays) // len(stays) if stays else None

    def fetched_us(self, car: Reference) -> int | None:
        """When a car is likely to be fetched: as its driver said, else as others were; None where nothing is known."""
        if car in self.announced_us:
            return self.announced_us[car]
        since_us = self._since_us.get(car)
        stays_us = None if since_us is None else self.expected_us(since_us)
        return None if since_us is None or stays_us is None else since_us + stays_us

    def shorter_permille(self, stay_us: int) -> int:
        """How many of the last stays were shorter than one, in thousandths; 0 before anything is known."""
        return 1_000 * sum(one < stay_us for one in self._of_all) // max(1, len(self._of_all))


def _hour(time_us: int) -> int:
    return time_us // HOUR_US % _HOURS
