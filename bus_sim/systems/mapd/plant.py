"""A pick-up and delivery site: robots' bodies, the goods, the desk's counter, and the oracle.

It knows nothing of paths, bids or tokens: it moves what it is ordered to move and notes what must never happen: two
bodies in one cell or zone, a move to where no way leads, two that change places, goods that are lost or doubled.
"""

from dataclasses import dataclass, field
from functools import partial

from bus_sim.devices.link import BusDeviceLink, DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from onboard.contract.codes import OrderResult
from onboard.contract.mapd import CartAction
from onboard.contract.mapd_device import CartOrder, CartState, TransportAnswer, TransportKey
from onboard.contract.messages import Message
from onboard.core.site import Machine
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.site import Mapd, TransportTask

#: Bodies tell where they are, and unanswered orders are said again, this often, us (dbc/mapd.dbc).
WORD_US, KEY_US = 2_000_000, 1_000_000
#: Loading and unloading take so long, us; in the model they take no time.
WORK_US = 1_000


class GridRobotBody:
    """One robot's body: in ``cell``, or on its way there."""

    def __init__(self, machine: Machine, cell: int, plant: "UnitPlant", link: DeviceBusLink) -> None:
        self.machine = machine
        self.cell = cell
        self.is_moving = False
        self.task = NO_TASK
        self._plant, self._link = plant, link
        self._sequence = 0
        self._word: Timer | None = None
        link.subscribe(self._on_message)
        link.answer(self.say)

    def say(self) -> None:
        """Tell where it is, now and slowly from now on."""
        self._link.send(CartState(self.machine.node_id, self._sequence, self.cell, self.is_moving, self.task))
        if self._word is not None:
            self._word.cancel()
        timers = self._plant.timers
        self._word = timers.call_at(timers.now_us() + WORD_US, self.say)

    def _on_message(self, message: Message, _: int) -> None:
        if not isinstance(message, CartOrder):
            return
        if message.sequence != self._sequence and not self.is_moving:
            self._sequence = message.sequence
            self._carry_out(message)
        self.say()

    def _carry_out(self, order: CartOrder) -> None:
        timers = self._plant.timers
        if order.cart_action is CartAction.MOVE:
            self._plant.check_move(self, order)
            self.cell, self.is_moving = order.cell, True
            timers.call_at(timers.now_us() + self._plant.site.travel_us, self._arrive)
        elif order.cart_action is CartAction.LOAD:
            self._plant.load(self, order)
        else:
            self._plant.unload(self, order)

    def _arrive(self) -> None:
        self.is_moving = False
        self.say()


@dataclass
class Goods:
    """What a task is about: when it was ordered and served, in bus time and in steps."""

    task: TransportTask
    ordered_us: int
    answer: OrderResult | None = None
    aboard: int = 0
    served_step: int | None = None
    served_us: int | None = None


@dataclass
class UnitPlant:
    """All bodies, goods and the counter; the oracle's notes are in ``violations``."""

    site: Mapd
    timers: Timers
    links: dict[int, BusDeviceLink]
    violations: list[str] = field(default_factory=list)
    goods: dict[int, Goods] = field(default_factory=dict)
    #: (step, robot, cell) of every move: in ``cell`` from ``step`` on.
    moves: list[tuple[int, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        machines = self.site.machines
        self.bodies = {
            node: GridRobotBody(machines[node], cell, self, self.links[node]) for node, cell in self.site.homes.items()
        }
        self._counter = self.links[self.site.desk]
        self._counter.subscribe(self._on_answer)

    def start(self) -> None:
        """Power on, and let the orders come: each in time for its step, which is never sooner than by the clock."""
        for body in self.bodies.values():
            body.say()
        for task in self.site.tasks:
            self.timers.call_at(task.release * self.site.step_us, partial(self._order, task))

    def _order(self, task: TransportTask) -> None:
        self.goods[task.number] = Goods(task, self.timers.now_us())
        self._say_key(task)

    def _say_key(self, task: TransportTask) -> None:
        if self.goods[task.number].answer is None:
            release = task.release & 0xFFFF
            self._counter.send(TransportKey(self.site.desk, task.number, task.pickup, task.delivery, release))
            self.timers.call_at(self.timers.now_us() + KEY_US, partial(self._say_key, task))

    def _on_answer(self, message: Message, _: int) -> None:
        if not isinstance(message, TransportAnswer) or message.task not in self.goods:
            return
        goods = self.goods[message.task]
        goods.answer = message.transport_result
        if message.transport_result is OrderResult.DONE and goods.served_step is None:
            self.note(f"task {message.task} was told done and is not")

    @property
    def is_over(self) -> bool:
        """Whether every task has come and was served."""
        return len(self.goods) == len(self.site.tasks) and all(
            one.served_step is not None or one.answer is OrderResult.REFUSED for one in self.goods.values()
        )

    # --- the oracle --------------------------------------------------------------------------------------------

    def note(self, violation: str) -> None:
        """Something that must never happen has happened."""
        self.violations.append(f"{self.timers.now_us() / 1e6:.3f} s: {violation}")

    def check_move(self, body: GridRobotBody, order: CartOrder) -> None:
        """Nobody is where it goes, not even on the way out of it unless it has begun to leave; and a way leads there.

        A swap would be two moves, the first of them into a cell that is not left.
        """
        name, floor = body.machine.name, self.site.floor
        if order.cell not in floor.ways[body.cell]:
            self.note(f"{name} goes from {floor.names[body.cell]} to cell {order.cell}, where no way leads")
            return
        there = floor.resources[order.cell]
        others = [
            one.machine.name for one in self.bodies.values() if one is not body and floor.resources[one.cell] == there
        ]
        if others:
            self.note(f"{name} meets {', '.join(others)} in {floor.names[order.cell]}")
        self.moves.append((order.step, body.machine.node_id, order.cell))

    def load(self, body: GridRobotBody, order: CartOrder) -> None:
        """The goods must be there, and the deck empty."""
        goods = self.goods.get(order.task)
        if goods is None or goods.aboard or goods.task.pickup != body.cell or body.task != NO_TASK:
            self.note(f"{body.machine.name} loads task {order.task}, which is not there")
            return
        goods.aboard, body.task = body.machine.node_id, order.task

    def unload(self, body: GridRobotBody, order: CartOrder) -> None:
        """What is aboard, where it is to go."""
        goods = self.goods.get(order.task)
        if goods is None or body.task != order.task or goods.task.delivery != body.cell:
            self.note(f"{body.machine.name} unloads task {order.task}, which is not aboard or not for this cell")
            return
        body.task = NO_TASK
        goods.served_step, goods.served_us = order.step, self.timers.now_us()

    def check_steps(self) -> None:
        """The whole run once more, step by step: one robot a cell or zone, and none that changed places."""
        floor = self.site.floor
        at = dict(self.site.homes)
        by_step: dict[int, list[tuple[int, int]]] = {}
        for step, robot, cell in self.moves:
            by_step.setdefault(step, []).append((robot, cell))
        for step, moves in sorted(by_step.items()):
            before = dict(at)
            at.update(moves)
            if len({floor.resources[cell] for cell in at.values()}) < len(at):
                self.note(f"two robots in one place at step {step}")
            gone = {(before[robot], at[robot]) for robot, _ in moves}
            if any((to, cell) in gone for cell, to in gone):
                self.note(f"two robots change places at step {step}")
            if len({robot for robot, _ in moves}) < len(moves):
                self.note(f"a robot moves twice in step {step}")

    # --- figures -----------------------------------------------------------------------------------------------

    @property
    def served(self) -> dict[int, int]:
        """Step at which each task was delivered, by number."""
        return {number: one.served_step for number, one in self.goods.items() if one.served_step is not None}

    @property
    def history(self) -> list[tuple[int, ...]]:
        """Where each robot was, step by step, in the order of ``site.homes``."""
        rows = [dict(self.site.homes)]
        for step, robot, cell in sorted(self.moves):
            while len(rows) <= step:
                rows.append(dict(rows[-1]))
            rows[step][robot] = cell
        return [tuple(row.values()) for row in rows]


def make_plant(site: Mapd, timers: Timers, links: dict[int, BusDeviceLink], seed: int) -> UnitPlant:
    """The plant of a pick-up and delivery site; nothing in it is drawn by chance."""
    return UnitPlant(site, timers, links)
