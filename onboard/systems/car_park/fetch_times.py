"""When cars will be fetched, as their drivers say beforehand: at any desk, or to a gateway.

The compartment at which a car came in answers for that: it notes the time in its journal and says so to all
(``FetchTime``), again to whoever asks what others know, until the car has left; the newest time counts. Another's desk
asks it, as a gateway does. It is a hint: no right and no task rests on it, and who comes at another time is served as
ever. Sites with ``quiet_moves`` bring such a car near beforehand (``quiet_moves.py``).
"""

from dataclasses import dataclass, field

from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.announce_device import DeskFetchAnswer
from onboard.contract.codes import DeskText
from onboard.contract.messages import Message, Reference
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.systems.car_park import bay_task
from onboard.systems.car_park.bay_memory import BayMemory
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.records import FetchTimeRecord
from onboard.systems.car_park.stays import Stays
from onboard.ways.mirror import WayFleet

#: Nobody knows what will be so long from now, us: a week, and a tenth of what times on the wire tell apart.
MOST_AHEAD_US = 7 * 24 * 3_600_000_000
#: The other compartment is asked so often, so far apart, us, before the customer reads that it is silent.
ASKS, ASK_AGAIN_US = 3, 1_000_000
#: Times that come over the bus are noted so far apart, us, as each is a record on the disk; who asks asks again.
NOTE_APART_US = 500_000


@dataclass
class AskedTime:
    """A time that a customer named here for a car that came in elsewhere: bus ms; ``again_us``: bus us."""

    fetch_ms: int
    again_us: int
    asks: int = 1


@dataclass
class FetchTimes:
    """One compartment's. All times are bus time."""

    fleet: WayFleet
    memory: BayMemory
    outputs: BayOutputs
    stays: Stays
    #: Of cars that came in here, bus ms.
    known: dict[Reference, int] = field(init=False)
    asked: dict[Reference, AskedTime] = field(default_factory=dict)
    _is_learned: bool = False
    _noted_us: int | None = None

    def __post_init__(self) -> None:
        self.known = dict(self.memory.fetch_times)

    # --- what is said here, and heard --------------------------------------------------------------------------

    def at_desk(self, car: Reference, in_s: int, now_us: int) -> list[Effect]:
        """A right ticket went in, and its driver says in how many seconds the car will be fetched."""
        if self.fleet.has_no_rights:
            return [self.outputs.show(DeskText.OUT_OF_ORDER, car)]
        fetch_ms = to_bus_ms(now_us + in_s * 1_000_000)
        if car.origin == self.fleet.node_id:
            word, noted = self._take(car, fetch_ms, now_us)
            return [*noted, self._answer(car, fetch_ms, word, now_us)]
        if car.origin not in self.fleet.site.compartments:
            return [self._answer(car, fetch_ms, FetchWord.NOT_INSIDE, now_us)]
        self.asked[car] = AskedTime(fetch_ms, now_us + ASK_AGAIN_US)
        return [self._word(car, fetch_ms, FetchWord.ASKED)]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Somebody asks for a car that came in here, or the compartment of another has answered."""
        if not isinstance(message, FetchTime):
            return []
        car, fetch_ms, is_asked = message.car, message.fetch_ms, message.fetch_word is FetchWord.ASKED
        if is_asked and car.origin == self.fleet.node_id:
            return self._asked_for(car, fetch_ms, now_us)
        one = self.asked.get(car)
        if is_asked or one is None or message.sender != car.origin or one.fetch_ms != fetch_ms:
            return []
        del self.asked[car]
        return [self._answer(car, fetch_ms, message.fetch_word, now_us)]

    def _asked_for(self, car: Reference, fetch_ms: int, now_us: int) -> list[Effect]:
        if self.fleet.has_no_rights:
            return []
        is_soon = self._noted_us is not None and now_us < self._noted_us + NOTE_APART_US
        is_new = self.known.get(car) != fetch_ms
        if is_new and is_soon and self._judged(car, from_bus_ms(fetch_ms, now_us), now_us) is FetchWord.NOTED:
            return []
        word, noted = self._take(car, fetch_ms, now_us)
        self._noted_us = now_us if noted else self._noted_us
        # Who asks again has not heard the answer.
        return noted or [self._word(car, fetch_ms, word)]

    def _take(self, car: Reference, fetch_ms: int, now_us: int) -> tuple[FetchWord, list[Effect]]:
        """Whether a time is noted, and what follows where it was not known."""
        word = self._judged(car, from_bus_ms(fetch_ms, now_us), now_us)
        if word is not FetchWord.NOTED or self.known.get(car) == fetch_ms:
            return word, []
        self.known[car] = fetch_ms
        self._learn(car, fetch_ms, now_us)
        return word, [Record(FetchTimeRecord(car, fetch_ms)), self._word(car, fetch_ms, word)]

    def _judged(self, car: Reference, fetch_us: int, now_us: int) -> FetchWord:
        if car not in self.fleet.mirror.cars or bay_task.is_gone(car, self.fleet.mirror):
            return FetchWord.NOT_INSIDE
        if fetch_us <= now_us:
            return FetchWord.PAST
        return FetchWord.NOTED if fetch_us <= now_us + MOST_AHEAD_US else FetchWord.TOO_FAR

    # --- what falls due ----------------------------------------------------------------------------------------

    def review(self, now_us: int) -> list[Effect]:
        """Forget cars that have left; ask those again who have not answered."""
        if not self._is_learned:
            self._is_learned = True
            for car, fetch_ms in self.known.items():
                self._learn(car, fetch_ms, now_us)
        for car in [car for car in self.known if self._has_left(car)]:
            del self.known[car]
        effects: list[Effect] = []
        for car, one in list(self.asked.items()):
            if now_us < one.again_us:
                continue
            if one.asks < ASKS:
                one.asks, one.again_us = one.asks + 1, now_us + ASK_AGAIN_US
                effects.append(self._word(car, one.fetch_ms, FetchWord.ASKED))
            else:
                del self.asked[car]
                effects.append(self._answer(car, one.fetch_ms, FetchWord.NO_ANSWER, now_us))
        return effects

    def next_wake(self) -> int | None:
        """When another compartment is asked again, bus us."""
        return min((one.again_us for one in self.asked.values()), default=None)

    def statements(self) -> list[Effect]:
        """The times of cars that came in here and are inside, for whoever was away."""
        inside = (car for car in self.known if not bay_task.is_gone(car, self.fleet.mirror))
        return [self._word(car, self.known[car], FetchWord.NOTED) for car in inside]

    def _has_left(self, car: Reference) -> bool:
        """One that is not known was there before this machine's rights are known again."""
        is_known = car in self.fleet.mirror.cars
        return bay_task.is_gone(car, self.fleet.mirror) or (not is_known and self.fleet.tokens.is_synced)

    def _learn(self, car: Reference, fetch_ms: int, now_us: int) -> None:
        """Nobody hears itself."""
        self.stays.hear(FetchTime(self.fleet.node_id, car, fetch_ms, FetchWord.NOTED), now_us)

    def _word(self, car: Reference, fetch_ms: int, word: FetchWord) -> Effect:
        return Send(FetchTime(self.fleet.node_id, car, fetch_ms, word))

    def _answer(self, car: Reference, fetch_ms: int, word: FetchWord, now_us: int) -> Effect:
        """Said once: who does not see it says it again."""
        in_s = max(0, from_bus_ms(fetch_ms, now_us) - now_us) // 1_000_000
        return Tell(DeskFetchAnswer(self.fleet.node_id, car, in_s, word))
