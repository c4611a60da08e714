"""How a robot of the cell goes along a way, and where it may go at all."""

from dataclasses import dataclass, field

from onboard.contract.cell import ArmMode
from onboard.contract.cell_device import ArmOrder, ArmState
from onboard.contract.codes import Reason
from onboard.core.authority import TokenKey
from onboard.core.effects import Effect
from onboard.core.motion_authority import MotionAuthority, authorised
from onboard.systems.cell.contracts import Arm
from onboard.systems.cell.geometry import Area, Point, crosses, shortest_way
from onboard.work.device_link import DeviceLink

#: The position sensor tells whole millimetres: a robot on an obstacle's border may seem so far inside.
ROUNDING_MM = 1


def lacks(here: Point, there: Point, arm: Arm, obstacles: tuple[Area, ...]) -> Reason:
    """Why a straight line may not be driven: it leaves the own area, or crosses an obstacle. NONE where it may."""
    is_inside = arm.area.contains(there) and not any(crosses(here, there, obstacle) for obstacle in obstacles)
    return Reason.NONE if is_inside else Reason.NOT_AUTHORISED


def _shrunk(area: Area) -> Area:
    return Area(area.x0_mm + ROUNDING_MM, area.y0_mm + ROUNDING_MM, area.x1_mm - ROUNDING_MM, area.y1_mm - ROUNDING_MM)


@dataclass
class ArmDriver:
    """One robot's drive. ``state`` is what its sensor said last; None before it has said anything."""

    motion: MotionAuthority
    arm: Arm
    obstacles: tuple[Area, ...]
    refresh_us: int
    state: ArmState | None = None
    link: DeviceLink[Point] = field(init=False)

    def __post_init__(self) -> None:
        node = self.arm.node_id
        self.link = DeviceLink(lambda sequence, target: ArmOrder(node, sequence, *target), self.refresh_us)

    @property
    def position(self) -> Point | None:
        """Where the robot is by its sensor."""
        return Point(self.state.x_mm, self.state.y_mm) if self.state is not None else None

    def sense(self, state: ArmState) -> None:
        """Takes up where the drive is; the first time also which order it had last."""
        if self.state is None:
            self.link.go_on_from(state.sequence)
        self.state = state

    def stands_at(self, place: Point) -> bool:
        """Whether the robot has come to rest exactly there."""
        return self.state is not None and self.state.arm_mode is ArmMode.RESTING and self.position == place

    def go(self, end: Point, right: TokenKey, now_us: int) -> list[Effect]:
        """Order the next stretch of the shortest way to ``end`` and keep the order fresh; none where it is closed.

        ``right`` is what it goes there for: the custody of a part.
        """
        here = self.position
        if here is None or self.stands_at(end):
            return self.rest()
        target = self.link.wanted
        if target is None or self.stands_at(target):
            way = shortest_way(here, end, self.arm.area, self._obstacles_around(here))
            if way is None or len(way) < 2:
                return self.rest()
            target = way[1]
        permit = authorised(self.motion, [right], lacks(here, target, self.arm, self._obstacles_around(here)))
        if not permit:
            return self.rest()
        return self.link.order(target, permit, now_us)

    def _obstacles_around(self, here: Point) -> tuple[Area, ...]:
        """The obstacles; one on whose border the robot stopped and the sensor's millimetre says inside, a bit less."""
        return tuple(_shrunk(one) if one.hides(here) else one for one in self.obstacles)

    def rest(self) -> list[Effect]:
        """No more orders: a drive that hears none stops."""
        self.link.rest()
        return []
