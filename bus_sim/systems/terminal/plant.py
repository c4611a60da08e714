"""The plant of a terminal: drives and handlers of vehicles, the desks' keyboards and cameras, on their device buses."""

import random
from collections.abc import Callable, Iterable
from functools import partial

from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import Timers
from bus_sim.devices.watched import WatchedWork
from bus_sim.systems.terminal.deliveries import deliveries, ordered
from bus_sim.systems.terminal.world import TerminalWorld, VehicleBody
from onboard.contract.codes import KindCode, ManualMode
from onboard.contract.messages import Message
from onboard.contract.terminal import Action, HandlerMode, MoveMode, Verb
from onboard.contract.terminal_device import (
    HandlerOrder,
    HandlerState,
    LaneSensor,
    ManualKey,
    MissionAnswer,
    MissionKey,
    MoveOrder,
    MoveState,
)
from onboard.systems.terminal.missions import types_of
from onboard.systems.terminal.site import Blockage, EntityKind, Mission, Press, Terminal

#: What a person presses, by the words of a site file.
PRESSES = {"hold": ManualMode.HELD, "step": ManualMode.STEP, "release": ManualMode.AUTOMATIC}
#: A body passes from one slot into the next in so long, us: a walking pace over a slot of the shipped site.
HOP_US = 300_000
#: A drive that crosses a slot and hears no order for so long stands there, us (dbc/terminal.dbc).
TIME_OUT_US = 2_500_000
#: Devices and cameras say again how things stand, us (dbc/terminal.dbc).
SLOW_US = 10_000_000
#: An operator types a mission again after this while the desk has not answered, us (dbc/terminal.dbc).
KEY_US = 1_000_000
#: Real durations are up to so much longer than planned: the paper's robots' speed is of course not constant.
NOISE = 0.1


class VehicleDevices:
    """Drive and handler of one vehicle."""

    def __init__(self, plant: "TerminalPlant", body: VehicleBody, link: BusDeviceLink, seed: int) -> None:
        self.plant, self.body, self.link = plant, body, link
        self.chance = random.Random(f"{seed}:{body.node_id}")
        self.sequence = self.handler_sequence = 0
        self.mode = MoveMode.STANDING
        self.at_end = True
        self.handler_mode = HandlerMode.FREE
        self._pending: MoveOrder | None = None
        self._crossing = WatchedWork(plant.timers, TIME_OUT_US, self._stand)
        link.subscribe(self._on_message)
        link.answer(self._tell)

    def start(self) -> None:
        """Say how things stand, now and slowly ever after."""
        self._tell()
        self.plant.after(SLOW_US, self.start)

    def _tell(self) -> None:
        self._tell_move()
        self._tell_handler()

    def _on_message(self, message: Message, _: int) -> None:
        match message:
            case MoveOrder():
                self._ordered(message)
            case HandlerOrder():
                self._handle(message)

    # --- drive -------------------------------------------------------------------------------------------------

    def _ordered(self, order: MoveOrder) -> None:
        if order.sequence == self.sequence:
            self._again()
            return
        if self._pending is not None or self.body.target is not None:
            return
        if (order.entity, order.slot) == (self.body.entity, self.body.slot):
            self.sequence = order.sequence
            self._cross(order.towards)
            return
        if not self.at_end or self.body.docked or not self.plant.world.leads(self.body, order.entity, order.slot):
            return
        self._pending = order
        self._hop()

    def _hop(self) -> None:
        """Begin to move, unless an obstacle lies before the lane's end."""
        order = self._pending
        if order is None:
            return
        if order.entity != self.body.entity and self.body.entity in self.plant.world.blocked:
            if self.mode is not MoveMode.BLOCKED:
                self.mode = MoveMode.BLOCKED
                self._tell_move()
            return
        self.mode, self.at_end = MoveMode.MOVING, False
        self.plant.world.enter(self.body, order.entity, order.slot, self.plant.now_us())
        self._tell_move()
        self.plant.after(HOP_US, self._arrived)

    def obstacle_gone(self) -> None:
        """The lane's end is free again."""
        if self.mode is MoveMode.BLOCKED:
            self._hop()

    def _arrived(self) -> None:
        order = self._pending
        assert order is not None
        self.plant.world.arrive(self.body, self.plant.now_us())
        self._pending = None
        self.sequence = order.sequence
        self._cross(order.towards)

    def _cross(self, towards: int) -> None:
        """Through the slot in hand: a lane's share of its length, a crossing or an area whole; a station at once."""
        entity = self.plant.site.entities[self.body.entity]
        self._crossing.end()
        if entity.kind is EntityKind.STATION or (entity.kind is EntityKind.AREA and not towards):
            duration_us = 0
        else:
            slots = entity.capacity if entity.kind is EntityKind.LANE else 1
            duration_us = entity.crossing_us(self.body.came_from, towards) // slots - HOP_US
        if duration_us <= 0:
            self._crossed()
            return
        self.mode, self.at_end = MoveMode.MOVING, False
        self._tell_move()
        self._crossing.begin(self._really(duration_us), self._crossed)

    def _crossed(self) -> None:
        self.mode, self.at_end = MoveMode.STANDING, True
        self._tell_move()

    def _stand(self) -> None:
        """In the middle of a slot."""
        self.mode = MoveMode.STANDING
        self._tell_move()

    def _again(self) -> None:
        """The order in hand, said again: a drive that moves goes on, and any other says how it stands."""
        if self._crossing.hear():
            self.mode = MoveMode.MOVING
        elif self._crossing.is_in_hand:
            return
        self._tell_move()

    def _tell_move(self) -> None:
        body = self.body
        self.link.send(MoveState(body.node_id, self.sequence, body.entity, body.slot, self.mode, self.at_end))

    # --- handler -----------------------------------------------------------------------------------------------

    def _handle(self, order: HandlerOrder) -> None:
        if order.sequence == self.handler_sequence or self.handler_mode is HandlerMode.WORKING:
            self._tell_handler()
            return
        self.handler_sequence = order.sequence
        self.handler_mode = HandlerMode.WORKING
        self._tell_handler()
        site = self.plant.site
        durations = {Action.DOCK: site.dock_us, Action.UNDOCK: site.undock_us - HOP_US}
        duration_us = self._really(max(1, durations.get(order.action, site.handle_us)))
        self.plant.after(duration_us, lambda: self._handled(order))

    def _handled(self, order: HandlerOrder) -> None:
        body, world, now_us = self.body, self.plant.world, self.plant.now_us()
        good = self.plant.site.entities[body.entity].kind is EntityKind.STATION
        if order.action is Action.DOCK and good:
            body.docked = True
        elif order.action is Action.UNDOCK:
            body.docked = False
        elif order.action is Action.PICK_UP:
            good = body.docked and world.pick_up(body, order.box, now_us)
        elif order.action is Action.PUT_DOWN:
            good = body.docked and world.put_down(body, now_us)
        world.count_boxes(now_us)
        rest = HandlerMode.DOCKED if body.docked else HandlerMode.FREE
        self.handler_mode = rest if good or order.action is Action.UNDOCK else HandlerMode.FAILED
        self._tell_handler()

    def _tell_handler(self) -> None:
        self.link.send(HandlerState(self.body.node_id, self.handler_sequence, self.handler_mode, self.body.box))

    def _really(self, duration_us: int) -> int:
        return round(duration_us * (1 + self.chance.uniform(0, self.plant.noise)))


class TerminalPlant:
    """Everything that is not a controller. ``links`` is the end of each machine's device bus, by node-ID."""

    def __init__(
        self,
        site: Terminal,
        timers: Timers,
        links: dict[int, BusDeviceLink],
        seed: int,
        *,
        noise: float = NOISE,
    ) -> None:
        self.site, self.noise = site, noise
        self.timers = timers
        self.world = TerminalWorld(site)
        self.violations = self.world.violations
        self.links = links
        #: Missions that were taken, and those that a desk said it cannot carry out, by number.
        self.taken: set[int] = set()
        self.refused: set[int] = set()
        for node, machine in site.machines.items():
            if machine.kind is KindCode.DESK:
                links[node].subscribe(self._answered)
                links[node].answer(partial(self._look_for, node))
        self.vehicles = {
            node: VehicleDevices(self, body, links[node], seed) for node, body in self.world.bodies.items()
        }

    def start(self) -> None:
        """Power on, and the operator's day begins."""
        for devices in self.vehicles.values():
            devices.start()
        for number, mission in enumerate(self.site.missions, start=1):
            self.timers.call_at(mission.at_us, _call(self._type, number, mission))
        for blockage in self.site.blockages:
            self.timers.call_at(blockage.at_us, _call(self.block, blockage))
            self.timers.call_at(blockage.until_us, _call(self.free, blockage.lane))
        for number, press in enumerate(self.site.presses, start=1):
            self.timers.call_at(press.at_us, _call(self._press, number, press))
        self._look()

    @property
    def is_over(self) -> bool:
        """Whether every box that was ordered was put down where it was wanted, or refused."""
        return len(deliveries(self.site, self.world.handled)) >= ordered(self.site, self.refused)

    def now_us(self) -> int:
        """Virtual time in us, as of the plant's timers."""
        return self.timers.now_us()

    def after(self, duration_us: int, callback: Callable[[], None]) -> None:
        """Call once ``duration_us`` of virtual time have passed."""
        self.timers.call_at(self.now_us() + duration_us, callback)

    def block(self, blockage: Blockage) -> None:
        """An obstacle falls before the end of a lane."""
        self.world.blocked.add(blockage.lane)
        self._camera(blockage.lane)

    def free(self, lane: int) -> None:
        """Take away what blocks a lane: cameras see it, and vehicles that stand before it go on."""
        self.world.blocked.discard(lane)
        self._camera(lane)
        for devices in self.vehicles.values():
            if devices.body.entity == lane:
                devices.obstacle_gone()

    def _look(self) -> None:
        """Cameras say again what they see."""
        self._say_lanes(self.site.blockages)
        self.after(SLOW_US, self._look)

    def _look_for(self, desk: int) -> None:
        """A desk asks what its own cameras see."""
        self._say_lanes(one for one in self.site.blockages if self.site.stewards[one.lane] == desk)

    def _say_lanes(self, blockages: Iterable[Blockage]) -> None:
        for blockage in blockages:
            if blockage.at_us <= self.now_us():
                self._camera(blockage.lane)

    def _camera(self, lane: int) -> None:
        desk = self.site.stewards[lane]
        self.links[desk].send(LaneSensor(desk, lane, lane in self.world.blocked))

    def _press(self, number: int, press: Press) -> None:
        """A person at the first desk has a hand in a vehicle."""
        desk = self.site.desk
        self.links[desk].send(ManualKey(desk, number, press.vehicle, PRESSES[press.what]))

    def _type(self, number: int, mission: Mission) -> None:
        """The operator types a mission at its desk, and again until the desk has it."""
        if number in self.taken | self.refused:
            return
        self.after(KEY_US, _call(self._type, number, mission))
        before_s = -(-mission.before_us // 1_000_000)
        desk, link = mission.desk, self.links[mission.desk]

        def key(verb: Verb, what: int, count: int, source: int) -> MissionKey:
            return MissionKey(desk, number, verb, what, count, source, mission.target, before_s, mission.urgent)

        for box in mission.boxes:
            link.send(key(Verb.TRANSHIP, box, 0, 0))
        if mission.boxes:
            link.send(key(Verb.END, 0, len(mission.boxes), 0))
        else:
            link.send(key(Verb.LOAD, types_of(self.site).index(mission.type), mission.count, mission.source))

    def _answered(self, message: Message, _: int) -> None:
        if isinstance(message, MissionAnswer):
            (self.taken if message.is_taken else self.refused).add(message.mission)


def make_plant(
    site: Terminal, timers: Timers, links: dict[int, BusDeviceLink], seed: int, noise: float = NOISE
) -> TerminalPlant:
    """The plant of a terminal; the seed draws how much slower than planned everything really is."""
    return TerminalPlant(site, timers, links, seed, noise=noise)


def _call(function: Callable[..., None], *arguments: object) -> Callable[[], None]:
    return lambda: function(*arguments)
