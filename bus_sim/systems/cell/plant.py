"""The cell as it is: robots that move in the plane, parts that lie or are carried, the counter, and the oracle.

It knows nothing of goals, contracts or tokens; it moves what it is ordered to move and notes what must never happen.
"""

from dataclasses import dataclass, field
from functools import partial
from math import hypot

from bus_sim.devices.link import BusDeviceLink, DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from onboard.contract.cell import ArmMode, GripAction, GripMode, RefusedFor
from onboard.contract.cell_device import ArmOrder, ArmState, GripOrder, GripState, OrderAnswer, OrderFrom, OrderTo
from onboard.contract.codes import OrderResult
from onboard.contract.messages import Message, Reference
from onboard.core.serial import is_newer
from onboard.systems.cell.contracts import Arm
from onboard.systems.cell.geometry import Area, Point
from onboard.systems.cell.site import Cell, GoalDemand

#: A moving drive that hears no order for this long stops (dbc/cell.dbc).
DRIVE_TIME_OUT_US = 500_000
MOVING_WORD_US = 500_000
RESTING_WORD_US = 10_000_000
#: A part is gripped from this far at most, and a position is whole millimetres, mm.
REACH_MM = 5.0
#: What a robot may be outside its area or inside an obstacle by rounding, mm.
SLACK_MM = 2.0
#: Orders begin so long after power-up, us: the machines find each other first.
ORIGIN_US = 10_000_000
ENTRY_REPEAT_US = 1_000_000

_NO_PART = Reference(0, 0)


@dataclass
class Parts:
    """Where every part is: at a place, or in the gripper of a robot (its node-ID). A part is in one place."""

    lying: dict[Reference, Point] = field(default_factory=dict)
    aboard: dict[Reference, int] = field(default_factory=dict)

    def of(self, node: int) -> Reference:
        """The part that a robot holds, ``(0, 0)`` for none."""
        return next((part for part, holder in self.aboard.items() if holder == node), _NO_PART)


class ArmDevice:
    """Drive and gripper of one robot: straight lines at constant speed, from wherever it is."""

    def __init__(self, arm: Arm, plant: "CellPlant", link: DeviceBusLink) -> None:
        self.arm = arm
        self._plant = plant
        self._timers = plant.timers
        self._link = link
        self._from = self._to = (float(arm.home.x_mm), float(arm.home.y_mm))
        self._begin_us = self._end_us = 0
        self._sequence = 0
        self._grip_sequence = 0
        self._grip_mode = GripMode.OPEN
        self._fresh_until_us = 0
        self._word: Timer | None = None
        self._grip_word: Timer | None = None
        self._arrival: Timer | None = None
        self._expiry: Timer | None = None
        link.subscribe(self._on_message)
        link.answer(self.start)

    def start(self) -> None:
        """Power on, or asked for it: say where it is and what it holds."""
        self._say()
        self._say_grip()

    def at(self, now_us: int) -> tuple[float, float]:
        """Where the arm's tool is at ``now_us``, x and y in mm: on the straight line of its last order."""
        if now_us >= self._end_us:
            return self._to
        share = (now_us - self._begin_us) / (self._end_us - self._begin_us)
        return (
            self._from[0] + share * (self._to[0] - self._from[0]),
            self._from[1] + share * (self._to[1] - self._from[1]),
        )

    @property
    def is_moving(self) -> bool:
        """Whether it has not come to the end of its line."""
        return self._timers.now_us() < self._end_us

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_message(self, message: Message, now_us: int) -> None:
        match message:
            case ArmOrder():
                self._on_order(message, self._timers.now_us())
            case GripOrder() if is_newer(message.sequence, self._grip_sequence, 8) or not self._grip_sequence:
                self._on_grip(message, self._timers.now_us())

    def _on_order(self, order: ArmOrder, now_us: int) -> None:
        self._fresh_until_us = now_us + DRIVE_TIME_OUT_US
        target = (float(order.x_mm), float(order.y_mm))
        if order.sequence == self._sequence and (self.is_moving or self.at(now_us) == target):
            self._watch(now_us)
            return
        self._sequence = order.sequence
        if self._grip_mode is GripMode.BUSY:
            self._plant.note(f"{self.arm.name} was told to move while its gripper works")
        self._go(target, now_us)

    def _go(self, target: tuple[float, float], now_us: int) -> None:
        here = self.at(now_us)
        self._plant.check_line(self.arm, here, target)
        length_mm = hypot(target[0] - here[0], target[1] - here[1])
        self._from, self._to = here, target
        self._begin_us, self._end_us = now_us, now_us + round(length_mm * 1e6 / self.arm.speed_mm_s)
        if self._arrival is not None:
            self._arrival.cancel()
        self._arrival = self._timers.call_at(self._end_us, self._say)
        self._watch(now_us)
        self._say()

    def _watch(self, now_us: int) -> None:
        """Stop where no fresh order comes."""
        if self._expiry is not None:
            self._expiry.cancel()
        self._expiry = self._timers.call_at(self._fresh_until_us, self._expire) if self.is_moving else None

    def _expire(self) -> None:
        now_us = self._timers.now_us()
        if self.is_moving and now_us >= self._fresh_until_us:
            here = self.at(now_us)
            self._from = self._to = (float(round(here[0])), float(round(here[1])))
            self._begin_us = self._end_us = now_us
            self._say()

    def _on_grip(self, order: GripOrder, now_us: int) -> None:
        self._grip_sequence = order.sequence
        if self.is_moving:
            self._plant.note(f"{self.arm.name} was told to grip while it moves")
        self._grip_mode = GripMode.BUSY
        self._say_grip()
        self._timers.call_at(now_us + self._plant.site.timing.grip_us, lambda: self._gripped(order))

    def _gripped(self, order: GripOrder) -> None:
        parts, here = self._plant.parts, self.at(self._timers.now_us())
        if order.grip_action is GripAction.TAKE:
            lies = parts.lying.get(order.part)
            empty = parts.of(self.arm.node_id) == _NO_PART
            if lies is not None and empty and hypot(lies.x_mm - here[0], lies.y_mm - here[1]) <= REACH_MM:
                del parts.lying[order.part]
                parts.aboard[order.part] = self.arm.node_id
                self._plant.taken(self.arm, order.part)
            holds = parts.of(self.arm.node_id) != _NO_PART
            self._grip_mode = GripMode.HOLDING if holds else GripMode.NOTHING_THERE
        else:
            held = parts.of(self.arm.node_id)
            if held != _NO_PART:
                del parts.aboard[held]
                parts.lying[held] = Point(round(here[0]), round(here[1]))
            self._grip_mode = GripMode.OPEN
        self._say_grip()

    # --- words -------------------------------------------------------------------------------------------------

    def _say(self) -> None:
        now_us = self._timers.now_us()
        x_mm, y_mm = self.at(now_us)
        mode = ArmMode.GOING if self.is_moving else ArmMode.RESTING
        self._link.send(ArmState(self.arm.node_id, self._sequence, round(x_mm), round(y_mm), mode))
        if self._word is not None:
            self._word.cancel()
        self._word = self._timers.call_at(now_us + (MOVING_WORD_US if self.is_moving else RESTING_WORD_US), self._say)

    def _say_grip(self) -> None:
        held = self._plant.parts.of(self.arm.node_id)
        self._link.send(GripState(self.arm.node_id, self._grip_sequence, self._grip_mode, held))
        if self._grip_word is not None:
            self._grip_word.cancel()
        is_busy = self._grip_mode is GripMode.BUSY
        again_us = self._timers.now_us() + RESTING_WORD_US
        self._grip_word = None if is_busy else self._timers.call_at(again_us, self._say_grip)


@dataclass
class GoalEntry:
    """One order at the counter and what became of it."""

    number: int
    demand: GoalDemand
    begun_us: int
    result: OrderResult | None = None
    cost_mm: int = 0
    refused_for: RefusedFor = RefusedFor.NOTHING
    ended_us: int | None = None


class GoalCounter:
    """The goal manager's counter: says each order until it is answered (row C03)."""

    def __init__(self, node_id: int, plant: "CellPlant", link: DeviceBusLink) -> None:
        self.node_id = node_id
        self.entries: list[GoalEntry] = []
        self._plant = plant
        self._link = link
        link.subscribe(self._on_message)

    def add(self, demand: GoalDemand) -> None:
        """Somebody wants a part carried, now."""
        plant = self._plant
        entry = GoalEntry(len(self.entries) + 1, demand, plant.timers.now_us())
        self.entries.append(entry)
        plant.parts.lying[Reference(self.node_id, entry.number)] = demand.start
        self._say(entry)

    def _say(self, entry: GoalEntry) -> None:
        if entry.result is not None:
            return
        demand = entry.demand
        self._link.send(OrderFrom(self.node_id, entry.number, *demand.start))
        self._link.send(OrderTo(self.node_id, entry.number, *demand.end, demand.within_ms))
        self._plant.timers.call_at(self._plant.timers.now_us() + ENTRY_REPEAT_US, lambda: self._say(entry))

    def _on_message(self, message: Message, now_us: int) -> None:
        if not isinstance(message, OrderAnswer) or not 0 < message.order <= len(self.entries):
            return
        entry = self.entries[message.order - 1]
        if entry.ended_us is not None:
            return
        entry.result = message.order_result
        entry.cost_mm = message.cost_mm or entry.cost_mm
        entry.refused_for = message.refused_for
        if message.order_result in (OrderResult.DONE, OrderResult.REFUSED):
            entry.ended_us = self._plant.timers.now_us()
            self._plant.check_end(Reference(self.node_id, entry.number), entry)


class CellPlant:
    """All devices of a cell, its parts, and the oracle's notes in ``violations``."""

    def __init__(self, site: Cell, timers: Timers, links: dict[int, BusDeviceLink]) -> None:
        self.site = site
        self.timers = timers
        self.links = links
        self.parts = Parts()
        self.violations: list[str] = []
        self.devices = {node: ArmDevice(arm, self, links[node]) for node, arm in site.arms.items()}
        self.counters = {node: GoalCounter(node, self, links[node]) for node in site.desks}
        #: Who took which part up, in order of time.
        self.takes: list[tuple[Reference, int]] = []
        self._to_come = len(site.goals)

    def start(self) -> None:
        """Power on, and let the demand come."""
        for device in self.devices.values():
            device.start()
        desks = list(self.counters.values())
        for number, demand in enumerate(self.site.goals):
            counter = desks[number % len(desks)]
            self.timers.call_at(ORIGIN_US + demand.at_ms * 1000, partial(self._come, counter, demand))

    def _come(self, counter: GoalCounter, demand: GoalDemand) -> None:
        self._to_come -= 1
        counter.add(demand)

    @property
    def entries(self) -> list[GoalEntry]:
        """All orders that came so far, counter by counter."""
        return [entry for counter in self.counters.values() for entry in counter.entries]

    @property
    def is_over(self) -> bool:
        """Whether all orders have come and each was achieved or refused."""
        return not self._to_come and all(entry.ended_us is not None for entry in self.entries)

    # --- the oracle --------------------------------------------------------------------------------------------

    def note(self, violation: str) -> None:
        """Something that must never happen has happened."""
        self.violations.append(f"{self.timers.now_us() / 1e6:.3f} s: {violation}")

    def check_line(self, arm: Arm, here: tuple[float, float], there: tuple[float, float]) -> None:
        """A robot stays in its own area and goes through no obstacle (rows C01, C04)."""
        x0, y0, x1, y1 = arm.area
        for x, y in (here, there):
            if not (x0 - SLACK_MM <= x <= x1 + SLACK_MM and y0 - SLACK_MM <= y <= y1 + SLACK_MM):
                self.note(f"{arm.name} leaves its working area at ({x:.0f}, {y:.0f})")
        for obstacle in self.site.obstacles:
            if _inside_of(here, there, obstacle):
                self.note(f"{arm.name} goes through the obstacle at {tuple(obstacle)}")

    def taken(self, arm: Arm, part: Reference) -> None:
        """A robot has taken a part up."""
        self.takes.append((part, arm.node_id))

    def check_end(self, part: Reference, entry: GoalEntry) -> None:
        """What was told to be achieved is so; what was refused lies where it lay."""
        lies = self.parts.lying.get(part)
        wanted = entry.demand.end if entry.result is OrderResult.DONE else entry.demand.start
        if lies is None or hypot(lies.x_mm - wanted.x_mm, lies.y_mm - wanted.y_mm) > REACH_MM:
            where = f"at {tuple(lies)}" if lies is not None else "in a gripper"
            told = entry.result.name if entry.result is not None else "nothing"
            self.note(f"order {entry.number} was told {told}, and its part is {where}")


def _inside_of(here: tuple[float, float], there: tuple[float, float], obstacle: Area) -> bool:
    """Whether a line goes through the inside of a rectangle, a little less on each side (Liang, Barsky 1984)."""
    first, last = 0.0, 1.0
    low = (obstacle.x0_mm + SLACK_MM, obstacle.y0_mm + SLACK_MM)
    high = (obstacle.x1_mm - SLACK_MM, obstacle.y1_mm - SLACK_MM)
    for axis in (0, 1):
        step = there[axis] - here[axis]
        if step == 0:
            if not low[axis] < here[axis] < high[axis]:
                return False
            continue
        ends = sorted(((low[axis] - here[axis]) / step, (high[axis] - here[axis]) / step))
        first, last = max(first, ends[0]), min(last, ends[1])
    return first < last


def make_plant(site: Cell, timers: Timers, links: dict[int, BusDeviceLink], seed: int) -> CellPlant:
    """The plant of a cell; nothing in it is drawn by chance."""
    return CellPlant(site, timers, links)
