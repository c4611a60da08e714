"""A robot's battery: what its drives draw, what flows in at a charger, and the gauge that tells it."""

from collections.abc import Callable
from typing import Protocol

from bus_sim.devices.link import DeviceBusLink, MessageFilter
from bus_sim.devices.timers import Timer, Timers
from bus_sim.systems.car_park.plant.world import CarParkWorld, WorldChange
from onboard.contract.messages import BatteryState, Message
from onboard.core.site import Segment
from onboard.systems.car_park.battery import Battery

#: BatteryState is repeated at least this often (dbc/device.dbc).
REPEAT_US = 30_000_000
#: Charges nearer than this are the same, Ws: what rounding to microseconds leaves.
ROUNDING_WS = 1e-3
_US_IN_S, _S_IN_H = 1_000_000, 3_600
#: What of the world changes what a robot draws.
_COUNTS = frozenset({WorldChange.CARRIER, WorldChange.SHUTTLE, WorldChange.CAR})


class PoweredLink(DeviceBusLink, Protocol):
    """A device bus whose actuators can be made deaf, as ``BusDeviceLink``."""

    incoming: list[MessageFilter]


class RobotBattery:
    """Battery, gauge and charging contact of one robot; full at first.

    Between two changes of the world power is constant, so that the charge is exact at each. The drives of a robot whose
    battery is empty hear no order: one that moves brakes by itself. Gauge and controller live on: their power is the
    least, and what is called empty is not quite. ``dead`` are chargers that give no power at present.
    """

    def __init__(
        self,
        node_id: int,
        battery: Battery,
        world: CarParkWorld,
        timers: Timers,
        link: PoweredLink,
        dead: Callable[[], frozenset[Segment]],
    ) -> None:
        self.node_id = node_id
        self.capacity_ws = float(battery.capacity_wh * _S_IN_H)
        self.charge_ws = self.capacity_ws
        #: So many times faster it drains than it should.
        self.ageing = 1.0
        #: For the summary: its lowest charge, what it has drawn, and for how long it has been charged.
        self.lowest_ws, self.drawn_ws, self.charged_us = self.capacity_ws, 0.0, 0
        self.on_empty: Callable[[], None] = lambda: None
        self._battery, self._world, self._timers, self._link, self._dead = battery, world, timers, link, dead
        self._since_us = timers.now_us()
        self._draw_w = float(battery.rest_w)
        self._is_charging = self._is_deaf = False
        self._timer: Timer | None = None
        self._repeat_at_us = 0
        link.answer(self._say)
        world.watch(self._on_change)

    def start(self) -> None:
        """Power on: say how full it is, then again slowly."""
        self._look()
        self._say()

    @property
    def is_empty(self) -> bool:
        """Whether no drive moves any more."""
        return self.charge_ws <= ROUNDING_WS

    @property
    def is_charging(self) -> bool:
        """Whether current flows in from a charger."""
        return self._is_charging

    def permille(self, charge_ws: float) -> int:
        """A charge as the gauge tells it: 0 for an empty battery only."""
        return 0 if charge_ws <= ROUNDING_WS else max(1, round(1000 * charge_ws / self.capacity_ws))

    def set_charge(self, part: float) -> None:
        """From now on it holds this part of its capacity: cells have failed, or a person has charged it."""
        self._settle()
        self.charge_ws = part * self.capacity_ws
        self._look()
        self._say()

    def look(self) -> None:
        """Something else than the world has changed: its ``ageing``, or which chargers are dead."""
        self._settle()
        self._look()

    # --- what it draws -----------------------------------------------------------------------------------------

    def _on_change(self, change: WorldChange, node_id: int, _: int) -> None:
        if node_id == self.node_id and change in _COUNTS:
            self.look()

    def _settle(self) -> None:
        """Reckon with what was drawn since the last change."""
        now_us = self._timers.now_us()
        passed_s = (now_us - self._since_us) / _US_IN_S
        self.drawn_ws += self._draw_w * passed_s
        self.charged_us += (now_us - self._since_us) if self._is_charging else 0
        self.charge_ws = min(self.capacity_ws, max(0.0, self.charge_ws + self._net_w * passed_s))
        self.lowest_ws = min(self.lowest_ws, self.charge_ws)
        self._since_us = now_us

    @property
    def _net_w(self) -> float:
        return (self._battery.charge_w if self._is_charging else 0) - self._draw_w

    def _look(self) -> None:
        """What is drawn from now on, and whether current flows in."""
        self._draw_w = self._power_w() * self.ageing
        was_charging, self._is_charging = self._is_charging, self._is_at_charger()
        self._drives_hear()
        if self._is_charging is not was_charging:
            self._say()
        else:
            self._schedule()

    def _power_w(self) -> float:
        world, battery = self._world, self._battery
        robot, now_us = world.robots[self.node_id], self._timers.now_us()
        power_w = battery.rest_w
        if now_us < robot.motion.end_us or robot.turning_to is not None:
            power_w += battery.drive_w if world.car_aboard(self.node_id) is None else battery.loaded_drive_w
        return power_w + (battery.shuttle_w if robot.is_out(now_us) else 0)

    def _is_at_charger(self) -> bool:
        here = self._world.standing_segment(self.node_id)
        return here is not None and here in self._battery.chargers and here not in self._dead()

    def _drives_hear(self) -> None:
        """Orders reach the drives while there is power for them."""
        if self.is_empty is self._is_deaf:
            return
        self._is_deaf = self.is_empty
        if self._is_deaf:
            self._link.incoming.append(_lost)
            self.on_empty()
        else:
            self._link.incoming.remove(_lost)

    # --- what is said ------------------------------------------------------------------------------------------

    def _on_timer(self) -> None:
        self._timer = None
        self._settle()
        self._drives_hear()
        self._say()

    def _say(self) -> None:
        self._settle()
        self._link.send(BatteryState(self.node_id, self.permille(self.charge_ws), self._is_charging))
        self._repeat_at_us = self._timers.now_us() + REPEAT_US
        self._schedule()

    def _schedule(self) -> None:
        """Set the timer for the next thing to be seen: empty, full, or the slow repeat."""
        if self._timer is not None:
            self._timer.cancel()
        when_us, net_w = self._repeat_at_us, self._net_w
        room_ws = self.capacity_ws - self.charge_ws if net_w > 0 else self.charge_ws
        if net_w and room_ws > ROUNDING_WS:
            # Rounded up: at that time it is empty, or full.
            when_us = min(when_us, self._timers.now_us() + int(room_ws / abs(net_w) * _US_IN_S) + 1)
        self._timer = self._timers.call_at(when_us, self._on_timer)


def _lost(_: Message) -> None:
    """What becomes of an order to drives without power."""
