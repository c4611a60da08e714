"""Shuttles, from the robots' device buses.

``TornCar`` carries the name of what a verified model of an automated garage once found possible: a shuttle pair tearing
a car in half.
"""

from collections.abc import Callable
from dataclasses import dataclass

from onboard.contract.codes import DriveMode, KindCode, ShuttleAction, ShuttleMode
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import CarAt, DriveOrder, DriveState, Reference, ShuttleOrder, ShuttleState
from onboard.core.site import Segment, Station
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.ways.site import way_site

#: Wheelbases are told in steps of 10 mm, rounded down, and gripped within a tolerance of the telescope, mm.
WHEELBASE_TOLERANCE_MM = 40
#: A drive sent no farther than this is not sent away, mm.
STAYS_MM = 5


@dataclass
class ShuttleSeen:
    """A robot's shuttle and drive as last sensed."""

    state: ShuttleState
    position_mm: int | None = None
    is_reported: bool = False

    @property
    def is_out(self) -> bool:
        """Whether it may be outside the carrier."""
        return self.state.mode is not ShuttleMode.HOME or self.state.extension_mm > 0


class TornCar(Rule):
    """A shuttle pair tearing a car in half: half of a car moves and the other half does not.

    So it would where a carrier moves while its shuttle is out, where a shuttle moves while it grips or lets go, where
    two shuttles are at one station, or where the axles are gripped at another distance than the car's.
    """

    name = "torn-car"
    title = "a shuttle pair tearing a car in half"
    source = "issue 4, point 1: found possible in a verified garage model; row P32"
    needs_site = True
    on_devices = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._shuttles: dict[int, ShuttleSeen] = {}
        self._positions_mm: dict[int, int] = {}
        self._cars: dict[Reference, CarAt] = {}

    def handlers(self) -> Handlers:
        """Shuttles and drives, and where cars are."""
        return {
            ShuttleState: self._on_shuttle,
            ShuttleOrder: self._on_shuttle_order,
            DriveState: self._on_drive,
            DriveOrder: self._on_drive_order,
            CarAt: self._on_car,
        }

    def _on_car(self, event: LogEvent[CarAt]) -> None:
        if event.message.station == OUTSIDE:
            self._cars.pop(event.message.car, None)
        else:
            self._cars[event.message.car] = event.message

    def _on_shuttle(self, event: LogEvent[ShuttleState]) -> None:
        state = event.message
        known = self._shuttles.get(state.sender)
        was_out = known is not None and known.is_out
        seen = self._shuttles.setdefault(state.sender, ShuttleSeen(state))
        seen.state = state
        station = self._station(state.sender, state) if seen.is_out else None
        if station is None or was_out:
            return
        for node, other in self._shuttles.items():
            if node != state.sender and other.is_out and self._station(node, other.state) == station:
                self.find(event, (state.sender, node), f"two shuttles at {station}")

    def _on_shuttle_order(self, event: LogEvent[ShuttleOrder]) -> None:
        order = event.message
        seen = self._shuttles.get(order.sender)
        if seen is None:
            return
        busy = seen.state.mode in (ShuttleMode.GRIPPING, ShuttleMode.RELEASING)
        if busy and order.action in (ShuttleAction.REACH, ShuttleAction.RETRACT):
            self.find(event, (order.sender,), f"{order.action.name} while {seen.state.mode.name}")
        if order.action is ShuttleAction.REACH and seen.is_out and order.side is not seen.state.side:
            self.find(event, (order.sender,), f"REACH to the other side while {seen.state.mode.name}")
        if order.action is ShuttleAction.GRIP:
            self._judge_grip(event, self._station(order.sender, seen.state))

    def _judge_grip(self, event: LogEvent[ShuttleOrder], station: Station | None) -> None:
        if station is None:
            self.picture.unjudged += 1
            return
        node, wheelbase_mm = event.message.sender, event.message.wheelbase_mm
        cars = [car for car in self._cars.values() if car.station == station.number]
        if not cars:
            if self.picture.tokens.from_start:
                self.find(event, (node,), f"grips at {station}, where no car is")
        elif all(abs(car.wheelbase_mm - wheelbase_mm) > WHEELBASE_TOLERANCE_MM for car in cars):
            what = f"grips a car of wheelbase {cars[0].wheelbase_mm} mm at {wheelbase_mm} mm"
            self.find(event, (node,), what)

    def _on_drive(self, event: LogEvent[DriveState]) -> None:
        state = event.message
        self._positions_mm[state.sender] = state.position_mm
        seen = self._shuttles.get(state.sender)
        if seen is None:
            return
        if not seen.is_out or state.mode is DriveMode.STANDING:
            seen.is_reported = False
        elif state.speed_mm_s and not seen.is_reported:
            seen.is_reported = True
            self.find(event, (state.sender,), f"the carrier moves while its shuttle is {seen.state.mode.name}")

    def _on_drive_order(self, event: LogEvent[DriveOrder]) -> None:
        order = event.message
        seen, position_mm = self._shuttles.get(order.sender), self._positions_mm.get(order.sender)
        if seen is None or position_mm is None or not seen.is_out or seen.is_reported:
            return
        if abs(order.target_mm - position_mm) > STAYS_MM:
            seen.is_reported = True
            self.find(event, (order.sender,), f"the carrier is sent away while its shuttle is {seen.state.mode.name}")

    def _station(self, node: int, state: ShuttleState) -> Station | None:
        """The station before which a robot's shuttle is."""
        body = self.picture.bodies.get(node)
        if body is None or self.picture.kind(node) is not KindCode.ROBOT:
            return None
        if Segment(body.track, body.index) in way_site(self.picture.site).platforms:
            return None
        return Station(body.track, body.index, state.side)
