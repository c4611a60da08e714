"""What others ask of this node: requests that stay open until they are served, so that nobody need repeat them often.

The holder looks at open requests again by itself, at once when a token comes back to it; whoever was refused repeats
its request only to cover lost frames, and a request that is not repeated lapses. Oldest first (design, section 5).
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.messages import TokenRequest
from onboard.core.authority import TokenKey
from onboard.core.backoff import BackOff

#: Itinerary version of a request without an agreed order of passing (dbc/fleet.dbc).
UNORDERED = 0


class Petition(NamedTuple):
    """One open request: its claim, since when it stands, when it was last heard and when it is due again (bus us)."""

    itinerary_version: int
    predecessor: int
    since_us: int
    heard_us: int
    due_us: int


@dataclass
class Petitions:
    """Open requests by token and requester; ``repeat_us`` is the site's token repeat."""

    repeat_us: int
    open: dict[TokenKey, dict[int, Petition]] = field(default_factory=dict)
    _prune_at_us: int = 0

    def __post_init__(self) -> None:
        self._backoff = BackOff(self.repeat_us)

    def hear(self, key: TokenKey, request: TokenRequest, now_us: int) -> None:
        """Take up a request, whoever holds the token: it may come to me."""
        self._prune(now_us)
        known = self.open.setdefault(key, {}).get(request.sender)
        since_us = now_us
        if known is not None and not self._is_over(request.sender, known, now_us):
            # Whoever gives up an agreed order begins anew: its age must be the same for all holders.
            kept = (known.itinerary_version == UNORDERED) == (request.itinerary_version == UNORDERED)
            since_us = known.since_us if kept else now_us
        self.open[key][request.sender] = Petition(
            request.itinerary_version, request.predecessor, since_us, now_us, now_us + self.repeat_us
        )

    def claim(self, key: TokenKey, requester: int) -> Petition | None:
        """What ``requester`` claimed when it last asked, or None where it does not ask."""
        return self.open.get(key, {}).get(requester)

    def is_oldest_unordered(self, key: TokenKey, requester: int, now_us: int) -> bool:
        """Whether nobody has asked for longer without an agreed order, among those who want this token.

        A machine asks since its first request for any token of its set. All hear all requests, so all holders agree.
        """
        ages = []
        for node, petition in self.open.get(key, {}).items():
            if petition.itinerary_version == UNORDERED and not self._is_over(node, petition, now_us):
                ages.append((self._unordered_since_us(node), node))
        return bool(ages) and min(ages)[1] == requester

    def _unordered_since_us(self, node: int) -> int:
        asked = (waiting[node] for waiting in self.open.values() if node in waiting)
        return min(petition.since_us for petition in asked if petition.itinerary_version == UNORDERED)

    def close(self, key: TokenKey, requester: int) -> None:
        """Served, or said to be held by the requester."""
        waiting = self.open.get(key)
        if waiting is not None:
            waiting.pop(requester, None)
            if not waiting:
                del self.open[key]

    def returned(self, key: TokenKey, now_us: int) -> None:
        """The token has come to me: look at its requests at once."""
        for requester, petition in self.open.get(key, {}).items():
            self.open[key][requester] = petition._replace(due_us=now_us)

    def due(self, key: TokenKey, now_us: int) -> list[int]:
        """Requesters of a token whose requests are to be looked at now, oldest first; those that lapsed are closed."""
        waiting = self.open.get(key, {})
        for requester in [node for node, petition in waiting.items() if self._is_over(node, petition, now_us)]:
            self.close(key, requester)
        found = [(petition.since_us, node) for node, petition in waiting.items() if petition.due_us <= now_us]
        for _, node in found:
            waiting[node] = waiting[node]._replace(due_us=now_us + self.repeat_us)
        return [node for _, node in sorted(found)]

    def _prune(self, now_us: int) -> None:
        """Close what lapsed, also for tokens that never come here: memory stays bounded whatever is asked for."""
        if now_us < self._prune_at_us:
            return
        self._prune_at_us = now_us + self.repeat_us
        lapsed = [(key, one) for key, by in self.open.items() for one in by if self._is_over(one, by[one], now_us)]
        for key, requester in lapsed:
            self.close(key, requester)

    def _is_over(self, node: int, petition: Petition, now_us: int) -> bool:
        is_ordered = petition.itinerary_version != UNORDERED
        lapses_us = self._backoff.lapses_us(is_ordered=is_ordered)
        # Who asks for a whole set repeats one of it at a time.
        return petition.heard_us + lapses_us * (1 if is_ordered else self._set_of(node)) < now_us

    def _set_of(self, node: int) -> int:
        """For how many tokens a machine asks without an agreed order."""
        waiting = (by[node] for by in self.open.values() if node in by)
        return max(1, sum(petition.itinerary_version == UNORDERED for petition in waiting))
