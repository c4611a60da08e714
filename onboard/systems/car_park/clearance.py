"""Whether the others can make room for a plan: who stands in its way, and whose way back it counts on to yield."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from onboard.contract.codes import Grade, KindCode
from onboard.contract.messages import Stamp
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment
from onboard.systems.car_park.program import CarStep, standing_itinerary, steps_of, to_itinerary
from onboard.systems.car_park.site import CarPark
from onboard.ways.effort import Effort
from onboard.ways.mirror import WayMirror
from onboard.ways.occupancy import final_position, itinerary_windows, lift_uses
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.reservations import Reservations
from onboard.ways.retreats import HeldBack, held_back
from onboard.ways.sipp import NoRoute, planning
from onboard.ways.told_way import TOLERANCE_US, BegunItinerary

#: Bound of one route search, in expansions (a wall-time bound would not replay).
MAX_EXPANSIONS = 4_000


#: Others' plans, and what all occupy, as they were when a search began.
Seen = tuple[Mapping[int, BegunItinerary], Reservations]


@dataclass(frozen=True)
class Clearance:
    """One robot's look at what its plan would ask of the others. All times are bus time in us."""

    site: CarPark
    mirror: WayMirror
    node: int
    effort: Effort = field(default_factory=Effort)

    def ends(self) -> tuple[frozenset[Segment], ...]:
        """Where a plan may end; and where that of who is left alone may to which no such way leads."""
        open_ones, all_ones = open_refuges(self.site, self.mirror.others_standing()), refuges(self.site)
        is_alone = self.mirror.obstacles.machines.keys() >= set(self.site.robots) - {self.node}
        return (open_ones, all_ones) if is_alone and open_ones != all_ones else (open_ones,)

    def held_back(self, stamp: Stamp, from_us: int, now_us: int) -> dict[int, HeldBack]:
        """Plans whose ways back would yield to work under ``stamp``, without what of them begins after ``from_us``."""
        found: dict[int, HeldBack] = {}
        for node, plan in sorted(self.mirror.plans.items()):
            if node == self.node or node in self.mirror.aside or self.site.machines[node].kind is not KindCode.ROBOT:
                continue
            if self.mirror.order.may_yield(node, stamp):
                seen = self.mirror.progress.get(node)
                is_current = seen is not None and seen.itinerary_version == plan.itinerary.version
                held = held_back(self.site, plan, seen.leg if seen and is_current else 0, from_us, now_us)
                if held is not None:
                    found[node] = held
        return found

    def without_retreats(self, held: Mapping[int, HeldBack], now_us: int) -> Reservations:
        """What all plans occupy, where those of ``held`` end in standing instead of their ways back."""
        found = self.mirror.reservations.apart(self.node, TOLERANCE_US).copy()
        for node, one in held.items():
            _replace(self.site, found, node, one.plan, now_us)
        return found

    def met(self, plan: BegunItinerary, held: Mapping[int, HeldBack], now_us: int) -> tuple[list[int], list[int]]:
        """Machines of ``held`` whose ways back ``plan`` meets: those that yield to it, and those that do not."""
        answers = {node: self.mirror.order.makes_way(plan, node, now_us) for node in held}
        return [n for n, yes in answers.items() if yes], [n for n, yes in answers.items() if yes is False]

    def still_free(self, plan: BegunItinerary, seen: Seen, now_us: int) -> Callable[[], bool]:
        """Tells, when it is asked, whether a plan ends in a refuge, and nobody is in its way but as was ``seen``."""
        windows = itinerary_windows(self.site, plan.itinerary, now_us, plan.first_begin_us)
        plans, before = seen
        met = set(before.conflicts(self.node, windows))
        end = final_position(self.site, plan.itinerary)

        def is_free() -> bool:
            if not any(end in ends for ends in self.ends()):
                return False
            meets = self.mirror.reservations.conflicts(self.node, windows)
            return met.issuperset(meets) and all(self.mirror.plans.get(one) is plans.get(one) for _, one in meets)

        return is_free

    def standing_in(self, plan: BegunItinerary, now_us: int) -> dict[int, tuple[Segment, int]] | None:
        """Machines that stand for ever in a plan's way, each with where and since when; None where one has no plan."""
        windows = itinerary_windows(self.site, plan.itinerary, now_us, plan.first_begin_us)
        found: dict[int, tuple[Segment, int]] = {}
        for node in self.mirror.reservations.standing_in(self.node, windows):
            itinerary = self.mirror.itineraries.get(node)
            place = None if itinerary is None else final_position(self.site, itinerary)
            if place is None:
                return None
            found[node] = place, self.mirror.reservations.standing_since(node) or now_us
        return found

    def give_way(self, steps: Sequence[CarStep], start_us: int, now_us: int) -> bool:
        """Whether each machine that only stands in the way finds another refuge in time, around these and all plans."""
        mine = to_itinerary(self.node, 1, Grade.FIRM, Stamp(to_bus_ms(now_us), 0, 0), list(steps))
        plan = BegunItinerary(mine, start_us)
        standing = self.standing_in(plan, now_us)
        taken = self.mirror.reservations.copy()
        return standing is not None and self.have_room(plan, standing, taken, now_us) is not None

    def have_room(
        self, plan: BegunItinerary, waiting: Mapping[int, tuple[Segment, int]], taken: Reservations, now_us: int
    ) -> int | None:
        """By how much later all who wait come to a refuge, in sum, us; None: one does not.

        ``waiting`` says from where and since when. They go around ``plan`` and what is ``taken``, one after the other;
        ``taken`` is used up.
        """
        later_us = 0
        _replace(self.site, taken, self.node, plan, now_us)
        ends = [*self.mirror.others_standing(), final_position(self.site, plan.itinerary)]
        for node, (place, since_us) in waiting.items():
            ends.remove(final_position(self.site, self.mirror.itineraries[node]))
            start_us = max(now_us, since_us)
            open_ones = open_refuges(self.site, [end for end in ends if end is not None])
            floors = self.mirror.lift_floors(now_us, start_us, taken)
            search = planning(self.site, taken, node, place, start_us, (), open_ones, MAX_EXPANSIONS, floors)
            route = self.effort.whole(search)
            if isinstance(route, NoRoute):
                return None
            stamp, steps = Stamp(to_bus_ms(now_us), 0, 0), list(steps_of(route, ()))
            way = to_itinerary(node, 1, Grade.FIRM, stamp, steps)
            if not steps:
                way = standing_itinerary(node, 1, stamp, place, start_us)
            _replace(self.site, taken, node, BegunItinerary(way, start_us), now_us)
            ends.append(final_position(self.site, way))
            planned_us = self.mirror.reservations.standing_since(node)
            later_us += 0 if planned_us is None else max(0, (steps[-1].end_us if steps else start_us) - planned_us)
        return later_us


def _replace(site: CarPark, taken: Reservations, node: int, plan: BegunItinerary, now_us: int) -> None:
    taken.release(node)
    taken.reserve(
        node,
        itinerary_windows(site, plan.itinerary, now_us, plan.first_begin_us),
        lift_uses(site, plan.itinerary, now_us, plan.first_begin_us),
    )
