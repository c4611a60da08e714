"""Two robots face to face, each in the slot that the other wants next: one of them has to go where it did not mean to.

No plan leads there; but plans that were made while clocks were wrong, or mirrors differed, are followed in an order
that leads nowhere. Both know it by rights alone: I wait for a slot whose token the other holds, and it asks for the one
that I am in. The time that this may last decides nothing but how soon somebody turns.
"""

from dataclasses import dataclass

from onboard.contract.codes import KindCode
from onboard.contract.constants import NOBODY
from onboard.core.authority import segment_token
from onboard.systems.car_park.travel import Carriage
from onboard.ways.mirror import WayFleet

#: Whoever ranks behind looks for another way after so long, and again after twice that; who ranks before, after twice
#: that, us: longer than tokens take on a bus in trouble, and than a mirror takes to catch up.
PATIENCE_US = 8_000_000


@dataclass
class Standoff:
    """One robot's look at who stands in its way because it stands in theirs."""

    fleet: WayFleet
    carriage: Carriage
    due_us: int | None = None
    _with: int = NOBODY
    _turned: tuple[int, int] = NOBODY, 0

    def turned(self, other: int, now_us: int) -> None:
        """I have found another way, away from ``other``: it comes behind me on that."""
        self._turned = other, now_us + 2 * PATIENCE_US

    def goes_first(self, other: int, now_us: int) -> int:
        """Who of me and ``other`` goes first wherever we meet, because of who turned; NOBODY where nobody had to.

        One decision for all slots: if each turned for the slots that the other has a right to, both would answer each
        other's plans for ever.
        """
        node, until_us = self._turned
        if node == other and now_us < until_us:
            return self.fleet.node_id
        order = self.fleet.mirror.order
        if self._with != other or not order.ranks_before(self.fleet.node_id, other):
            return NOBODY
        here = order.place(self.fleet.node_id)
        return NOBODY if here is not None and order.comes_next(other, here) else other

    def look(self, now_us: int) -> int:
        """The robot to turn away from, once that is due; NOBODY else."""
        other = self._facing()
        if other != self._with:
            self._with = other
            waits = 2 if self.fleet.mirror.order.ranks_before(self.fleet.node_id, other) else 1
            self.due_us = None if other == NOBODY else now_us + waits * PATIENCE_US
        if self.due_us is None or now_us < self.due_us:
            return NOBODY
        self.due_us = now_us + 2 * PATIENCE_US
        return other

    def _facing(self) -> int:
        slot, tokens = self.carriage.blocked, self.fleet.tokens
        if slot is None:
            return NOBODY
        other = tokens.holder_of(segment_token(slot))
        machine = self.fleet.site.machines.get(other)
        if machine is None or machine.kind is not KindCode.ROBOT or other == self.fleet.node_id:
            return NOBODY
        petitions = self.fleet.petitions
        wants = any(petitions.claim(segment_token(here), other) is not None for here in self.carriage.occupied())
        return other if wants else NOBODY
