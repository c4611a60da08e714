"""Machines that say that they go somewhere, and stand: obstacles until they move (design, section 5).

A machine that says what it waits for, or that its plan comes later, is given longer; but no word is a motion, and in
the end only its place counts.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from onboard.contract.codes import Grade, LegAction, ManualMode
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import (
    Heartbeat,
    Itinerary,
    Leg,
    ManualOrder,
    Message,
    Progress,
    TaskReport,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    Waiting,
)
from onboard.core.serial import from_bus_ms
from onboard.core.site import Segment
from onboard.ways.occupancy import final_position, turned_in
from onboard.ways.site import WaySite

#: A machine that says nothing stands for so long after it should have been elsewhere, us: a door or a drive's retries
#: take less.
STANDS_AFTER_US = 20_000_000
#: And for so long where it says that it is late or waits, us: it may wait for a customer who takes his time.
WAITS_AFTER_US = 600_000_000


#: Words about one's plan; who asks for a right waits for it.
_SPEAKS = (Waiting, TaskReport, TokenRequest)
#: Most of what is heard says nothing of anybody's plan.
_SAYS_NOTHING = (Heartbeat, TokenGrant, TokenHeld, TokenRefusal)


@dataclass
class _Seen:
    """One machine: where, since when there and late, and when it last said something of its plan."""

    place: tuple[int, int, int]
    moved_us: int
    spoke_us: int
    #: Since when its plan, whichever, has not left it where it is.
    late_us: int | None = None
    stands: bool = False
    #: The plan that was looked at last, and by when it has the machine leave this place, bus ms; None: never.
    plan: Itinerary | None = None
    leaves_ms: int | None = None


@dataclass
class Standing:
    """What one machine saw of the others' motions, and their plans. All times are bus time in us."""

    site: WaySite
    itineraries: Mapping[int, Itinerary]
    #: Whether a machine has something aboard that nobody can take from it.
    is_laden: Callable[[int], bool]
    _seen: dict[int, _Seen] = field(default_factory=dict)

    def hear(self, message: Message, now_us: int) -> None:
        """A machine moves, or speaks of its plan."""
        if type(message) in _SAYS_NOTHING:
            return
        if isinstance(message, Progress):
            place = message.track, message.index, message.offset_mm
            known = self._seen.get(message.sender)
            if known is None or known.place != place:
                self._seen[message.sender] = _Seen(place, now_us, now_us)
            return
        if isinstance(message, ManualOrder) and message.manual_mode is ManualMode.AUTOMATIC:
            # A person lets it go: whoever did has seen why it stood, and it has to ask for its way first.
            known = self._seen.get(message.machine)
            if known is not None:
                self._seen[message.machine] = _Seen(known.place, now_us, now_us)
            return
        speaks = isinstance(message, _SPEAKS)
        speaks = speaks or (isinstance(message, Itinerary) and message.grade is Grade.FIRM)
        if speaks and message.sender in self._seen:
            self._seen[message.sender].spoke_us = now_us

    def begin_anew(self, now_us: int) -> None:
        """What was seen was seen in another time, or nobody looked since: all that still may move has just moved."""
        for node, seen in self._seen.items():
            if not seen.stands:
                self._seen[node] = _Seen(seen.place, now_us, now_us)

    def forget(self, node: int) -> None:
        """A machine begins a new life: that it stood in the one before says nothing of this one."""
        self._seen.pop(node, None)

    def returned(self, node: int, since_us: int, now_us: int) -> None:
        """A machine may take part again: silent, or held, it could neither go nor say what it waits for."""
        seen = self._seen.get(node)
        if seen is not None and not seen.stands:
            seen.spoke_us = now_us
            seen.late_us = None if seen.late_us is None else min(now_us, seen.late_us + now_us - since_us)

    def stands(self, node: int, now_us: int) -> bool:
        """Whether a machine has stood for too long where its plan does not leave it.

        Motion ends that, or a person; or a plan by which it stays where it is, with nothing aboard.
        """
        seen = self._seen.get(node)
        machine = self.site.machines.get(node)
        if seen is None or machine is None or machine.kind not in MOBILE_KINDS:
            return False
        if seen.stands and self.is_laden(node):
            return True
        leaves_us = self._leaves_us(node, seen, now_us)
        if leaves_us is None:
            seen.late_us, seen.stands = None, False
        elif not seen.stands:
            seen.late_us = now_us if seen.late_us is None else seen.late_us
            quiet_us = now_us - max(seen.moved_us, seen.spoke_us, leaves_us)
            seen.stands = quiet_us >= STANDS_AFTER_US or now_us - seen.late_us >= WAITS_AFTER_US + STANDS_AFTER_US
        return seen.stands

    def _leaves_us(self, node: int, seen: _Seen, now_us: int) -> int | None:
        """When its plan has it leave where it stands, at the latest; None where it may stand there for ever."""
        itinerary = self.itineraries.get(node)
        if itinerary is not seen.plan:
            seen.plan = itinerary
            seen.leaves_ms = None if itinerary is None else self._leaves_ms(itinerary, Segment(*seen.place[:2]))
        return None if seen.leaves_ms is None else from_bus_ms(seen.leaves_ms, now_us)

    def _leaves_ms(self, itinerary: Itinerary, here: Segment) -> int | None:
        if self._is_at(here, final_position(self.site, itinerary)):
            return None
        legs = itinerary.legs
        # The last run away from here: before it the machine may work here, or come here again.
        away = [leg for before, leg in zip((None, *legs), legs, strict=False) if self._leads_away(before, leg, here)]
        away = away or [leg for leg in legs if _goes(leg)]
        return away[-1].end_ms if away else None

    def _leads_away(self, before: Leg | None, leg: Leg, here: Segment) -> bool:
        """Whether a run begins or passes here, or goes on from here on another track: its end may be the mouth."""
        if before is not None and leg.action is LegAction.TRAVEL and leg.track != before.track:
            return Segment(before.track, before.to_index) in (here, turned_in(self.site, here))
        return _goes(leg) and self._begins_or_passes(leg, here)

    def _begins_or_passes(self, leg: Leg, here: Segment) -> bool:
        places = {one for one in (here, turned_in(self.site, here)) if one is not None}
        ends = sorted((leg.from_index, leg.to_index))
        return any(
            leg.track == one.track and one.index != leg.to_index and ends[0] <= one.index <= ends[1] for one in places
        )

    def _is_at(self, here: Segment, end: Segment | None) -> bool:
        if end is None:
            return True
        return bool({here, turned_in(self.site, here)} & {end, turned_in(self.site, end)} - {None})


def _goes(leg: Leg) -> bool:
    return leg.action in (LegAction.TRAVEL, LegAction.RIDE) and leg.from_index != leg.to_index
