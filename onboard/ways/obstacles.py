"""Machines and segments that nobody can pass: planned around until they are there again (design, section 5).

A machine that is silent, has stopped itself or waits to be admitted is an obstacle: where its body is by its last word,
and every slot whose token it holds, since nothing is taken back because of a time-out. A segment is blocked by a word
on the bus (``Blocked``) until another clears it. What is known here steers plans only; tokens alone permit motion.
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import Reason
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import Blocked, Clear, Progress
from onboard.core.mirror import Obstacle
from onboard.core.site import Machine, Segment
from onboard.ways.bodies import slots_of_body
from onboard.ways.lifts import PLATFORM_INDEX, lift_at, platform
from onboard.ways.occupancy import standing_segments
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow, Use
from onboard.ways.site import WaySite
from onboard.ways.tokens import site_slots

#: Owner of the windows of segments that are blocked by a word on the bus: no node carries it.
BLOCKED = 256


@dataclass
class Obstacles:
    """All obstacles known to one machine: ``machines`` is its mirror's table of who does not follow a plan.

    ``changes`` grows with every change, so that nobody need look twice.
    """

    site: WaySite
    reservations: Callable[[], Reservations]
    machines: dict[int, Obstacle] = field(default_factory=dict)
    #: Segments that somebody says nobody can pass, and those of which it was taken back, each with why.
    blocked: dict[Segment, Reason] = field(default_factory=dict)
    cleared: dict[Segment, Reason] = field(default_factory=dict)
    changes: int = 0
    _slots: tuple[Segment, ...] = ()

    def let_go(self, node: int) -> None:
        """A machine is an obstacle no more: it takes part again, or its plan is known."""
        self.reservations().release(node)
        self.changes += 1

    def is_at(self, slot: Segment) -> bool:
        """Whether a slot is blocked, or some machine that is an obstacle has it."""
        return slot in self.blocked or any(slot in obstacle.slots for obstacle in self.machines.values())

    def hear(self, word: Blocked | Clear, now_us: int) -> bool:
        """Take up what somebody says of a segment; True where it is news. Segments of no site are passed over."""
        segment = Segment(word.track, word.index)
        if segment not in self._all_slots() or (segment in self.blocked) is isinstance(word, Blocked):
            return False
        if isinstance(word, Blocked):
            self.blocked[segment] = word.reason
            self.cleared.pop(segment, None)
        else:
            del self.blocked[segment]
            self.cleared[segment] = word.reason
        self.put(BLOCKED, self.blocked, now_us)
        return True

    def words(self, node: int, tracks: Collection[int]) -> list[Blocked | Clear]:
        """What ``node``, steward of ``tracks``, says again of their segments to who asks: blocked ones, and cleared."""
        found: list[Blocked | Clear] = [Blocked(node, *one, why) for one, why in sorted(self.blocked.items())]
        found += [Clear(node, *one, why) for one, why in sorted(self.cleared.items())]
        return [word for word in found if word.track in tracks]

    def retime(self, now_us: int) -> None:
        """All that is in the way is so from now on: since when it was in a time of before is not known any more."""
        for node, obstacle in self.machines.items():
            self.machines[node] = obstacle._replace(since_us=now_us)
            self.put(node, obstacle.slots, now_us)
        if self.blocked:
            self.put(BLOCKED, self.blocked, now_us)

    def put(self, owner: int, slots: Iterable[Segment], now_us: int) -> None:
        """Slots that nobody can pass from ``now_us`` on, for a machine's sake or that of a word on the bus."""
        reservations = self.reservations()
        reservations.release(owner)
        lifts = [slot.track for slot in sorted(slots) if slot.index == PLATFORM_INDEX and slot.track in self.site.lifts]
        reservations.reserve(
            owner,
            [SlotWindow(slot, now_us, FOREVER) for slot in sorted(slots)],
            [Use(lift, 1, 1, now_us, FOREVER, owner) for lift in lifts],
        )
        reservations.fix(owner)
        self.changes += 1

    def slots_of(
        self, machine: Machine, seen: Progress | None, holder_of: Callable[[Segment], int]
    ) -> frozenset[Segment]:
        """Slots that a machine is in by its last word (its home, if it never spoke) and those whose tokens it holds."""
        found = {slot for slot in self._all_slots() if holder_of(slot) == machine.node_id}
        if machine.kind in MOBILE_KINDS:
            here = machine.home if seen is None else Segment(seen.track, seen.index)
            if here.track in self.site.tracks:
                aboard = lift_at(self.site, here)
                found.update([platform(aboard)] if aboard is not None else standing_segments(self.site, here))
            if seen is not None:
                found.update(slots_of_body(self.site, seen))
        return frozenset(found)

    def _all_slots(self) -> tuple[Segment, ...]:
        if not self._slots:
            self._slots = tuple(site_slots(self.site))
        return self._slots
