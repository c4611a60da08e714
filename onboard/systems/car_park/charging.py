"""When a robot charges: a task that it offers itself, by its gauge and the site's ``[battery]``.

With nothing to do and less than ``seek_percent`` it goes to a charger as it goes to rest: by an itinerary without work,
which others see, and which yields to whoever carries or fetches. On the way and at the charger it bids as ever: so
charging gives way to customers, down to ``floor_percent``. Below that it charges first, and bids again from
``ready_percent`` on; where no other robot says that it may bid, it bids as before, or customers would wait for all of
them. A bid whose work the battery cannot pay for, with the way to a charger behind it, is not made.

Chargers are as many as robots, and all robots can stand at them together (``reader/battery.py``): so whoever wants one
finds one where nobody stands or said that it will, and nobody has to drive another away.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from onboard.contract.battery import BatteryLevel
from onboard.contract.codes import LegAction
from onboard.contract.messages import BatteryState
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.systems.car_park.alternatives import Solution
from onboard.systems.car_park.battery import FULL_PERMILLE
from onboard.systems.car_park.program import CarStep, Program
from onboard.systems.car_park.site import CarPark
from onboard.ways.mirror import WayMirror
from onboard.ways.refuges import open_refuges
from onboard.ways.roads import roads_of

#: The level is told again after this, us, and when it is another by so much (dbc/battery.dbc).
TELL_US, TELL_PERMILLE = 60_000_000, 10
#: Who was not heard to say for so long that it may bid does not, us: two of its words may be lost.
BIDS_FOR_US = 3 * TELL_US
#: So many times what a plan costs by the site's constants must be there: runs are stopped and begun again, and others
#: waited for. A choice: what a trip needs is some hundredths of a battery.
RESERVE = 1.25
#: A charger that gives nothing is passed over for so long, us: a fuse is put in by then.
DEAD_US = 600_000_000
_US_IN_S, _S_IN_H = 1_000_000, 3_600


@dataclass
class Charging:
    """What one robot knows of its battery. All times are bus time in us; without batteries it allows everything."""

    park: CarPark
    mirror: WayMirror
    node_id: int
    #: What its gauge told last; None before it has told anything.
    permille: int | None = None
    is_charging: bool = False
    #: Whether it charges first: from ``floor_percent`` down until it has ``ready_percent`` again.
    is_low: bool = False
    _told: tuple[BatteryLevel, int] | None = None
    #: Until when another robot counts as one that bids, by its last word.
    _bid_until_us: dict[int, int] = field(default_factory=dict)
    _dead_until_us: dict[Segment, int] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether no drive moves any more."""
        return self.permille == 0

    @property
    def _is_ready(self) -> bool:
        return self.permille is not None and not self.is_low

    def bids(self, now_us: int) -> bool:
        """Whether it takes on tasks now, by what all robots have; not before the gauge has told it."""
        if self.park.battery is None or self._is_ready:
            return True
        aside = self.mirror.obstacles.machines
        others = (node for node, until_us in self._bid_until_us.items() if node not in aside and now_us < until_us)
        return self.permille is not None and next(others, None) is None

    def hear(self, word: BatteryLevel, now_us: int) -> None:
        """Another robot tells whether it bids."""
        if word.sender != self.node_id:
            self._bid_until_us[word.sender] = now_us + BIDS_FOR_US if word.bids else now_us

    def sense(self, state: BatteryState, now_us: int) -> list[Effect]:
        """Take up what the gauge tells, and tell the others where it is news, or is told again."""
        battery = self.park.battery
        if battery is None:
            return []
        self.permille, self.is_charging = state.charge_permille, state.charging
        if self.permille < 10 * battery.floor_percent:
            self.is_low = True
        elif self.permille >= 10 * battery.ready_percent:
            self.is_low = False
        word = BatteryLevel(self.node_id, self.permille, self.is_charging, self._is_ready)
        if self._told is not None and now_us < self._told[1] + TELL_US and not _is_news(word, self._told[0]):
            return []
        self._told = word, now_us
        return [Send(word)]

    def pays(self, steps: Sequence[CarStep], now_us: int) -> bool:
        """Whether the charge is enough for a plan, and for the way from its end to the nearest charger."""
        battery = self.park.battery
        if battery is None or not steps:
            return True
        if self.permille is None:
            return False
        run_w = max(battery.drive_w, battery.loaded_drive_w)
        back_us = roads_of(self.park).nearest_us(steps[-1].destination, frozenset(battery.chargers))
        used = battery.rest_w * (max(now_us, steps[-1].end_us) + back_us - now_us) + battery.drive_w * back_us
        for step in steps:
            lasts_us = step.end_us - max(now_us, step.begin_us)
            if lasts_us > 0:
                used += lasts_us * (run_w if step.action is LegAction.TRAVEL else battery.shuttle_w if step.work else 0)
        has_ws = battery.capacity_wh * _S_IN_H * self.permille / FULL_PERMILLE
        return RESERVE * used / _US_IN_S <= has_ws

    def lasts(self, program: Program, solution: Solution, now_us: int) -> bool:
        """Whether the charge is enough for a solution behind what is in hand before it, and to a charger."""
        return self.pays([*program.remaining[: solution.kept], *solution.steps], now_us)

    def wants(self, here: Segment) -> bool:
        """Whether a robot that stands here with nothing to do should go to a charger."""
        battery = self.park.battery
        if battery is None or self.permille is None or (self.is_charging and here in battery.chargers):
            return False
        return self.is_low or self.permille < 10 * battery.seek_percent

    def stays(self, here: Segment) -> bool:
        """Whether it is charged here, and not full."""
        battery = self.park.battery
        return battery is not None and here in battery.chargers and self.is_charging and self.permille != FULL_PERMILLE

    def chargers(self, here: Segment, now_us: int) -> frozenset[Segment]:
        """Where it can be charged, given where the others stand or said that they will; without those that are dead."""
        battery = self.park.battery
        if battery is None:
            return frozenset()
        if here in battery.chargers:
            # It stood here, and no current came.
            self._dead_until_us[here] = now_us + DEAD_US
        dead = {charger for charger, until_us in self._dead_until_us.items() if until_us > now_us}
        return open_refuges(self.park, self.mirror.others_standing()).intersection(battery.chargers).difference(dead)


def _is_news(word: BatteryLevel, told: BatteryLevel) -> bool:
    """Whether a word tells another level than the one before, by a hundredth, or that something began or ended."""
    if (word.charging, word.bids, word.charge_permille == 0) != (told.charging, told.bids, told.charge_permille == 0):
        return True
    return abs(word.charge_permille - told.charge_permille) >= TELL_PERMILLE
