"""A lift: the drive of its platform, which obeys orders as a carrier's does, and the platform's sensors."""

from bus_sim.devices.link import DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from bus_sim.systems.car_park.plant.carrier import Carrier
from bus_sim.systems.car_park.plant.motion import Motion
from bus_sim.systems.car_park.plant.shaft import PlatformBody
from bus_sim.systems.car_park.plant.world import MARK_TOLERANCE_MM, CarParkWorld, WorldChange
from onboard.contract.messages import DriveOrder, PlatformState
from onboard.ways.lifts import nearest_stop, stop_mm
from onboard.ways.site import Axis, Offset, WaySite

#: PlatformState is repeated at least this often (dbc/device.dbc).
REPEAT_US = 10_000_000
#: Why a lift's drive refuses while its light curtain is broken.
OVER_THE_SILL = "something is over the sill"


class LiftDrive(Carrier):
    """Drive, position sensor and mark sensor of one lift, and its platform's curtain, load cells and mark.

    The light curtain at the sill is wired to the drive: while a body is over the sill the drive refuses to move, in
    mode FAULT until the sill is free. A PlatformState follows on every change of what the platform senses, and slowly
    otherwise.
    """

    def __init__(self, node_id: int, site: WaySite, world: CarParkWorld, timers: Timers, link: DeviceBusLink) -> None:
        super().__init__(node_id, site, world, timers, link, lambda: True)
        self._told: PlatformState | None = None
        self._platform_timer: Timer | None = None
        self._crossing_timer: Timer | None = None
        link.answer(self._say_platform)

    def start(self) -> None:
        """Power on: say where the platform is and what it senses."""
        super().start()
        self._say_platform()
        self._watch_sill()

    def platform_state(self) -> PlatformState:
        """What the platform's sensors see now."""
        robot = self._world.aboard(self.node_id)
        car = self._world.car_aboard(robot) if robot is not None else None
        crossing = self._world.overhang(self.node_id) is not None
        return PlatformState(self.node_id, robot is not None, crossing, car.mass_kg if car is not None else 0)

    @property
    def _body(self) -> PlatformBody:
        return self._world.platforms[self.node_id]

    @property
    def _axis(self) -> Axis:
        return self._site.lift

    @property
    def _pitch_mm(self) -> int:
        return self._site.tracks[self._body.track].pitch_mm

    @property
    def _origin_mm(self) -> int:
        return 0

    @property
    def _is_across(self) -> bool:
        return False

    def _aim(self, order: DriveOrder) -> Offset | None:
        return Offset(self._body.track, order.target_mm)

    def _go_by_door(self, track: int) -> None:
        """A platform has but one axis."""

    def _move(self, motion: Motion) -> None:
        self._world.move_platform(self.node_id, motion)

    def _at_mark(self) -> bool:
        height_mm, track = self._body.motion.at(self._timers.now_us())[0], self._body.track
        away_mm = height_mm - stop_mm(self._site, track, nearest_stop(self._site, track, height_mm))
        return abs(away_mm) <= MARK_TOLERANCE_MM

    def _refusal(self, order: DriveOrder) -> str:
        if self._world.overhang(self.node_id) is not None:
            return OVER_THE_SILL
        if order.across:
            return "a platform does not turn"
        if (
            not 0
            <= order.target_mm
            <= stop_mm(self._site, self._body.track, self._site.tracks[self._body.track].length)
        ):
            return f"target {order.target_mm} mm is beyond the end of the shaft"
        return ""

    def _on_change(self, change: WorldChange, node_id: int, now_us: int) -> None:
        if change in (WorldChange.CARRIER, WorldChange.CAR, WorldChange.PLATFORM):
            self._look()

    def _look(self) -> None:
        """Tell what the platform senses where that has changed; a sill that has become free ends its fault."""
        state = self.platform_state()
        if self._told is not None and state != self._told:
            self._say_platform()
        if self.fault == OVER_THE_SILL and not state.crossing:
            self.fault = ""
            self._say(self._timers.now_us())
        self._watch_sill()

    def _watch_sill(self) -> None:
        """Look again when a body that moves now reaches the sill, or has passed it."""
        if self._crossing_timer is not None:
            self._crossing_timer.cancel()
        when_us = self._world.next_crossing_us(self.node_id)
        self._crossing_timer = None if when_us is None else self._timers.call_at(when_us, self._look)

    def _say_platform(self) -> None:
        self._told = self.platform_state()
        self._link.send(self._told)
        if self._platform_timer is not None:
            self._platform_timer.cancel()
        self._platform_timer = self._timers.call_at(self._timers.now_us() + REPEAT_US, self._say_platform)
