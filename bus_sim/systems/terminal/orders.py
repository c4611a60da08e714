"""Missions for a terminal as a seed draws them: each box is moved once at most, and none is buried for ever."""

import random
from dataclasses import dataclass, field, replace

from bus_sim.demand import DemandError
from bus_sim.systems.orders import OrderArrivals
from bus_sim.systems.stage import Tally
from bus_sim.systems.terminal.deliveries import deliveries, ordered
from bus_sim.systems.terminal.plant import TerminalPlant
from onboard.contract.codes import KindCode
from onboard.systems.terminal.site import Blockage, EntityKind, Mission, StationKind, Terminal

#: Boxes of a mission at most; the first missions come so long after power-up, us: all take part by then.
MOST_BOXES, ORIGIN_US = 3, 5_000_000
#: So many missions are urgent, and so many seeds have an obstacle on a lane, for a time between these, us: long enough
#: that plans must go around.
URGENT, BLOCKED, FOR_US = 0.2, 0.5, (20_000_000, 120_000_000)
#: About what one order takes, s: measured on the shipped site.
ORDER_S = 180.0


@dataclass
class _Yard:
    """What has not been ordered away yet. A station is either emptied by type or by name, never both."""

    site: Terminal
    standing: dict[int, list[int]] = field(default_factory=dict)
    by_type: set[int] = field(default_factory=set)
    room: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for number, box in enumerate(self.site.boxes, start=1):
            self.standing.setdefault(box.station, []).append(number)
        for one in self.site.entities.values():
            # Whatever came onto a stack that still has orders would have to be moved away first, which nobody does.
            if one.station is StationKind.STACKER or (one.station and one.number not in self.standing):
                self.room[one.number] = one.room - len(self.standing.get(one.number, ()))

    def take(self, chance: random.Random, most: int) -> tuple[int, list[int], int]:
        """Source, boxes that can be had there in this order, target. Needs ``left`` and somewhere to go."""
        sources = [one for one, boxes in self.standing.items() if boxes and self._targets(one)]
        source = chance.choice(sources)
        target = chance.choice(self._targets(source))
        boxes = self.standing[source]
        count = min(chance.randint(1, most), len(boxes), self.room[target])
        top = boxes[: -count - 1 : -1]
        alike = [box for box in top if self.site.boxes[box - 1].type == self.site.boxes[top[0] - 1].type]
        taken = alike if source in self.by_type else top
        # By type, boxes are had from above: others between them would lie in the way.
        taken = taken if taken == top[: len(taken)] else top[:1]
        del boxes[len(boxes) - len(taken) :]
        self.room[target] -= len(taken)
        return source, taken, target

    def _targets(self, source: int) -> list[int]:
        return [one for one, room in self.room.items() if room > 0 and one != source]

    @property
    def left(self) -> int:
        """Boxes that can still be ordered away."""
        return sum(len(boxes) for one, boxes in self.standing.items() if self._targets(one))


def draw(site: Terminal, orders: OrderArrivals, seed: int) -> Terminal:
    """The site with drawn missions and, in some seeds, a blocked lane. Raises ``DemandError`` for too many of them."""
    chance, yard, missions = orders.chance(site.name, seed), _Yard(site), []
    yard.by_type = {one for one in yard.standing if chance.random() < 0.5}
    desks = [node for node, one in site.machines.items() if one.kind is KindCode.DESK]
    moments = orders.moments_ms(chance)
    most = yard.left
    for number, at_ms in enumerate(moments):
        spare = yard.left - (len(moments) - number)
        if spare < 0:
            raise DemandError(f"--orders {orders.count}: {site.name} has boxes for {most} missions at most, one each")
        source, boxes, target = yard.take(chance, min(MOST_BOXES, spare + 1))
        at_us, desk, urgent = ORIGIN_US + at_ms * 1000, chance.choice(desks), chance.random() < URGENT
        if source in yard.by_type:
            kind = site.boxes[boxes[0] - 1].type
            missions.append(Mission(at_us, desk, target, len(boxes), kind, source, urgent=urgent))
        else:
            missions.append(Mission(at_us, desk, target, boxes=tuple(boxes), urgent=urgent))
    return replace(site, missions=tuple(missions), blockages=_blockages(site, chance, moments), presses=())


def _blockages(site: Terminal, chance: random.Random, moments_ms: list[int]) -> tuple[Blockage, ...]:
    lanes = [one.number for one in site.entities.values() if one.kind is EntityKind.LANE]
    if chance.random() >= BLOCKED or not lanes or not moments_ms:
        return ()
    at_us = ORIGIN_US + chance.randint(0, moments_ms[-1] * 1000 + FOR_US[1])
    return (Blockage(chance.choice(lanes), at_us, at_us + chance.randint(*FOR_US)),)


def last_s(site: Terminal) -> float:
    """When the last order comes, s after power-up."""
    return max((one.at_us for one in site.missions), default=0) / 1e6


def count(plant: TerminalPlant) -> Tally:
    """What became of the boxes."""
    found = deliveries(plant.site, plant.world.handled)
    told = ordered(plant.site) - ordered(plant.site, plant.refused)
    left = ordered(plant.site) - told - len(found)
    waits_us = [one.finished_us for one in found]
    if left:
        waits_us.append(plant.now_us() - min((one.at_us for one in plant.site.missions), default=0))
    return Tally(len(found), told, left, max(waits_us, default=0) / 1e6)
