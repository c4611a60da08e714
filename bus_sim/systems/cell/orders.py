"""Goals for a cell as a seed draws them: parts between points that some robot reaches, and nothing stands on."""

import random
from dataclasses import replace

from bus_sim.systems.cell.plant import ORIGIN_US, CellPlant
from bus_sim.systems.orders import OrderArrivals, last_of, tally_of
from bus_sim.systems.stage import Tally
from onboard.contract.codes import OrderResult
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.site import Cell, GoalDemand

#: Points are drawn so far from edges of areas and obstacles at least, mm: the gripper's width.
MARGIN_MM = 500
#: Attempts to find a point beside all obstacles before one is taken as it is: its goal is refused then.
ATTEMPTS = 100
#: About what one order takes, s: measured on the shipped site.
ORDER_S = 60.0


def draw(site: Cell, orders: OrderArrivals, seed: int) -> Cell:
    """The site with drawn goals; none has a deadline, as faults may last longer than any."""
    chance = orders.chance(site.name, seed)
    goals = [GoalDemand(at_ms, _point(site, chance), _point(site, chance)) for at_ms in orders.moments_ms(chance)]
    return replace(site, goals=tuple(goals))


def _point(site: Cell, chance: random.Random) -> Point:
    """Somewhere in the area of a robot that is drawn first."""
    point = Point(0, 0)
    for _ in range(ATTEMPTS):
        area = chance.choice(list(site.arms.values())).area
        x_mm = chance.randint(area.x0_mm + MARGIN_MM, area.x1_mm - MARGIN_MM)
        point = Point(x_mm, chance.randint(area.y0_mm + MARGIN_MM, area.y1_mm - MARGIN_MM))
        if not any(_is_on(point, one.x0_mm, one.y0_mm, one.x1_mm, one.y1_mm) for one in site.obstacles):
            break
    return point


def _is_on(point: Point, x0_mm: int, y0_mm: int, x1_mm: int, y1_mm: int) -> bool:
    return x0_mm - MARGIN_MM < point.x_mm < x1_mm + MARGIN_MM and y0_mm - MARGIN_MM < point.y_mm < y1_mm + MARGIN_MM


def last_s(site: Cell) -> float:
    """When the last order comes, s after power-up."""
    return last_of((one.at_ms for one in site.goals), ORIGIN_US)


def count(plant: CellPlant) -> Tally:
    """What became of the goals."""
    done, refused, expected = OrderResult.DONE, OrderResult.REFUSED, len(plant.site.goals)
    return tally_of(plant.entries, done, refused, expected, plant.timers.now_us())
