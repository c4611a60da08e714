"""What the operator is told of orders that wait for a person: nobody clears a stack, or a lane, by itself."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard.core.effects import Effect
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.missions import MissionBook
from onboard.work.order_life import OrderState
from onboard.work.told_once import ToldOnce

#: A person is told of what a vehicle that does not go on has, or one behind it, so long after the others have begun to
#: look for another way, us: by then what is not begun has been given back (``manual.GIVE_BACK_US``).
TOLD_AFTER_US = 75_000_000


@dataclass
class WaitingOrders:
    """One desk's orders that wait.

    Who is held, stopped or silent keeps what it has begun, which may be aboard, until a person comes.
    """

    orders: MissionBook
    mirror: TerminalMirror
    #: Missions by number for which nobody bid when they were last called for.
    refused: set[int] = field(default_factory=set)
    _told: ToldOnce = field(default_factory=ToldOnce)

    def news(self, now_us: int) -> list[Effect]:
        """What waits and was not told of; bus time, us."""
        waiting = [*self._buried()]
        if self.mirror.traffic.out:
            waiting += [*self._with_who_is_out(now_us), *self._not_called(now_us)]
        return self._told.news(waiting)

    def _buried(self) -> Iterator[tuple[str, str]]:
        """Under a box that nobody ordered away (row M08)."""
        names = self.orders.site.boxes
        for box, upper in self.orders.buried(self.mirror):
            above = names[upper - 1].name
            yield f"box {names[box - 1].name}", f"{above} is above it, and nobody ordered that away"

    def _with_who_is_out(self, now_us: int) -> Iterator[tuple[str, str]]:
        traffic, site = self.mirror.traffic, self.orders.site
        stuck = traffic.stuck(now_us) if traffic.is_waited_for(now_us - TOLD_AFTER_US) else frozenset()
        for task, winner in self.orders.won.items():
            box, vehicle = site.boxes[self.orders.open[task].box - 1].name, site.machines[winner].name
            if winner not in stuck:
                continue
            if winner in traffic.out:
                yield f"box {box}", f"{vehicle}, which is to bring it, does not go on"
            else:
                yield f"box {box}", f"{vehicle}, which is to bring it, cannot pass {self._who_is_out(' or ')}"

    def _not_called(self, now_us: int) -> Iterator[tuple[str, str]]:
        """Missions that nobody can do as it is, or for which nobody is left."""
        traffic = self.mirror.traffic
        if not traffic.is_waited_for(now_us - TOLD_AFTER_US):
            return
        if traffic.is_nobody_left(now_us):
            for number in self.orders.missions:
                yield _name(number), f"no vehicle goes on ({self._who_is_out()})"
        elif traffic.stuck(now_us):
            called = {one.mission for one in self.orders.open.values() if one.state is OrderState.CALLED}
            for number in self.refused & (called | self.orders.missions.keys()):
                yield _name(number), f"nobody can do it before {self._who_is_out(' or ')} goes on"

    def _who_is_out(self, between: str = ", ") -> str:
        return between.join(self.orders.site.machines[node].name for node in self.mirror.traffic.out)


def _name(mission: int) -> str:
    """A mission as its operator knows it: by its number at the keyboard, or by the task of whoever ordered a box."""
    origin, number = mission >> 16, mission & 0xFFFF
    return f"task {number} of node {origin}" if origin else f"mission {number}"
