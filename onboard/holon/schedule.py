"""When a machine has something to do, and whose word changes nothing: kept, until something changes it.

Every event either changes nothing here or lets all of this go (``changed``); it is worked out anew when it is asked for
next. ``sweeps`` keeps nothing: every event is followed by every part, so that a test can see that both do the same.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, get_args, runtime_checkable

from onboard.contract.codes import TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import BusTime, Heartbeat, Message, SyncRequest
from onboard.core.behaviour import Attentive, Behaviour, Fleet, OverheardWord
from onboard.core.mirror import Peer
from onboard.holon.admission import Admission
from onboard.holon.fixed_times import FixedTimes
from onboard.holon.presence import SLEPT_BEATS
from onboard.holon.rights import RightsTalk
from onboard.holon.taking_part import TakingPart

_OVERHEARD = frozenset(get_args(OverheardWord))
#: What a machine may say that may be none of my business, each with whether it names a token.
_Passed = dict[type[Message], bool]
#: Of a node whose last word may change something.
_NOBODY: tuple[Peer | None, _Passed] = None, {}


@runtime_checkable
class Selective(Attentive, Protocol):
    """A behaviour that passes over words of its own system too: of ``overhears`` its ``heeds`` is asked as well."""

    overhears: frozenset[type[Message]]

    def heeds(self, message: Message) -> bool:
        """Whether ``advance`` or a negotiation of this machine reads what this word changed."""


@dataclass
class Schedule:
    """One machine's. All times are bus time in us."""

    #: Whether every event is followed by every part of the machine; for tests, before a machine is made.
    sweeps: ClassVar[bool] = False

    part: TakingPart
    fleet: Fleet
    rights: RightsTalk
    fixed: FixedTimes
    behaviour: Behaviour
    admission: Admission
    #: Whether what is kept here holds, and until when nothing is to be done unless something happens.
    is_known: bool = False
    #: Whether somebody has asked when that is since it was another time.
    is_asked: bool = False
    waits_until_us: int = 0
    #: Whether bus time was lost when this machine woke last.
    is_time_lost: bool = False
    _due_us: int | None = None
    #: The same of all but what is said at fixed times.
    _work_due_us: int | None = None
    #: When the first of all but the behaviour and the negotiation is due, and of which state of rights that is.
    _rest_us: int | None = None
    _rest_of: int | None = None
    #: From when on the behaviour is to see every event.
    _looks_from_us: int = 0
    #: Who said last what changes nothing, by node, and what of it may be passed by; that by all that it may say.
    _unchanged: dict[int, tuple[Peer, _Passed]] = field(default_factory=dict)
    _passed: dict[frozenset[type[Message]], _Passed] = field(default_factory=dict)
    #: The mirror, the epoch of the rights, whether I send bus time, and which other site counts, as they were then.
    _ground: tuple[int, int, bool, int] | None = None
    _attentive: Attentive | None = field(init=False)
    #: What it says of words that are in ``_overheard``.
    _heeds: Callable[[Any], bool] | None = field(init=False)
    #: Classes of words that may be none of my business.
    _overheard: frozenset[type[Message]] = _OVERHEARD

    def __post_init__(self) -> None:
        self.begins_anew(self.behaviour)
        self._sleeps_after_us = SLEPT_BEATS * self.fleet.site.timing.heartbeat_us
        self._presence, self._holding, self._tokens = self.part.presence, self.part.holding, self.fleet.tokens

    def begins_anew(self, behaviour: Behaviour) -> None:
        """Another behaviour from now on."""
        self.behaviour = behaviour
        self._attentive = behaviour if isinstance(behaviour, Attentive) and not self.sweeps else None
        self._heeds = None if self._attentive is None else self._attentive.heeds
        own = behaviour.overhears if isinstance(behaviour, Selective) and not self.sweeps else frozenset()
        self._overheard = _OVERHEARD | own
        self._unchanged.clear()
        self._passed.clear()
        self.changed()

    def changed(self) -> None:
        """Something happened here that any part may have to do with."""
        self.is_known, self.is_asked, self.waits_until_us, self._rest_of = False, False, 0, None

    def acted(self) -> None:
        """Only the behaviour has had anything to do: what is due in all else is due as before, if its rights are."""
        rests = self._rest_of
        self.changed()
        self._rest_of = rests

    def slewed(self) -> None:
        """Bus time went on a little faster or slower: what is due stays due, at another time of my own clock."""
        if self.part.witness.next_wake() is None:
            self.is_asked = False
        else:
            self.changed()

    # --- when --------------------------------------------------------------------------------------------------

    def due_us(self) -> int | None:
        """When the first of all parts has something to do: a matter of what they know, not of when that is asked."""
        self.is_asked = True
        if not self.is_known:
            self._work_due_us, self.is_known = self._first_work_us(), True
            self._looks_from_us = self._attentive.looks_from() if self._attentive is not None else 0
            self.has_spoken()
            self._keep_unchanged()
        return self._due_us

    def has_spoken(self) -> None:
        """What is said at fixed times was said, and nothing else was done."""
        self._due_us = due_us = self.fixed.due_us(self._work_due_us)
        if due_us is not None:
            self.waits_until_us = min(due_us, self._looks_from_us)

    def _first_work_us(self) -> int | None:
        if self._rest_of != self.fleet.tokens.changes:
            self._rest_us, self._rest_of = self._first_of_rest_us(), self.fleet.tokens.changes
        times = [self._rest_us]
        if self.part.begins:
            # In the negotiation nothing is due while bus time is lost: its deadlines mean nothing then. What the last
            # wake found holds until the next time message.
            times += (None if self.is_time_lost else self.fleet.negotiation.next_wake(), self.behaviour.next_wake())
        return min([time for time in times if time is not None], default=None)

    def _first_of_rest_us(self) -> int | None:
        """The same of all but the behaviour, and the negotiation of which it is a part."""
        part, is_apart = self.part, self.part.holding.is_apart
        times = [part.holding.next_wake(), part.regeneration.next_wake(), part.change.next_wake()]
        times.append(part.presence.held_until_us)
        if not is_apart:
            times.append(part.witness.next_wake())
        if not (is_apart or part.regeneration.is_frozen):
            times += (self.fleet.tokens.next_wake(), self.rights.petition_due())
        return min([time for time in times if time is not None], default=None)

    def only_works(self, local_us: int) -> bool:
        """Whether nothing but the behaviour, or a word at fixed times, is due."""
        if not self.is_known or self.sweeps or not self.part.begins:
            return False
        clock, now_us = self.part.time.clock, self.part.time.clock.bus_us(local_us)
        others = (self._rest_us, None if self.is_time_lost else self.fleet.negotiation.next_wake())
        if any(due_us is not None and due_us <= now_us for due_us in others):
            return False
        return clock.is_lost(local_us) is self.is_time_lost and not self.part.presence.slept(now_us)

    def only_speaks(self, local_us: int) -> bool:
        """Whether nothing but a word that is said at fixed times is due, and nobody looks for anything."""
        if not self.is_known or not self.part.begins:
            return False
        now_us = self.part.time.clock.bus_us(local_us)
        if self._work_due_us is not None and self._work_due_us <= now_us:
            return False
        if self.part.time.clock.is_lost(local_us) != self.is_time_lost or self.part.presence.slept(now_us):
            return False
        return now_us < self._looks_from_us

    # --- who ---------------------------------------------------------------------------------------------------

    def lives_on(self, beat: Heartbeat, now_us: int) -> bool:
        """Note the time of a sign of life that says nothing new, and nothing else; False where it may be news."""
        (peer, _), is_quiet = self._unchanged.get(beat.sender, _NOBODY), now_us < self.waits_until_us
        if not is_quiet or peer is None or peer.beat is not beat or now_us - peer.heard_at_us > self._sleeps_after_us:
            self._unchanged.pop(beat.sender, None)
            return is_quiet and self._is_unchanged(beat, now_us)
        # Who was heard so lately was neither silent nor heard by somebody who slept, or was deaf.
        peer.heard_at_us = now_us
        self.part.presence.active_us = now_us
        self.part.holding.heard(now_us)
        return True

    def _is_unchanged(self, beat: Heartbeat, now_us: int) -> bool:
        if not self.part.lives_on(beat, now_us):
            return False
        peer = self.fleet.mirror.peers[beat.sender]
        peer.beat, peer.mirror_digest = beat, beat.mirror_digest
        says = self.admission.says(beat.sender)
        if says not in self._passed:
            self._passed[says] = {kind: "token_kind" in kind.__match_args__ for kind in says & self._overheard}
        self._unchanged[beat.sender] = peer, self._passed[says]
        return True

    def passes_by(self, message: Message, now_us: int) -> int | None:
        """The state of my rights before a word that may be none of my business, where all is as usual; else None.

        Nothing is due here, neither its sender nor I was silent, and it counts and may say this: that was looked at
        when its last sign of life changed nothing. This one is noted.
        """
        peer, said = self._unchanged.get(message.sender, _NOBODY)
        names_token = said.get(type(message))
        if peer is None or names_token is None or now_us - peer.heard_at_us > self._sleeps_after_us:
            return None
        if now_us >= self.waits_until_us or (names_token and getattr(message, "token_kind", None) is TokenKind.RUN):
            return None
        peer.heard_at_us = self._presence.active_us = now_us
        self._holding.heard(now_us)
        return self._tokens.changes

    def _keep_unchanged(self) -> None:
        """Let go of whose word said nothing new, unless all that this was judged by is as it was."""
        part, mirror = self.part, self.fleet.mirror
        is_usual = not (mirror.aside or part.presence.foreign or part.presence.halts) and part.deals
        ground = mirror.digest(), part.regeneration.epoch, part.time.clock.is_source, part.change.other
        if ground != self._ground or not is_usual:
            self._unchanged.clear()
        self._ground = ground

    def before(self, message: Message, now_us: int) -> int | None:
        """The state of my rights before a message that may be none of my business; None for what changes everything.

        None of an obstacle is: that it is heard may end that. What bus time changes it says itself (``slewed``).
        """
        is_candidate = type(message) in self._overheard or self._asks_another(message)
        if is_candidate and now_us < self.waits_until_us and message.sender not in self.fleet.mirror.aside:
            return self.fleet.tokens.changes
        if type(message) is not BusTime:
            self.changed()
        return None

    def is_overheard(self, message: Message, before: int | None) -> bool:
        """Whether a message changed no right of mine, as they were ``before``, and nothing that anybody here reads."""
        heeds = self._heeds
        if heeds is None or before != self._tokens.changes or not self.is_known:
            return False
        if type(message) in self._overheard:
            return not heeds(message)
        return self._asks_another(message)

    def _asks_another(self, message: Message) -> bool:
        """Whether somebody else is asked what it knows."""
        return type(message) is SyncRequest and message.whom not in (NOBODY, self.fleet.node_id)
