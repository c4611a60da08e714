"""Orders that a seed draws for a site of any system but the car park, and what became of them at the run's end."""

import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

from bus_sim.demand import DemandError, Law
from bus_sim.systems.session import PlantMaker, SystemPlant
from onboard.core.site import Site


@dataclass(frozen=True)
class Orders:
    """So many orders at normal intervals of mean ``apart_s`` and half of it as deviation; 0: the site's own ones."""

    count: int
    apart_s: float

    def moments_ms(self, chance: random.Random) -> list[int]:
        """When each comes, ms after the first."""
        law, at_us, moments = Law(self.apart_s, self.apart_s / 2), 0, []
        for _ in range(self.count):
            moments.append(at_us // 1000)
            at_us += law.draw_us(chance)
        return moments

    def chance(self, site: str, seed: int) -> random.Random:
        """The source of everything that is drawn for one seed of a site."""
        return random.Random(f"orders:{site}:{seed}")


class Tally(NamedTuple):
    """What became of everybody who came; times in s. ``full``: those told why for want of room."""

    served: int
    told: int
    waiting: int
    longest_wait_s: float
    full: int = 0


@dataclass(frozen=True)
class System:
    """One system in campaigns: its plant, how orders are drawn, when the site's last one comes, how they are counted.

    ``order_s`` is about what one order takes on a site: faults strike until the last one should be done. ``usual`` are
    the orders of a seed where nothing else is asked for: as many as the machines can just carry out.
    """

    plant: PlantMaker
    draw: Callable[[Site, Orders, int], Site]
    last_s: Callable[[Site], float]
    tally: Callable[[SystemPlant], Tally]
    order_s: Callable[[Site], float]
    usual: Callable[[Site], Orders]
    #: What ``tally`` counts.
    who: str = "orders"


class Answered(Protocol):
    """An order at a plant's counter: its last answer, and its times, us."""

    @property
    def result(self) -> Enum | None:
        """The counter's last word of it."""

    @property
    def begun_us(self) -> int:
        """When the order came, loop time in us."""

    @property
    def ended_us(self) -> int | None:
        """When it was over, loop time in us; None while it is not."""


class Ended(NamedTuple):
    """One order at the end: whether it was carried out, or refused, or neither; its times, us."""

    done: bool
    refused: bool
    begun_us: int
    ended_us: int | None


def tally(entries: list[Ended], expected: int, now_us: int) -> Tally:
    """Count orders; ``expected`` are all that the run brings, also those that have not come yet."""
    served, told = sum(one.done for one in entries), sum(one.refused for one in entries)
    waits_us = [(now_us if one.ended_us is None else one.ended_us) - one.begun_us for one in entries]
    return Tally(served, told, expected - served - told, max(waits_us, default=0) / 1e6)


def nothing_to_draw(site: str, what: str) -> DemandError:
    """The line for a site from which no order can be drawn."""
    return DemandError(f"{site}: no orders can be drawn for it, as it has {what}; write --orders 0 for its own")


def last_of(moments_ms: Iterable[int], origin_us: int) -> float:
    """When the last of the orders at these moments after ``origin_us`` comes, s after power-up."""
    return origin_us / 1e6 + max(moments_ms, default=0) / 1e3


def tally_of(entries: Iterable[Answered], done: Enum, refused: Enum, expected: int, now_us: int) -> Tally:
    """What became of orders that a counter answers: the last word of each is ``done``, ``refused`` or another."""
    ended = [Ended(one.result is done, one.result is refused, one.begun_us, one.ended_us) for one in entries]
    return tally(ended, expected, now_us)
