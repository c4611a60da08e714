"""One robot that was started again, with what its devices and the others say, for tests of its steps."""

from collections.abc import Mapping

from onboard.contract.codes import Criterion, DriveMode, KindCode, MachineState, Operation, ShuttleMode, Side
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    BusTime,
    CallForProposals,
    DriveOrder,
    DriveState,
    Heartbeat,
    Itinerary,
    Message,
    Reference,
    ShuttleState,
)
from onboard.core.effects import Actuate, Effect, Send
from onboard.core.site import Station
from onboard.holon.holon import Holon
from onboard.systems.car_park.program import CarHandling, StationWork
from onboard.systems.car_park.recovery import award_record, handled_record
from onboard.systems.car_park.site import CarPark
from onboard.systems.registry import factory_for
from tests.sites import one_floor

Entry = Mapping[str, str | int]
SITE = one_floor(2)
STEWARD, ROBOT, OTHER = 1, 11, 12
TASK = Reference(STEWARD, 1)
BAY, PLACE = Station(1, 4, Side.NEAR), Station(1, 9, Side.FAR)
CALL = CallForProposals(
    STEWARD,
    7,
    TASK,
    Operation.PARK,
    KindCode.ROBOT,
    Criterion.FINISH_TIME,
    1,
    0,
    1_000,
    BAY.number,
    ANY_STATION,
    TASK,
    2_700,
)
BOOT: Entry = {"record": "boot", "boot": 1}
AWARDED: tuple[Entry, Entry] = BOOT, award_record(CALL, BAY, PLACE, 1).entry
TAKEN = handled_record(StationWork(CarHandling.TAKE, BAY, TASK, 2_700, CALL)).entry
MOVED_US = 20_000_000


class Board:
    """One robot that was started again, with what its devices and the others say."""

    def __init__(self, *entries: Entry, site: CarPark = SITE) -> None:
        factory = factory_for(site, KindCode.ROBOT)
        self.holon = Holon(site, site.machines[ROBOT], factory, boot=2, entries=entries)
        self.said: list[Effect] = list(self.holon.start(0))
        self.said += self.holon.receive(BusTime(STEWARD, 0), 0)
        self.holon.tokens.trust()
        self.now_us = 0

    def stands(self, index: int, mode: DriveMode = DriveMode.STANDING) -> None:
        position_mm = (index - 1) * SITE.tracks[1].pitch_mm
        self.said += self.holon.sense(DriveState(ROBOT, 0, position_mm, 0, mode, at_mark=True), self.now_us)

    def shuttle(self, mode: ShuttleMode, load_kg: int = 0) -> None:
        self.said += self.holon.sense(ShuttleState(ROBOT, 0, mode, 0, Side.FAR, load_kg, 2_500), self.now_us)

    def hears(self, *messages: Message) -> None:
        for message in messages:
            self.said += self.holon.receive(message, self.now_us)

    def lives(self, until_us: int) -> None:
        """Wakes whenever it is due."""
        while True:
            due_us = self.holon.next_wake()
            if due_us is None or due_us > until_us:
                break
            assert due_us > self.now_us or self.now_us == 0, "it wakes for ever at one moment"
            self.now_us = max(due_us, self.now_us + 1)
            self.said += self.holon.wake(self.now_us)
        self.now_us = until_us

    @property
    def state(self) -> MachineState:
        return [one.message.state for one in self.said if isinstance(one, Send) and isinstance(one.message, Heartbeat)][
            -1
        ]

    @property
    def plans(self) -> list[Itinerary]:
        return [one.message for one in self.said if isinstance(one, Send) and isinstance(one.message, Itinerary)]

    @property
    def drives(self) -> list[DriveOrder]:
        return [one.message for one in self.said if isinstance(one, Actuate) and isinstance(one.message, DriveOrder)]


def taking_part(site: CarPark, node: int) -> Holon:
    """A machine of a site that has its rights from the start, as where nobody else is."""
    machine = site.machines[node]
    holon = Holon(site, machine, factory_for(site, machine.kind), boot=1)
    holon.start(0)
    holon.tokens.trust()
    return holon
