"""A lift: the drive of its platform, which obeys orders as a carrier's does, and the platform's sensors."""

from bus_sim.plant.carrier import REPEAT_US, Carrier
from bus_sim.plant.link import DeviceLink
from bus_sim.plant.motion import Motion
from bus_sim.plant.timers import Timer, Timers
from bus_sim.plant.world import Change, PlatformBody, World
from onboard.core.messages import DriveOrder, PlatformState
from onboard.core.site import Axis, Site


class LiftDrive(Carrier):
    """Drive and sensors of one lift. It refuses to move, or brakes, while something is over its sill."""

    def __init__(self, node_id: int, site: Site, world: World, timers: Timers, link: DeviceLink) -> None:
        super().__init__(node_id, site, world, timers, link, lambda: True)
        self._told: PlatformState | None = None
        self._platform_timer: Timer | None = None

    def start(self) -> None:
        """Power on: say where the platform is and what it senses."""
        super().start()
        self._say_platform()

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

    def _move(self, motion: Motion) -> None:
        self._world.move_platform(self.node_id, motion)

    def _at_mark(self) -> bool:
        return self._world.platform_floor(self.node_id) is not None

    def _refusal(self, order: DriveOrder) -> str:
        if self._world.overhang(self.node_id) is not None:
            return "something is over the sill"
        track = self._site.tracks[self._body.track]
        if not 0 <= order.target_mm <= (track.length - 1) * track.pitch_mm:
            return f"target {order.target_mm} mm is beyond the shaft"
        return ""

    def _on_change(self, change: Change, node_id: int, now_us: int) -> None:
        if change in (Change.CARRIER, Change.CAR, Change.PLATFORM) and self.platform_state() != self._told:
            self._say_platform()

    def _say_platform(self) -> None:
        self._told = self.platform_state()
        self._link.send(self._told)
        if self._platform_timer is not None:
            self._platform_timer.cancel()
        self._platform_timer = self._timers.call_at(self._timers.now_us() + REPEAT_US, self._say_platform)
