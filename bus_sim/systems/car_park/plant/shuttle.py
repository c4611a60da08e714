"""The telescopic shuttle: goes under a car, grips it by its wheels, takes it aboard or leaves it (rows P32, P33)."""

from bus_sim.devices.link import DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from bus_sim.systems.car_park.plant.motion import driving
from bus_sim.systems.car_park.plant.world import CarParkWorld, RobotBody
from onboard.contract.codes import ShuttleAction, ShuttleMode, Side
from onboard.contract.messages import Message, ShuttleOrder, ShuttleState
from onboard.core.site import Station
from onboard.systems.car_park.site import car_park
from onboard.ways.site import WaySite

#: The grippers hold a car whose wheelbase differs from the shuttle's by at most this, mm: the grippers' play.
WHEELBASE_TOLERANCE_MM = 50
#: ShuttleState is repeated at least this often (dbc/device.dbc).
REPEAT_US = 10_000_000

#: In which modes each action is carried out; in MOVING, GRIPPING and RELEASING it is the present action that may not be
#: cut short, and the order is passed over, otherwise the refusal is a fault. RETRACT always brings the shuttle home.
ACCEPTED: dict[ShuttleAction, frozenset[ShuttleMode]] = {
    ShuttleAction.REACH: frozenset({ShuttleMode.HOME, ShuttleMode.REACHED}),
    ShuttleAction.GRIP: frozenset({ShuttleMode.REACHED}),
    ShuttleAction.RELEASE: frozenset({ShuttleMode.REACHED}),
    ShuttleAction.RETRACT: frozenset(
        {ShuttleMode.HOME, ShuttleMode.REACHED, ShuttleMode.MOVING, ShuttleMode.FAULT},
    ),
}
BUSY = frozenset({ShuttleMode.MOVING, ShuttleMode.GRIPPING, ShuttleMode.RELEASING})


class Shuttle:
    """Drive, grippers, load cells and home switch of one robot's shuttle.

    An order whose content and sequence are the last one's is only answered. GRIP sets the length to the order's
    wheelbase; outside the site's limits it is refused, off the car's by more than the tolerance it fails. A fault stays
    until RETRACT; ``fault`` says why in words. ``busy_refusals`` counts orders that came during an action.
    """

    def __init__(self, node_id: int, site: WaySite, world: CarParkWorld, timers: Timers, link: DeviceBusLink) -> None:
        self.node_id = node_id
        self.mode = ShuttleMode.HOME
        self.fault = ""
        self.busy_refusals = 0
        self._site = car_park(site)
        self._world = world
        self._timers = timers
        self._link = link
        self._order: ShuttleOrder | None = None
        self._sequence = 0
        self._wheelbase_mm = self._site.cars.min_wheelbase_mm
        self._station: Station | None = None
        self._action_timer: Timer | None = None
        self._repeat_timer: Timer | None = None
        link.subscribe(self._on_message)
        link.answer(self._say)

    def start(self) -> None:
        """Power on: say how the shuttle stands, then again slowly."""
        self._say()

    def is_home(self) -> bool:
        """The home switch, as wired to the carrier's drive."""
        return not self._body.is_out(self._timers.now_us())

    def state(self, now_us: int) -> ShuttleState:
        """What the sensors say now."""
        car = self._world.car_aboard(self.node_id)
        return ShuttleState(
            self.node_id,
            self._sequence,
            self.mode,
            round(self._body.extension.at(now_us)[0]),
            self._body.side,
            car.mass_kg if car is not None else 0,
            self._wheelbase_mm,
        )

    @property
    def _body(self) -> RobotBody:
        return self._world.robots[self.node_id]

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_message(self, message: Message, _: int) -> None:
        if not isinstance(message, ShuttleOrder):
            return
        if message == self._order:
            self._say()
        elif self.mode in BUSY and self.mode not in ACCEPTED[message.action]:
            self.busy_refusals += 1
            self._say()
        else:
            self._order = message
            self._sequence = message.sequence
            self._begin(message)

    def _begin(self, order: ShuttleOrder) -> None:
        refusal = self._refusal(order)
        if refusal:
            self._fail(refusal)
            return
        self.fault = ""
        if order.action is ShuttleAction.REACH:
            self._station = self._world.station_beside(self.node_id, order.side)
            self._extend(self._site.shuttle_reach_mm, order.side)
        elif order.action is ShuttleAction.RETRACT and self.is_home():
            # One that has refused, and has not begun.
            self._extended()
        elif order.action is ShuttleAction.RETRACT:
            self._extend(0, self._body.side)
        else:
            gripping = order.action is ShuttleAction.GRIP
            self._wheelbase_mm = order.wheelbase_mm if gripping else self._wheelbase_mm
            self._enter(ShuttleMode.GRIPPING if gripping else ShuttleMode.RELEASING)
            done_us = self._timers.now_us() + self._site.timing.grip_us
            self._action_timer = self._timers.call_at(done_us, self._gripped if gripping else self._released)

    def _refusal(self, order: ShuttleOrder) -> str:
        if self.mode not in ACCEPTED[order.action]:
            return f"{order.action.name} in mode {self.mode.name}"
        if order.action is ShuttleAction.REACH:
            return self._reach_refusal(order.side)
        if order.action is ShuttleAction.GRIP:
            limits = self._site.cars
            if not limits.min_wheelbase_mm <= order.wheelbase_mm <= limits.max_wheelbase_mm:
                return f"wheelbase {order.wheelbase_mm} mm is outside the telescope's range"
            if self._world.car_aboard(self.node_id) is not None:
                return "a car is aboard already"
        return ""

    def _reach_refusal(self, side: Side) -> str:
        if self.mode is ShuttleMode.REACHED and side is not self._body.side:
            return "the shuttle is out on the other side"
        if self._world.standing_segment(self.node_id) is None:
            return "the carrier does not stand at a mark"
        return ""

    # --- actions -----------------------------------------------------------------------------------------------

    def _extend(self, target_mm: int, side: Side) -> None:
        now_us = self._timers.now_us()
        position_mm, speed_mm_s = self._body.extension.at(now_us)
        axis = self._site.shuttle
        motion = driving(position_mm, speed_mm_s, target_mm, axis.speed_mm_s, axis.acceleration_mm_s2, now_us)
        if self._action_timer is not None:
            self._action_timer.cancel()
        self._action_timer = self._timers.call_at(motion.end_us, self._extended)
        self._world.move_shuttle(self.node_id, motion, side)
        self._enter(ShuttleMode.MOVING)

    def _extended(self) -> None:
        motion = self._body.extension
        is_home = motion.final_mm == 0
        self._world.move_shuttle(self.node_id, motion, self._body.side)
        if is_home:
            self._station = None
        self._enter(ShuttleMode.HOME if is_home else ShuttleMode.REACHED)

    def _gripped(self) -> None:
        cars = self._world.cars_at(self._station) if self._station is not None else []
        if not cars:
            self._fail("no car to grip")
        elif abs(cars[0].wheelbase_mm - self._wheelbase_mm) > WHEELBASE_TOLERANCE_MM:
            self._fail(f"the car's wheelbase is not {self._wheelbase_mm} mm")
        else:
            self._lift()

    def _lift(self) -> None:
        if self._station is not None:
            self._world.grip(self.node_id, self._station)
        self._enter(ShuttleMode.REACHED)

    def _released(self) -> None:
        if self._station is not None:
            self._world.put_down(self.node_id, self._station)
        self._enter(ShuttleMode.REACHED)

    def _fail(self, reason: str) -> None:
        self.fault = reason
        self._enter(ShuttleMode.FAULT)

    # --- what is said ------------------------------------------------------------------------------------------

    def _enter(self, mode: ShuttleMode) -> None:
        self.mode = mode
        self._say()

    def _say(self) -> None:
        now_us = self._timers.now_us()
        self._link.send(self.state(now_us))
        if self._repeat_timer is not None:
            self._repeat_timer.cancel()
        self._repeat_timer = self._timers.call_at(now_us + REPEAT_US, self._say)
