"""The holon: a value that eats messages and timers and returns effects. It owns no task, socket or clock.

``receive`` (fleet bus), ``sense`` (device bus) and ``wake`` take the machine's loop time in us; ``next_wake`` tells
when to call ``wake`` again. Inside, all times are bus time. You can drive one from a Python prompt.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from onboard.contract.codes import CONTRACT_VERSION, MachineState, Reason
from onboard.contract.constants import NOBODY, Speakers
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    EmergencyStop,
    Go,
    Halted,
    Heartbeat,
    Itinerary,
    LeftOut,
    Message,
    Progress,
    SyncRequest,
    TaskReport,
    TokenGrant,
    TokenHeld,
)
from onboard.contract.runs import singles
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.behaviour import Behaviour, BehaviourFactory
from onboard.core.bus_time import BUS_TIME_MODULUS
from onboard.core.effects import Effect, Halt, Record, Renew, Report, Send
from onboard.core.journal_records import Entry, records_in
from onboard.core.journal_state import INTACT, OLD, RIGHTS_LOST, JournalCondition, reason_of, still_counting
from onboard.core.negotiation import EVENT_TYPES, NegotiationEvent, negotiation_of
from onboard.core.records import BootRecord
from onboard.core.site import Machine, Site
from onboard.holon.admission import Admission
from onboard.holon.fixed_times import FixedTimes
from onboard.holon.holding import MachineHolds
from onboard.holon.holds import Holds, without_rights
from onboard.holon.own_number import OwnNumber
from onboard.holon.presence import Presence
from onboard.holon.regeneration import Regenerating
from onboard.holon.rights import RightsTalk
from onboard.holon.schedule import Schedule
from onboard.holon.site_change import SiteChange
from onboard.holon.taking_part import TakingPart
from onboard.holon.timekeeper import TimeHeard, Timekeeper
from onboard.holon.witness import Doubt, Witness

#: Most effects that one event may cause before the holon counts as running away.
MAX_ROUNDS = 100


class Holon:
    """One machine's controller, of any kind. ``boot`` is the boot counter, 1 to 255; ``entries`` the journal's."""

    def __init__(
        self,
        site: Site,
        machine: Machine,
        factory: BehaviourFactory,
        *,
        boot: int = 1,
        entries: Iterable[Entry] = (),
        journal: JournalCondition = INTACT,
    ) -> None:
        self.site = site
        #: How the journal was found; its ``entries`` are all that there ever were only where it is reliable.
        self.journal = journal
        self.machine, self.node_id, self.boot = machine, machine.node_id, boot
        self.halted: str | None = None
        #: Input dropped here, by reason, and the counts of the shell's decoders and queues below; summed when told.
        self.drops: Counter[Reason] = Counter()
        self.wire_drops: tuple[Counter[Reason], ...] = ()
        self.admission = Admission(site)
        self.tokens = TokenBook(site, machine.node_id)
        entries = still_counting(journal, entries)
        self.tokens.replay(entries)
        self._has_past = any(records_in(entries, BootRecord))
        self.mirror = factory.fleet_type.mirror_type(site, machine.node_id)
        self.mirror.replay(entries)
        self.time = Timekeeper(site, machine, self.mirror, self.drops)
        self.clock = self.time.clock
        self.presence = Presence(site, machine.node_id, self.mirror, self.tokens)
        self.holding = MachineHolds(machine.node_id, site.timing.heartbeat_us)
        self.holding.replay(entries, reason_of(journal))
        #: Whether the bus has taken my frames of late; the shell knows.
        self.is_acknowledged = True
        own = OwnNumber(machine.node_id, self.tokens, self.mirror)
        self.holds = Holds(
            self.holding, self.presence, own, self.drops, self._heartbeat, self._new_life, lambda: self.behaviour
        )
        self._factory, estimator = factory, factory.estimator(site, machine, self.mirror)
        self.negotiation = negotiation_of(site, machine, estimator, boot, self.mirror.aside.__contains__)
        self.fleet = factory.fleet_type(site, machine, self.tokens, self.mirror, self.negotiation, entries, self.drops)
        self.behaviour: Behaviour = factory.behaviour(self.fleet, estimator)
        self.witness = Witness(self.tokens, self.mirror, boot, self._has_past, self._statements, self.presence.halts)
        self.rights = RightsTalk(self.fleet, self._may_grant, self.witness)
        self.regeneration = Regenerating(self.tokens, self.mirror, self._statements, self._thaw)
        self.regeneration.replay(entries)
        self.change = SiteChange(machine.node_id, site.digest)
        self.regeneration.refuses = lambda: self.holding.why.reason if self.holding.is_apart else Reason.NONE
        self.part = TakingPart(self.presence, self.holding, self.regeneration, self.witness, self.time, self.change)
        self.fleet.motion.why_still = self.part.why_still
        self.rights.is_frozen = self.mirror.is_frozen = lambda: self.regeneration.is_frozen
        if self.holding.why.reason in RIGHTS_LOST:
            self.fleet.has_no_rights, self.witness.doubt = True, Doubt(self.holding.why.reason, NOBODY, journal.why)
        self.fixed = FixedTimes(self.time, self.presence, self.holds, self.fleet, self._all_drops)
        #: When ``wake`` is due, and what of it is kept after an event.
        self.schedule = Schedule(self.part, self.fleet, self.rights, self.fixed, self.behaviour, self.admission)
        self._sensed_early: dict[type[Message], Message] = {}
        # Each handler takes the class that it is listed under; Any is what a dispatch table costs.
        self._handlers: dict[type[Message], Callable[[Any, int], list[Effect]]] = {
            **self.rights.handlers(),
            **self.regeneration.handlers(),
            **self.change.handlers(),
            **dict.fromkeys((CallForProposals, Bid, Award, TaskReport, LeftOut), self._negotiate),
            Itinerary: self._on_itinerary,
            Progress: self._on_progress,
            Heartbeat: self._on_heartbeat,
            SyncRequest: self._on_sync_request,
            EmergencyStop: self.holds.on_stop,
            Go: self.holds.on_go,
            Halted: self.holds.on_halted,
            **self.mirror.handlers(),
        }

    # --- events in ---------------------------------------------------------------------------------------------

    def bus_us(self, local_us: int) -> int:
        """Bus time as this machine believes it to be at loop time ``local_us``, for who looks from outside."""
        return self.time.bus_us(local_us)

    def start(self, local_us: int) -> list[Effect]:
        """First effects after power-up: the boot counter to the journal, then the first heartbeat."""
        local_us = self.time.steady(local_us)
        # Bus time starts somewhere; the lowest fixed node's start is as good as any.
        self.time.elect(local_us)
        now_us = self.clock.bus_us(local_us)
        self.presence.begins(now_us)
        self.fixed.say_first(now_us, self.behaviour.state, asks=not self.journal.is_foreign)
        if self.journal.is_foreign:
            return [Report(self.journal.line), *self.fixed.words(now_us)]
        effects = self._first_entries(self.journal) + self.behaviour.start(now_us) + self.fixed.words(now_us)
        return self._settle(effects + self.witness.begin(now_us), now_us)

    def _first_entries(self, journal: JournalCondition) -> list[Effect]:
        """Of a short journal only that it was: another is begun, that stands for the hold until a person ends it."""
        boot = BootRecord(self.boot)
        if journal.is_reliable:
            return [Record(boot)]
        return [Renew((*self.fleet.entries, boot.entry, self.holding.record().entry)), Report(journal.line)]

    def listen(self, speakers: Speakers) -> None:
        """From now on only who may say a message, by the contract of the wire, is heard with it."""
        self.admission.listen(speakers)
        self.schedule.begins_anew(self.behaviour)

    def receive(self, message: Message, local_us: int) -> list[Effect]:
        """A message of the fleet bus, received at ``local_us``; one of a run of tokens is one for each of them."""
        local_us = self.time.steady(local_us)
        now_us = self.clock.bus_us(local_us)
        if isinstance(message, Heartbeat) and self.schedule.lives_on(message, now_us):
            return []
        before = self.schedule.passes_by(message, now_us)
        is_usual = before is not None
        if before is None:
            before = self.schedule.before(message, now_us)
            if message.sender == self.node_id:
                self.schedule.changed()
                return self.holds.on_own_number(message, now_us)
            why = self.admission.why_not(message)
            if why is not Reason.NONE:
                self.drops[why] += 1
                self.schedule.changed()
                return self.admission.passed_over(message, why) if self.halted is None else []
            self.holding.heard(now_us)
            if isinstance(message, BusTime):
                return self._on_bus_time(message, local_us)
        if is_usual:
            effects = self._take_up(message, now_us, is_usual=True)
        elif self.part.is_deaf_to(message, self.drops):
            return []
        else:
            effects = [effect for word in singles(message) for effect in self._take_up(word, now_us)]
        if not effects and self.schedule.is_overheard(message, before):
            return effects
        self.schedule.changed()
        return self._settle(effects, now_us)

    def _take_up(self, message: Message, now_us: int, *, is_usual: bool = False) -> list[Effect]:
        """Tell every part of a message: what all believe first. Where all ``is_usual`` its sender's life is noted."""
        effects: list[Effect] = []
        if not is_usual:
            effects = self._awake(now_us)
            if self.presence.is_back(message.sender, now_us):
                self.fixed.on_return(now_us + self.witness.slot_us, now_us)
        self.mirror.hear(message, now_us)
        if not is_usual:
            self.presence.heard(message.sender, now_us)
        handler = self._handlers.get(type(message))
        if handler is not None:
            effects += handler(message, now_us)
        if not is_usual and isinstance(message, (Itinerary, Heartbeat)):
            self.presence.heard(message.sender, now_us)
        effects += self.behaviour.hear(message, now_us)
        if isinstance(message, (TokenGrant, TokenHeld)):
            proven = self.mirror.settle(message)
            if proven is not None:
                self.schedule.changed()
                effects += self.behaviour.hear(proven, now_us)
        return effects

    def sense(self, message: Message, local_us: int) -> list[Effect]:
        """A message of the machine's own device bus."""
        if self.journal.is_foreign:
            return []
        local_us = self.time.steady(local_us)
        if not self.clock.is_set:
            self.schedule.changed()
            # Plans made before bus time is known would be told in a time of one's own.
            self._sensed_early[type(message)] = message
            return []
        now_us = self.clock.bus_us(local_us)
        effects = self._awake(now_us)
        self.schedule.changed() if effects else self.schedule.acted()
        return self._settle(effects + self.behaviour.sense(message, now_us), now_us)

    def wake(self, local_us: int) -> list[Effect]:
        """Do what has fallen due."""
        local_us = self.time.steady(local_us)
        if self.schedule.only_speaks(local_us):
            return self._speak(local_us)
        if self.schedule.only_works(local_us):
            return self._work(local_us)
        self.schedule.changed()
        # Who has slept counts nobody as silent, so that it does not take itself for the time source.
        effects = self._awake(self.clock.bus_us(local_us))
        self.time.elect(local_us)
        now_us = self.clock.bus_us(local_us)
        effects += self.holds.apply(self.holding.wake(now_us, acknowledged=self.is_acknowledged), now_us)
        effects += self.regeneration.wake(now_us) + self.change.wake(now_us)
        if not self.holding.is_apart:
            effects += self.witness.wake(now_us)
        if self.part.deals:
            effects += self.tokens.wake(now_us) + self.rights.serve_petitions(now_us)
        self.schedule.is_time_lost = self.clock.is_lost(local_us)
        if self.presence.is_admitted(now_us, in_time=self.clock.far_us is None):
            # What was planned before is old; the first word is that of a machine that takes part.
            self.fleet.admissions += 1
            self.fleet.winners.begin_anew(now_us)
            self.fixed.heartbeat_due_us = now_us
        if not self.schedule.is_time_lost and self.part.begins:
            effects += self._carry_out(self.negotiation.wake(now_us), now_us)
        effects += self.fixed.words(now_us)
        return self._settle(effects, now_us)

    def next_wake(self) -> int | None:
        """Loop time in us at which ``wake`` is to be called, or None before ``start``."""
        if self.halted is not None:
            return None
        due_us = self.schedule.due_us()
        return None if due_us is None else self.time.loop_us(due_us)

    def _work(self, local_us: int) -> list[Effect]:
        """Go on with the work, and say what is said at fixed times: nothing else is due."""
        self.time.elect(local_us)
        now_us = self.clock.bus_us(local_us)
        self.presence.begins(now_us)
        self.schedule.acted()
        return self._settle(self.fixed.words(now_us), now_us)

    def _speak(self, local_us: int) -> list[Effect]:
        """Say what is said at fixed times; go on with the work only where somebody fell silent, or came back."""
        was_source = self.clock.is_source
        self.time.elect(local_us)
        now_us = self.clock.bus_us(local_us)
        self.presence.begins(now_us)
        aside = dict(self.mirror.aside)
        effects = self.fixed.words(now_us)
        if aside != self.mirror.aside or self.clock.is_source is not was_source:
            self.schedule.changed()
            return self._settle(effects, now_us)
        self.schedule.has_spoken()
        return self._approve(effects)

    def _awake(self, now_us: int) -> list[Effect]:
        """Whoever finds that it has slept is an obstacle first, says so, and asks what it has missed."""
        if self.fixed.heartbeat_due_us is None or not self.presence.awake(now_us):
            return []
        self.fixed.heartbeat_due_us = now_us + self.site.timing.heartbeat_us
        self.holding.slept(now_us)
        self.witness.slept(now_us)
        # One by one: all are asked at power-up only, and who has asked them just then waits for their answers.
        peers = self.mirror.peers if self.witness.is_over else ()
        asked = [effect for node in peers for effect in self.witness.ask(node)]
        return [Report("woke after a sleep"), Send(self._heartbeat()), *asked]

    def _on_bus_time(self, message: BusTime, local_us: int) -> list[Effect]:
        if message.sender in self.presence.foreign:
            return []
        if message.bus_time_us >= BUS_TIME_MODULUS:
            self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            return []
        before_us = self.clock.bus_us(local_us)
        heard = self.time.hear(message, local_us)
        now_us = self.clock.bus_us(local_us)
        self.witness.shift(now_us - before_us)
        was_lost = self.schedule.is_time_lost
        self.schedule.is_time_lost &= heard in (TimeHeard.NOTHING, TimeHeard.REFUTED)
        if heard in (TimeHeard.NOTHING, TimeHeard.FOLLOWED) and self.schedule.is_time_lost is was_lost:
            self.schedule.slewed()
            return []
        self.schedule.changed()
        match heard:
            case TimeHeard.REFUTED:
                return [self.fixed.bus_time(now_us)]
            case TimeHeard.FIRST:
                return self._begin(now_us)
            case TimeHeard.SET_ANEW:
                # What was read of plans meanwhile was read in the wrong time.
                self.mirror.retime(now_us)
                return self._awake(now_us)
        return []

    def _begin(self, now_us: int) -> list[Effect]:
        """Bus time is known: the first word, and what was sensed before."""
        self.presence.begins(now_us)
        effects: list[Effect] = []
        for early in self._sensed_early.values():
            effects += self._settle(self.behaviour.sense(early, now_us), now_us)
        self._sensed_early.clear()
        self.fixed.say_first(now_us, self.behaviour.state, asks=not self.journal.is_foreign)
        return effects

    # --- handlers ----------------------------------------------------------------------------------------------

    def _negotiate(self, message: Message, now_us: int) -> list[Effect]:
        if isinstance(message, CallForProposals):
            why = self.part.why_no_bid(self.behaviour.state, now_us)
            if why is not Reason.NONE:
                self.drops[why] += 1
                return []
        outcome = self.negotiation.receive(message, now_us)
        return self._carry_out(outcome, now_us) if outcome else []

    def _on_itinerary(self, itinerary: Itinerary, now_us: int) -> list[Effect]:
        self.mirror.on_itinerary(itinerary, now_us)
        return self._carry_out(self.negotiation.receive(itinerary, now_us), now_us)

    def _on_progress(self, progress: Progress, now_us: int) -> list[Effect]:
        self.mirror.on_progress(progress)
        return []

    def _on_heartbeat(self, beat: Heartbeat, now_us: int) -> list[Effect]:
        news = self.regeneration.on_heartbeat(beat, now_us)
        reason = self.change.strange(beat, self.regeneration.epoch)
        if reason is not Reason.NONE:
            self.drops[reason] += 1
            self.presence.heard_foreign(beat.sender, reason, now_us)
            return news
        self.presence.foreign.pop(beat.sender, None)
        self.presence.heard_beat(beat)
        fresh = self.mirror.on_heartbeat(beat, now_us)
        if fresh or (self.clock.is_source and beat.sender < self.node_id):
            self.time.elect(self.clock.local_us(now_us))
        if self.holding.is_apart:
            return news
        if fresh:
            self.tokens.begin_anew(now_us)
            self.negotiation.begin_anew(now_us)
        return news + self.witness.on_heartbeat(beat, now_us, is_fresh=fresh)

    def _on_sync_request(self, request: SyncRequest, now_us: int) -> list[Effect]:
        if request.whom not in (NOBODY, self.node_id):
            self.witness.on_other_request(request.whom, now_us)
            return []
        # Who asks may just have joined: it need not wait for the next period.
        told = [self.fixed.bus_time(now_us)] if self.clock.is_source else []
        return told + self.witness.on_request(request, now_us)

    def _statements(self, now_us: int) -> list[Effect]:
        return self.behaviour.statements(now_us) + self.mirror.statements()

    # --- holds -------------------------------------------------------------------------------------------------

    def _thaw(self, lost: int, now_us: int) -> list[Effect]:
        """Rights were made anew, or it was broken off: who lost its own begins as after a restart, all others look."""
        if lost not in (NOBODY, self.node_id):
            self.fleet.forgetful.add(lost)
        elif lost == self.node_id:
            self.witness.doubt, self.witness.has_past, self.fleet.has_no_rights = None, True, False
            self.fleet.slots_told = self.regeneration.slots()
            if self.holding.why.reason in RIGHTS_LOST:
                return self.holds.apply(self.holding.go(self.node_id), now_us)
        self.presence.listen_anew(now_us)
        return self.holds.words()

    def _may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Who is held gives no right away: it may be one that it does not have any more."""
        if self.holding.is_held or self.regeneration.is_frozen:
            return self.holding.why.reason if self.holding.is_held else Reason.REGENERATION
        return self.behaviour.may_grant(key, requester, now_us)

    def _new_life(self, now_us: int) -> tuple[int, list[Effect]]:
        """As after a restart: the boot counter, and the question to all what they know."""
        self.boot = self.witness.boot = self.boot % 255 + 1
        self.witness.has_past = True
        return self.boot, self.witness.begin(now_us)

    def last_word(self, reason: Reason, *, needs_person: bool) -> Halted:
        """What is said before the process ends: ``reason`` where none was given before, and who brings it back."""
        return self.holding.last_word(self.boot, reason, needs_person=needs_person)

    # --- inner works -------------------------------------------------------------------------------------------

    def _settle(self, effects: list[Effect], now_us: int) -> list[Effect]:
        """Let the machine go on until it waits for something; bounded, as each round must come from the one before."""
        effects = effects if self.witness.doubt is None else effects + self._doubts(now_us)
        if self.halted is not None:
            return [effect for effect in effects if isinstance(effect, Report | Halt)]
        for _ in range(MAX_ROUNDS if self.part.begins else 0):
            more = self.behaviour.advance(now_us)
            if not more:
                break
            effects = effects + more
        else:
            if self.part.begins:
                effects = effects + self._halt("the machine's steps do not come to rest", Reason.RUNAWAY)
        self.fixed.tell_soon(now_us, self.behaviour.state, has_told=self.witness.heed(effects, now_us))
        return self._approve(effects)

    def _approve(self, effects: list[Effect]) -> list[Effect]:
        """What of all effects may leave this machine: nothing moves without authority, nor is a right said without."""
        if not effects:
            self.fleet.motion.event += 1
            return effects
        fault = self.fleet.motion.fault(effects, self.site.moved_by)
        if fault is not None:
            return self._halt(fault, Reason.NOT_AUTHORISED)
        self.holds.own.note(effects)
        is_mute = self.fleet.has_no_rights and not self.regeneration.is_frozen
        return without_rights(effects, self.mirror.vouching) if is_mute else effects

    def _doubts(self, now_us: int) -> list[Effect]:
        """Somebody knows that the journal is old: nothing of it is used any more, as if it were short."""
        doubt = self.witness.doubt
        if doubt is None or self.holding.why.reason in RIGHTS_LOST:
            return []
        self.fleet.has_no_rights = True
        held = self.holds.apply(self.holding.for_person(doubt.reason, doubt.cause), now_us)
        return [*self._forget(now_us), Report(doubt.text), *held]

    def _forget(self, now_us: int) -> list[Effect]:
        """What the behaviour took up, from an old journal or as in a first life, is wrong: both begin anew."""
        self.fleet.entries = still_counting(OLD, self.fleet.entries)
        self.negotiation.estimator = estimator = self._factory.estimator(self.site, self.machine, self.mirror)
        self.behaviour = behaviour = self._factory.behaviour(self.fleet, estimator)
        self.schedule.begins_anew(behaviour)
        self.fixed.ask_devices(now_us, behaviour.state)
        return [*(self._first_entries(OLD) if self._has_past else []), *self.behaviour.start(now_us)]

    def _carry_out(self, outcome: list[Effect | NegotiationEvent], now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        for item in outcome:
            effects += self.behaviour.negotiated(item, now_us) if isinstance(item, EVENT_TYPES) else [item]
        return effects

    def _all_drops(self) -> Counter[Reason]:
        return sum((one for one in (self.drops, *self.wire_drops) if one), Counter())

    def _heartbeat(self) -> Heartbeat:
        return Heartbeat(
            self.node_id,
            CONTRACT_VERSION,
            self.site.digest,
            self.mirror.digest(),
            self.boot,
            self.machine.kind,
            MachineState.OBSTACLE if self.part.is_still else self.behaviour.state,
            self.regeneration.epoch,
        )

    def _halt(self, why: str, reason: Reason, cause: int = NOBODY) -> list[Effect]:
        if self.halted is not None:
            return []
        self.halted = why
        self.holding.halt(reason, cause)
        return [Halt(why, reason)]
