"""A polishing shop in the simulator: motors, the desk's rack, who comes, and what became of the parts."""

import random
from dataclasses import dataclass, replace
from functools import partial

from polishing_shop.frames import PartIn, PartOut, Polish, Polished
from polishing_shop.site import Shop

from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import Timers
from bus_sim.systems.orders import EndedOrder, OrderArrivals, OrderedSystem, tally
from bus_sim.systems.stage import SystemStage, Tally
from onboard.contract.codes import KindCode
from onboard.contract.messages import Message

#: Parts come so long after power-up, us; the rack says again what has come, us.
ORIGIN_US, AGAIN_US = 8_000_000, 2_000_000


class Motor:
    """One polisher's motor: it does one part at a time, and no part twice."""

    def __init__(self, node: int, plant: "Plant", link: BusDeviceLink) -> None:
        self._node, self._plant, self._link, self._number = node, plant, link, 0
        link.subscribe(self._told)

    def _told(self, message: Message, now_us: int) -> None:
        if isinstance(message, Polish) and message.number != self._number:
            self._number = message.number
            until_us = now_us + self._plant.site.polishing_us[self._node]
            self._plant.timers.call_at(until_us, partial(self._done, message.number))

    def _done(self, number: int) -> None:
        self._plant.polished(number)
        self._link.send(Polished(self._node, number))


@dataclass
class Part:
    """One part: when it came, and when it was out, us."""

    came_us: int
    polished: int = 0
    out_us: int | None = None


class Plant:
    """Everything that is not a controller, and the oracle."""

    def __init__(self, site: Shop, timers: Timers, links: dict[int, BusDeviceLink], _seed: int) -> None:
        self.site, self.timers, self._rack = site, timers, links[site.desk]
        self.violations: list[str] = []
        self.parts: dict[int, Part] = {}
        self._motors = [Motor(node, self, links[node]) for node in site.polishing_us]
        self._rack.subscribe(self._told)

    def start(self) -> None:
        """Power on: parts come in their time."""
        for number, at_ms in enumerate(self.site.parts_ms, start=1):
            self.timers.call_at(ORIGIN_US + at_ms * 1000, partial(self._come, number))

    @property
    def is_over(self) -> bool:
        """Whether all parts have come and are out."""
        came = len(self.parts) == len(self.site.parts_ms)
        return came and all(part.out_us is not None for part in self.parts.values())

    def polished(self, number: int) -> None:
        """A motor is done with a part: the oracle counts."""
        self.parts[number].polished += 1
        if self.parts[number].polished > 1:
            self.violations.append(f"{self.timers.now_us() / 1e6:.3f} s: part {number} was polished twice")

    def _come(self, number: int) -> None:
        part = self.parts.setdefault(number, Part(self.timers.now_us()))
        if part.out_us is None:
            self._rack.send(PartIn(self.site.desk, number))
            self.timers.call_at(self.timers.now_us() + AGAIN_US, partial(self._come, number))

    def _told(self, message: Message, now_us: int) -> None:
        if isinstance(message, PartOut):
            part = self.parts[message.number]
            part.out_us = part.out_us or now_us
            if not part.polished:
                self.violations.append(f"{now_us / 1e6:.3f} s: part {message.number} went out rough")


class ShopStage(SystemStage[Plant]):
    """One run of a shop: its picture and its figures."""

    who = "parts"

    def tally(self) -> Tally:
        """What became of the parts."""
        parts = self.plant.parts.values()
        ended = [EndedOrder(part.out_us is not None, False, part.came_us, part.out_us) for part in parts]
        return tally(ended, len(self.plant.site.parts_ms), self.plant.timers.now_us())

    def picture(self) -> str:
        """A mark for each part: on the rack, polished, out."""
        marks = (
            "." if not part.polished else "o" if part.out_us is None else "O" for part in self.plant.parts.values()
        )
        return f"{self.plant.timers.now_us() / 1e6:8.1f} s  parts {''.join(marks)}"

    def figures(self) -> dict[str, object]:
        """What a shop is judged by."""
        counted = self.tally()
        return {"parts": len(self.plant.parts), "polished": counted.served, "longest_wait_s": counted.longest_wait_s}


def draw(site: Shop, orders: OrderArrivals, seed: int) -> Shop:
    """The site with parts that a seed draws."""
    chance: random.Random = orders.chance(site.name, seed)
    return replace(site, parts_ms=tuple(orders.moments_ms(chance)))


def order_s(site: Shop) -> float:
    """About what one part takes, s."""
    return max(site.polishing_us.values()) / 1e6


SIMULATED = OrderedSystem(
    Shop.system,
    Plant,
    ShopStage,
    draw,
    lambda site: ORIGIN_US / 1e6 + max(site.parts_ms, default=0) / 1e3,
    order_s,
    lambda site: OrderArrivals(4, order_s(site) / len(site.polishing_us)),
    worker=KindCode.LATHE,
)
