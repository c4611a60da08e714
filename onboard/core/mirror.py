"""The mirror: what this machine believes of the others, built from bus traffic alone (row P35).

The core keeps versions: who lives, what each last planned, where it last was, who is in the way. What plans occupy a
system's own mirror adds (``onboard.ways``). A wrong mirror costs time, never safety: tokens guard what moves.
"""

from binascii import crc_hqx
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from struct import pack
from typing import Any, ClassVar, NamedTuple

from onboard.contract.codes import Grade, KindCode, MachineState, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Heartbeat, Itinerary, Message, Progress, TokenGrant, TokenHeld
from onboard.core.authority import TokenBook
from onboard.core.effects import Effect
from onboard.core.serial import is_newer
from onboard.core.site import Machine, Segment, Site
from onboard.core.token_keys import TokenKey

#: Heartbeats missed before a node counts as silent.
MISSED_HEARTBEATS = 3


@dataclass(slots=True)
class Peer:
    """Last word of one other machine; times in bus us."""

    kind: KindCode
    state: MachineState
    boot: int
    mirror_digest: int
    heard_at_us: int
    contract: int
    site_digest: int
    #: When the first heartbeat of its present life was heard.
    since_us: int = 0
    #: That heartbeat itself; the same again is no news.
    beat: Heartbeat | None = None


class Obstacle(NamedTuple):
    """One machine in the way: its slots, since when (bus us) and why."""

    slots: frozenset[Segment]
    since_us: int
    reason: Reason


def digest_words(values: Collection[int]) -> bytes:
    """Values as the digest takes them: words of 32 bits, the high byte first."""
    return pack(f">{len(values)}I", *values)


@dataclass
class Mirror:
    """Everybody's itineraries by version, who is alive, and who is in the way."""

    #: Messages that only who has its rights may say, beside those of the core.
    vouching: ClassVar[tuple[type[Message], ...]] = ()
    #: Messages that change the digest of all who hear them.
    digested: ClassVar[tuple[type[Message], ...]] = (Itinerary,)

    site: Site
    node_id: int
    peers: dict[int, Peer] = field(default_factory=dict)
    itineraries: dict[int, Itinerary] = field(default_factory=dict)
    progress: dict[int, Progress] = field(default_factory=dict)
    #: Machines that do not follow their plans.
    aside: dict[int, Obstacle] = field(default_factory=dict)
    #: Who was silent: its next plan counts whatever its version, as more may have been missed than that tells apart.
    was_silent: set[int] = field(default_factory=set)
    #: Boot counter of each node's life before the present one, 0 where I knew of none.
    boots_before: dict[int, int] = field(default_factory=dict)
    #: Whether all stand, as rights are made anew.
    is_frozen: Callable[[], bool] = bool
    _digest: int | None = None

    def on_heartbeat(self, beat: Heartbeat, now_us: int) -> bool:
        """Note a sign of life; True where the sender is new or was restarted, so that its statements are wanted."""
        known = self.peers.get(beat.sender)
        starts = beat.state is MachineState.STARTING and known is not None and known.state is not MachineState.STARTING
        is_soon = known is not None and now_us - known.since_us < self.site.timing.heartbeat_us // 2
        if starts and known is not None and known.boot == beat.boot and is_soon:
            # No board starts so soon again: its first word has come twice.
            return False
        fresh = known is None or known.boot != beat.boot or starts
        if fresh:
            if known is not None or beat.state is MachineState.STARTING:
                self._forget_plan(beat.sender)
            self.boots_before[beat.sender] = known.boot if known is not None else 0
        since_us = now_us if known is None or fresh else known.since_us
        word = (beat.kind, beat.state, beat.boot, beat.mirror_digest)
        self.peers[beat.sender] = Peer(*word, now_us, beat.contract, beat.site_digest, since_us, beat)
        return fresh

    def _forget_plan(self, node: int) -> None:
        if self.itineraries.pop(node, None) is not None:
            self._digest = None

    def on_itinerary(self, itinerary: Itinerary, now_us: int) -> bool:
        """Take up a firm itinerary by version; True where it was news. Tentative ones are hints and not kept here."""
        if itinerary.grade is Grade.TENTATIVE:
            return False
        told, known = itinerary.version, self.itineraries.get(itinerary.sender)
        is_another = known is not None and told != known.version and itinerary.sender in self.was_silent
        if not (known is None or is_another or is_newer(told, known.version, 8)):
            return False
        self.was_silent.discard(itinerary.sender)
        self.itineraries[itinerary.sender] = itinerary
        self._digest = None
        return True

    def on_progress(self, progress: Progress) -> None:
        """Last known position of a machine, my own included."""
        self.progress[progress.sender] = progress

    def set_aside(self, node: int, slots: frozenset[Segment], reason: Reason, now_us: int) -> bool:
        """A machine does not follow its plan: it is an obstacle at ``slots``; True where that was not known so."""
        known = self.aside.get(node)
        self.was_silent |= {node} if reason is Reason.NODE_SILENT else set()
        if known is not None and (known.slots, known.reason) == (slots, reason):
            return False
        self.aside[node] = Obstacle(slots, now_us if known is None else known.since_us, reason)
        return True

    def admit(self, node: int, now_us: int) -> bool:
        """A machine takes part: its plan counts, if it has told one; True where it was an obstacle."""
        return self.aside.pop(node, None) is not None

    def alive(self, now_us: int) -> set[int]:
        """Nodes heard within ``MISSED_HEARTBEATS`` heartbeat periods."""
        limit_us = now_us - MISSED_HEARTBEATS * self.site.timing.heartbeat_us
        return {node for node, peer in self.peers.items() if peer.heard_at_us >= limit_us}

    def digest(self) -> int:
        """CRC-16/CCITT-FALSE over firm itineraries (node, version) and what else all are to believe."""
        if self._digest is None:
            plans = [node << 8 | itinerary.version for node, itinerary in sorted(self.itineraries.items())]
            self._digest = crc_hqx(digest_words(plans) + self._believed(), 0xFFFF)
        return self._digest

    # --- what a system's own mirror adds ------------------------------------------------------------------------

    def _believed(self) -> bytes:
        """More for the digest (``digest_words``); it is asked for after each word that changes it, however many."""
        return b""

    def joins(self, tokens: TokenBook, drops: Counter[Reason]) -> None:
        """Whose rights decide which words count, and where those that do not are counted."""

    def replay(self, entries: Iterable[Mapping[str, str | int]]) -> None:
        """Take up what the journal tells of the site's things."""

    def handlers(self) -> dict[type[Message], Callable[[Any, int], list[Effect]]]:
        """Handler of each message about the site's things."""
        return {}

    def hear(self, message: Message, now_us: int) -> None:
        """Any message, before whoever it is for takes it up."""

    def settle(self, word: TokenGrant | TokenHeld) -> Message | None:
        """Another that waited, and is proven by what was just heard of its token."""
        return None

    def statements(self) -> list[Effect]:
        """What this machine says again of the site's things, to who asks."""
        return []

    def forgotten(self) -> list[Effect]:
        """What of the site's things is no more, for the journal."""
        return []

    def slept(self, now_us: int) -> None:
        """I have slept, or my clock has jumped: what lasts too long is counted from ``now_us`` on."""

    def retime(self, now_us: int) -> None:
        """My clock was set anew: read the times of all plans again, as the nearest to ``now_us`` that they can be."""

    def slots_of(self, machine: Machine, holder_of: Callable[[TokenKey], int]) -> frozenset[Segment]:
        """Slots that a machine is in, or may enter: nobody else plans to be there while it is in the way."""
        return frozenset()

    def stands(self, node: int, now_us: int) -> bool:
        """Whether a machine has stood for too long where its plan does not leave it."""
        return False

    def is_planless(self, machine: Machine) -> bool:
        """Whether nobody can plan around a machine until it has told a plan."""
        return False

    def is_laden(self, node: int) -> bool:
        """Whether a machine has something aboard that nobody can take from it."""
        return False

    def predecessor(self, node: int, key: TokenKey) -> int:
        """Who is to have a token right before ``node``, by the plans of both."""
        return NOBODY

    def on_return(self, node: int, key: TokenKey) -> None:
        """A machine gave a token back that it does not need any more."""

    def is_false(self, message: Message) -> bool:
        """Whether a word under my own number vouches for what I never said."""
        return False

    # --- rights that are made anew -----------------------------------------------------------------------------

    def site_tokens(self) -> Iterable[TokenKey]:
        """All tokens that the site has from the first."""
        return ()

    def recalls(self) -> None:
        """From now on whoever remembers a thing of the lost machine speaks in its place."""

    def vouched(self, node: int) -> dict[TokenKey, tuple[int, Message]]:
        """What a machine vouches for: version of the token, and the word about it, as I remember them."""
        return {}

    def takes_over(self, versions: Mapping[TokenKey, int], *, counts: bool) -> list[Effect]:
        """These tokens are this machine's once the list ``counts``; journalled before: what others remember of them."""
        return []
