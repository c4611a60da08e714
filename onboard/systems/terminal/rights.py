"""Whether a desk gives a right away: slots in the order of the plans, boxes to whose plan has them (rows M17, M18)."""

from onboard.contract.codes import Reason, TokenKind
from onboard.core.authority import TokenKey
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.site import EntityKind


def verdict(mirror: TerminalMirror, key: TokenKey, requester: int) -> Reason:
    """NONE where the requester may have it now, else why not."""
    if key.kind is TokenKind.SEGMENT:
        return _may_enter(mirror, key.number >> 8, key.number & 0xFF, requester)
    if key.kind is TokenKind.CAR:
        box = key.number & 0xFFFF
        if mirror.in_plans(box) != requester:
            return Reason.MIRROR_BEHIND
        # Whoever had the right to a box under another could give it back to nobody while it waits.
        return Reason.TOKEN_NOT_GRANTABLE_YET if mirror.above(box) else Reason.NONE
    return Reason.TOKEN_NOT_GRANTABLE_YET


def _may_enter(mirror: TerminalMirror, entity: int, slot: int, requester: int) -> Reason:
    """The first in the entity's list that is not there yet, unless the slot is one further on along a lane."""
    site, traffic = mirror.site, mirror.traffic
    place = site.entities.get(entity)
    if place is None or requester not in site.vehicles:
        return Reason.NOT_AUTHORISED
    if place.kind is EntityKind.LANE and slot > 1:
        return Reason.NONE
    row = traffic.lists.get(entity, [])
    mine = next((n for n, one in enumerate(row) if one.owner == requester and not traffic.is_inside(one)), None)
    if mine is None:
        return Reason.MIRROR_BEHIND
    before = row[:mine]
    waiting = [one for one in before if not traffic.is_inside(one)]
    if place.kind is EntityKind.CROSSING and place.capacity > 1:
        same = [one for one in before if mirror.entry_slot(entity, one.owner) == slot]
        return Reason.TOKEN_NOT_GRANTABLE_YET if same or len(before) >= place.capacity else Reason.NONE
    return Reason.TOKEN_NOT_GRANTABLE_YET if waiting else Reason.NONE
