"""The holon: a value that eats messages and timers and returns effects. It owns no task, socket or clock.

``receive`` (fleet bus), ``sense`` (device bus) and ``wake`` take the machine's loop time in us; ``next_wake`` tells
when to call ``wake`` again. Inside, all times are bus time. You can drive one from a Python prompt.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from onboard.core.admission import Admission
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.behaviour import Behaviour, BehaviourFactory, Fleet
from onboard.core.bus_time import BUS_TIME_MODULUS, BusClock
from onboard.core.codes import CONTRACT_VERSION, MOBILE_KINDS, NOBODY, KindCode, MachineState, Reason
from onboard.core.effects import Effect, Halt, Record, Report, Send
from onboard.core.holding import Hold, Holding, Outcome
from onboard.core.journal_state import INTACT, JournalCondition, reason_of
from onboard.core.messages import (
    Award,
    Bid,
    Blocked,
    BusTime,
    CallForProposals,
    CarAt,
    Clear,
    Diagnostic,
    EmergencyStop,
    Heartbeat,
    Itinerary,
    Message,
    Progress,
    Speakers,
    SyncRequest,
    TaskReport,
)
from onboard.core.mirror import Mirror
from onboard.core.negotiation import EVENT_TYPES, Negotiation, NegotiationEvent, slot_of
from onboard.core.own_number import OwnNumber
from onboard.core.presence import Presence
from onboard.core.recovery_messages import Go, Halted
from onboard.core.regeneration import RIGHTS_LOST, Regenerating
from onboard.core.rights import Rights
from onboard.core.site import Machine, Site
from onboard.core.witness import Witness

#: Most effects that one event may cause before the holon counts as running away.
MAX_ROUNDS = 100
#: All that is heard of a machine with another contract or site: the stop, who it is, and where it stands.
_OF_FOREIGNERS = (EmergencyStop, Heartbeat, Progress)
#: All that a machine hears while it is apart: what may end that, who lives, and why others do not act.
_WHILE_APART = (EmergencyStop, Go, Halted, Heartbeat)


class Holon:
    """One machine's controller, of any kind. ``boot`` is the boot counter, 1 to 255; ``entries`` the journal's."""

    def __init__(
        self,
        site: Site,
        machine: Machine,
        factory: BehaviourFactory,
        *,
        boot: int = 1,
        entries: Iterable[Mapping[str, str | int]] = (),
        journal: JournalCondition = INTACT,
    ) -> None:
        self.site = site
        #: How the journal was found; its ``entries`` are all that there ever were only where it is reliable.
        self.journal = journal
        self.machine = machine
        self.node_id = machine.node_id
        self.boot = boot
        self.halted: str | None = None
        #: Input dropped here, and below by the shell's decoders and queues, by reason.
        self.drops: Counter[Reason] = Counter()
        self.wire_drops: Counter[Reason] = Counter()
        self._told_drops: Counter[Reason] = Counter()
        self.admission = Admission(site)
        self.clock = BusClock(site.timing.bus_time_us)
        self.tokens = TokenBook(site, machine.node_id)
        entries = tuple(entries)
        self.tokens.replay(entries)
        self._has_past = any(entry.get("record") == "boot" for entry in entries)
        self.mirror = Mirror(site, machine.node_id)
        for entry in entries:
            if entry.get("record") in ("blocked", "clear"):
                word = Blocked if entry["record"] == "blocked" else Clear
                told = word(machine.node_id, int(entry["track"]), int(entry["index"]), Reason(int(entry["reason"])))
                self.mirror.on_word(told, 0)
        self.presence = Presence(site, machine.node_id, self.mirror, self.tokens)
        self.holding = Holding(machine.node_id, site.timing.heartbeat_us)
        self.holding.replay(entries)
        #: Whether the bus has taken my frames of late; the shell knows.
        self.is_acknowledged = True
        self._own_number = OwnNumber(machine.node_id, self.tokens, self.mirror)
        estimator = factory.estimator(site, machine, self.mirror)
        self.negotiation = Negotiation(
            machine.node_id,
            machine.kind,
            site.timing,
            estimator,
            boot=boot,
            slot=slot_of(site, machine.node_id),
        )
        self.fleet = Fleet(site, machine, self.tokens, self.mirror, self.negotiation, entries, self.drops)
        self.behaviour: Behaviour = factory.behaviour(self.fleet, estimator)
        self.witness = Witness(self.tokens, self.mirror, boot, self._has_past, self._statements, self.presence.halts)
        self.rights = Rights(self.fleet, self._may_grant, self.witness)
        self.regeneration = Regenerating(self.tokens, lambda: self.mirror.cars, self._statements, self._thaw)
        self.regeneration.cars_told = self.fleet.cars_told
        self.regeneration.replay(entries)
        self.rights.is_frozen = lambda: self.regeneration.is_frozen
        self._heartbeat_due_us: int | None = None
        self._bus_time_due_us: int | None = None
        self._bus_time_lost = False
        self._sensed_early: dict[type[Message], Message] = {}
        # Each handler takes the class that it is listed under; Any is what a dispatch table costs.
        self._handlers: dict[type[Message], Callable[[Any, int], list[Effect]]] = {
            **self.rights.handlers(),
            **self.regeneration.handlers(),
            CallForProposals: self._negotiate,
            Bid: self._negotiate,
            Award: self._negotiate,
            TaskReport: self._negotiate,
            Itinerary: self._on_itinerary,
            Progress: self._on_progress,
            CarAt: self._on_car,
            Heartbeat: self._on_heartbeat,
            SyncRequest: self._on_sync_request,
            EmergencyStop: self._on_emergency_stop,
            Go: self._on_go,
            Halted: self._on_halted,
            Blocked: self._on_word,
            Clear: self._on_word,
        }

    # --- events in ---------------------------------------------------------------------------------------------

    def start(self, local_us: int) -> list[Effect]:
        """First effects after power-up: the boot counter to the journal, then the first heartbeat.

        Where the journal lacks what was once confirmed, the machine says so and holds: it cannot know its rights.
        """
        if not self.journal.is_reliable:
            return self._without_journal()
        # Bus time starts somewhere; the lowest fixed node's start is as good as any.
        self._elect_time_source(local_us)
        now_us = self.clock.bus_us(local_us)
        self._heartbeat_due_us = now_us
        effects: list[Effect] = [Record({"record": "boot", "boot": self.boot})]
        effects += self.behaviour.start(now_us)
        effects += self._beat(now_us)
        effects += self.witness.begin(now_us)
        return self._settle(effects, now_us)

    def _without_journal(self) -> list[Effect]:
        """Rights that were given away since would seem to be mine: none is used, and nothing is written."""
        why = f"{self.journal.why}; a person must regenerate its rights, or bring its own journal back"
        return self._halt(why, reason_of(self.journal))

    def listen(self, speakers: Speakers) -> None:
        """From now on only who may say a message, by the contract of the wire, is heard with it."""
        self.admission.speakers = speakers

    def receive(self, message: Message, local_us: int) -> list[Effect]:
        """A message of the fleet bus, received at ``local_us``."""
        now_us = self.clock.bus_us(local_us)
        if message.sender == self.node_id:
            return self._on_own_number(message, now_us)
        why = self.admission.why_not(message)
        if why is not Reason.NONE:
            return self._pass_over(message, why)
        self.holding.heard(now_us)
        if isinstance(message, BusTime):
            return self._on_bus_time(message, local_us)
        if self.holding.is_apart and not isinstance(message, _WHILE_APART):
            return []
        if message.sender in self.presence.foreign and not isinstance(message, _OF_FOREIGNERS):
            self.drops[self.presence.foreign[message.sender][0]] += 1
            return []
        effects = self._awake(now_us)
        self.presence.heard(message.sender, now_us)
        handler = self._handlers.get(type(message))
        effects += handler(message, now_us) if handler is not None else []
        if isinstance(message, Itinerary | Heartbeat):
            self.presence.heard(message.sender, now_us)
        effects = effects + self.behaviour.hear(message, now_us)
        return self._settle(effects, now_us)

    def _pass_over(self, message: Message, why: Reason) -> list[Effect]:
        """What its sender may not say is as if it had not been heard; who it is, people are told once."""
        self.drops[why] += 1
        if self.halted is not None or not self.admission.is_first(message.sender, why):
            return []
        return [Report(f"{type(message).__name__} of node {message.sender} passed over: {why.name}")]

    def sense(self, message: Message, local_us: int) -> list[Effect]:
        """A message of the machine's own device bus."""
        if not self.clock.is_set:
            # Plans made before bus time is known would be told in a time of one's own.
            self._sensed_early[type(message)] = message
            return []
        now_us = self.clock.bus_us(local_us)
        return self._settle(self._awake(now_us) + self.behaviour.sense(message, now_us), now_us)

    def wake(self, local_us: int) -> list[Effect]:
        """Do what has fallen due."""
        self._elect_time_source(local_us)
        now_us = self.clock.bus_us(local_us)
        effects = self._awake(now_us)
        effects += self._apply(self.holding.wake(now_us, acknowledged=self.is_acknowledged), now_us)
        effects += self.regeneration.wake(now_us)
        if not self.holding.is_apart:
            effects += self.witness.wake(now_us)
        if self._deals:
            effects += self.tokens.wake(now_us) + self.rights.serve_petitions(now_us)
        self._bus_time_lost = self.clock.is_lost(local_us)
        if self.presence.is_admitted(now_us):
            # What was planned before is old; the first word is that of a machine that takes part.
            self.fleet.admissions += 1
            self._heartbeat_due_us = now_us
        if not self._bus_time_lost and self._begins:
            effects += self._carry_out(self.negotiation.wake(now_us), now_us)
        effects += self._beat(now_us)
        return self._settle(effects, now_us)

    def next_wake(self) -> int | None:
        """Loop time in us at which ``wake`` is to be called, or None before ``start``."""
        times = [
            self._heartbeat_due_us,
            self._bus_time_due_us,
            self.holding.next_wake(),
            None if self.holding.is_apart else self.witness.next_wake(),
            self.regeneration.next_wake(),
            self.tokens.next_wake() if self._deals else None,
            self.rights.petition_due() if self._deals else None,
            self.presence.held_until_us,
            self._negotiation_due() if self._begins else None,
            self.behaviour.next_wake() if self._begins else None,
        ]
        due = [self.clock.local_us(time) for time in times if time is not None]
        return min(due) if due and self.halted is None else None

    def _awake(self, now_us: int) -> list[Effect]:
        """Whoever finds that it has slept is an obstacle first, says so, and asks what it has missed."""
        if self._heartbeat_due_us is None or not self.presence.awake(now_us):
            return []
        self._heartbeat_due_us = now_us + self.site.timing.heartbeat_us
        # One by one: all are asked at power-up only.
        asked = [effect for node in self.mirror.peers for effect in self.witness.ask(node)]
        return [Report("woke after a sleep"), Send(self._heartbeat()), *asked]

    def _on_bus_time(self, message: BusTime, local_us: int) -> list[Effect]:
        if message.sender in self.presence.foreign:
            return []
        if not self._is_time_source(message.sender):
            # At power-up every fixed machine speaks until it hears a lower one: that is no mistake.
            machine = self.site.machines.get(message.sender)
            if machine is None or machine.kind in MOBILE_KINDS:
                self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
                return []
            before_us = self.clock.bus_us(local_us)
            if self.clock.adopt(message.bus_time_us, local_us):
                self.witness.shift(self.clock.bus_us(local_us) - before_us)
                self._heartbeat_due_us = self._bus_time_due_us = self.clock.bus_us(local_us)
            return []
        if self.machine.kind not in MOBILE_KINDS and self.clock.refutes(message.bus_time_us, local_us):
            return [Send(BusTime(self.node_id, self.clock.bus_us(local_us) % BUS_TIME_MODULUS))]
        first = not self.clock.is_set
        self._bus_time_lost = False
        before_us = self.clock.bus_us(local_us)
        self.clock.heard(message.bus_time_us, local_us)
        self.witness.shift(self.clock.bus_us(local_us) - before_us)
        effects: list[Effect] = []
        if first:
            now_us = self.clock.bus_us(local_us)
            self._heartbeat_due_us = now_us
            for early in self._sensed_early.values():
                effects += self._settle(self.behaviour.sense(early, now_us), now_us)
            self._sensed_early.clear()
        return effects

    def _negotiation_due(self) -> int | None:
        """Nothing is due in the negotiation while bus time is lost: its deadlines mean nothing then."""
        # The last loop time is not known here; what ``wake`` found holds until the next time message.
        return None if self._bus_time_lost else self.negotiation.next_wake()

    def _is_time_source(self, sender: int) -> bool:
        """Whether bus time from ``sender`` counts: a fixed machine of the site, below me if I am one myself."""
        machine = self.site.machines.get(sender)
        if machine is None or machine.kind in MOBILE_KINDS:
            return False
        return self.machine.kind in MOBILE_KINDS or sender < self.node_id

    # --- handlers ----------------------------------------------------------------------------------------------

    def _negotiate(self, message: Message, now_us: int) -> list[Effect]:
        if isinstance(message, CallForProposals) and (why := self._may_not_bid(now_us)) is not Reason.NONE:
            self.drops[why] += 1
            return []
        return self._carry_out(self.negotiation.receive(message, now_us), now_us)

    def _may_not_bid(self, now_us: int) -> Reason:
        if self.clock.is_lost(self.clock.local_us(now_us)):
            return Reason.BUS_TIME_LOST
        if not self._begins or self.behaviour.state in (
            MachineState.OBSTACLE,
            MachineState.STOPPED,
            MachineState.STARTING,
        ):
            return Reason.POSITION_UNKNOWN
        return Reason.NONE

    def _on_itinerary(self, itinerary: Itinerary, now_us: int) -> list[Effect]:
        self.mirror.on_itinerary(itinerary, now_us)
        return self._carry_out(self.negotiation.receive(itinerary, now_us), now_us)

    def _on_progress(self, progress: Progress, now_us: int) -> list[Effect]:
        self.mirror.on_progress(progress)
        return []

    def _on_car(self, statement: CarAt, now_us: int) -> list[Effect]:
        if self.regeneration.is_frozen:
            self.regeneration.on_car(statement)
        else:
            self.mirror.on_car(statement)
        return []

    def _on_heartbeat(self, beat: Heartbeat, now_us: int) -> list[Effect]:
        news = self.regeneration.on_heartbeat(beat, now_us)
        reason = self._strange(beat)
        if reason is not Reason.NONE:
            self.drops[reason] += 1
            self.presence.heard_foreign(beat.sender, reason, now_us)
            return news
        self.presence.foreign.pop(beat.sender, None)
        self.presence.heard_beat(beat)
        fresh = self.mirror.on_heartbeat(beat, now_us)
        if fresh or (self.clock.is_source and beat.sender < self.node_id):
            self._elect_time_source(self.clock.local_us(now_us))
        return news + self.witness.on_heartbeat(beat, is_fresh=fresh)

    def _strange(self, beat: Heartbeat) -> Reason:
        """Why a machine's words do not count: another contract, another site, or rights of another epoch."""
        if beat.contract != CONTRACT_VERSION:
            return Reason.OTHER_CONTRACT
        if beat.site_digest != self.site.digest:
            return Reason.OTHER_SITE
        return Reason.NONE if beat.epoch == self.regeneration.epoch else Reason.OTHER_EPOCH

    def _on_sync_request(self, request: SyncRequest, now_us: int) -> list[Effect]:
        if request.whom not in (NOBODY, self.node_id):
            return []
        effects = self.witness.on_request(request, now_us)
        if self.clock.is_source:
            # Who asks may just have joined: it need not wait for the next period.
            effects = [Send(BusTime(self.node_id, now_us % BUS_TIME_MODULUS)), *effects]
        return effects

    def _statements(self, now_us: int) -> list[Effect]:
        return self.behaviour.statements(now_us) + self._blocked_again()

    def _on_word(self, word: Blocked | Clear, now_us: int) -> list[Effect]:
        """A segment is blocked, or clear again; what I am steward of is in my journal."""
        is_mine = self.site.stewards.get(word.track) == self.node_id
        if not self.mirror.on_word(word, now_us) or not is_mine:
            return []
        record = "blocked" if isinstance(word, Blocked) else "clear"
        return [Record({"record": record, "track": word.track, "index": word.index, "reason": int(word.reason)})]

    def _blocked_again(self) -> list[Effect]:
        tracks = [track for track, steward in self.site.stewards.items() if steward == self.node_id]
        return [Send(word) for word in self.mirror.obstacles.words(self.node_id, tracks)]

    def _on_emergency_stop(self, stop: EmergencyStop, now_us: int) -> list[Effect]:
        """From anybody: standing is always safe. It is no sign of life of its sender, who may be nobody of the site."""
        return self._apply(self.holding.stop(stop.sender, now_us), now_us)

    def _on_go(self, go: Go, now_us: int) -> list[Effect]:
        if go.stopper == self.node_id and self.holding.why.reason in RIGHTS_LOST:
            # To be let go gives no rights back: they are made anew.
            return []
        return self._apply(self.holding.go(go.stopper), now_us)

    def _on_halted(self, halted: Halted, now_us: int) -> list[Effect]:
        self.presence.heard_halted(halted, now_us)
        return []

    # --- holds -------------------------------------------------------------------------------------------------

    @property
    def _is_still(self) -> bool:
        """Whether this machine is an obstacle: it neither moves nor bids."""
        return self.presence.is_held or self.holding.is_held or self.regeneration.is_frozen

    @property
    def _deals(self) -> bool:
        """Whether this machine asks for rights and gives them away."""
        return not (self.holding.is_apart or self.regeneration.is_frozen)

    def _thaw(self, lost: int, now_us: int) -> list[Effect]:
        """Rights were made anew, or it was broken off: who lost its own begins as after a restart, all others look."""
        if lost not in (NOBODY, self.node_id):
            self.fleet.forgetful.add(lost)
        elif lost == self.node_id:
            self.witness.doubt, self.witness.has_past, self.fleet.has_no_rights = None, True, False
            self.fleet.slots_told = self.regeneration.slots()
            if self.holding.why.reason in RIGHTS_LOST:
                return self._apply(self.holding.go(self.node_id), now_us)
        self.presence.listen_anew(now_us)
        return self._words()

    @property
    def _begins(self) -> bool:
        """Whether this machine may begin anything: whoever was started again waits until all have answered."""
        return not (self._is_still or self.witness.is_waiting)

    def _on_own_number(self, message: Message, now_us: int) -> list[Effect]:
        """Somebody sends under my number: I hold, and take nothing in, until I know that nobody believed it."""
        self.drops[Reason.DUPLICATE_NODE_ID] += 1
        return self._apply(self.holding.own_frame(now_us, is_right=self._own_number.is_right(message)), now_us)

    def _may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Who is held gives no right away: it may be one that it does not have any more."""
        if self.holding.is_held or self.regeneration.is_frozen:
            return self.holding.why.reason if self.holding.is_held else Reason.REGENERATION
        return self.behaviour.may_grant(key, requester, now_us)

    def _apply(self, outcome: Outcome, now_us: int) -> list[Effect]:
        """What follows from an event of the holds."""
        match outcome:
            case Outcome.HOLDS:
                reason, cause, needs_person = self.holding.why
                told = f"held: {reason.name}, by node {cause}" + (", a person must decide" if needs_person else "")
                is_lasting = self.holding.hold is Hold.PERSON
                effects: list[Effect] = [Record(self.holding.record())] if is_lasting else []
                return [*effects, Report(told), *self._words()]
            case Outcome.GOES_ON:
                self.presence.listen_anew(now_us)
                return [Report("goes on"), *self._words()]
            case Outcome.COMES_BACK:
                return self._come_back(now_us)
            case _:
                return []

    def _come_back(self, now_us: int) -> list[Effect]:
        """As after a restart: under a new boot counter, and all are asked what they know before any right is used."""
        self.boot = self.witness.boot = self.boot % 255 + 1
        self.presence.listen_anew(now_us)
        records: list[Effect] = [Record(self.holding.record()), Record({"record": "boot", "boot": self.boot})]
        told = Report("comes back: nobody sends under its number any more")
        return [*records, told, *self._words(), *self.witness.begin(now_us)]

    def _words(self) -> list[Effect]:
        """My sign of life, and why I do not act where I do not."""
        held: list[Effect] = [Send(self.holding.word(self.boot))] if self.holding.is_held else []
        return [Send(self._heartbeat()), *held]

    def last_word(self, reason: Reason) -> Halted:
        """What is said before the process ends: ``reason`` where none was given before."""
        if self.holding.hold is not Hold.HALTED:
            self.holding.halt(reason)
        return self.holding.word(self.boot)

    # --- inner works -------------------------------------------------------------------------------------------

    def _settle(self, effects: list[Effect], now_us: int) -> list[Effect]:
        """Let the machine go on until it waits for something; bounded, as each round must come from the one before."""
        effects = effects + self._doubts()
        if self.halted is not None:
            return [effect for effect in effects if isinstance(effect, Report | Halt)]
        for _ in range(MAX_ROUNDS if self._begins else 0):
            more = self.behaviour.advance(now_us)
            if not more:
                break
            effects = effects + more
        else:
            if self._begins:
                effects = effects + self._halt("the machine's steps do not come to rest", Reason.RUNAWAY)
        self._own_number.note(effects)
        return effects

    def _doubts(self) -> list[Effect]:
        """Somebody knows that the journal is old: nothing of it is used any more."""
        doubt = self.witness.doubt
        if doubt is None or self.holding.why.reason in RIGHTS_LOST:
            return []
        self.fleet.has_no_rights = True
        held = self._apply(self.holding.for_person(doubt.reason, doubt.cause), self._heartbeat_due_us or 0)
        return [Report(doubt.text), *held]

    def _carry_out(self, outcome: list[Effect | NegotiationEvent], now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        for item in outcome:
            if isinstance(item, EVENT_TYPES):
                effects += self.behaviour.negotiated(item, now_us)
            else:
                effects.append(item)
        return effects

    def _beat(self, now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        if self._heartbeat_due_us is not None and self._heartbeat_due_us <= now_us:
            self._heartbeat_due_us = now_us + self.site.timing.heartbeat_us
            self.presence.review(now_us)
            effects += self._words() + self._diagnostics() + self.fleet.forgotten()
            effects += [Send(word) for word in self.presence.halted_ones(now_us)]
        if self._bus_time_due_us is not None and self._bus_time_due_us <= now_us:
            self._bus_time_due_us = now_us + self.site.timing.bus_time_us
            effects.append(Send(BusTime(self.node_id, now_us % BUS_TIME_MODULUS)))
        return effects

    def _heartbeat(self) -> Heartbeat:
        return Heartbeat(
            self.node_id,
            CONTRACT_VERSION,
            self.site.digest,
            self.mirror.digest(),
            self.boot,
            self.machine.kind,
            MachineState.OBSTACLE if self._is_still else self.behaviour.state,
            self.regeneration.epoch,
        )

    def _elect_time_source(self, local_us: int) -> None:
        """The lowest live fixed node sends bus time (design, section 5)."""
        if self.machine.kind in MOBILE_KINDS:
            return
        now_us = self.clock.bus_us(local_us)
        lower = [
            node
            for node in self.mirror.alive(now_us)
            if node < self.node_id and self.mirror.peers[node].kind not in (*MOBILE_KINDS, KindCode.OBSERVER)
        ]
        if lower:
            self.clock.follow(local_us)
            self._bus_time_due_us = None
            return
        self.clock.lead(local_us)
        if self._bus_time_due_us is None:
            self._bus_time_due_us = now_us

    def _halt(self, why: str, reason: Reason, cause: int = NOBODY) -> list[Effect]:
        if self.halted is not None:
            return []
        self.halted = why
        self.holding.halt(reason, cause)
        return [Halt(why, reason)]

    def _diagnostics(self) -> list[Effect]:
        """One message for each reason whose count has grown, so that the bus itself shows what was dropped and why."""
        totals = self.drops + self.wire_drops
        grown = [reason for reason in sorted(totals) if totals[reason] != self._told_drops[reason]]
        self._told_drops = totals
        return [Send(Diagnostic(self.node_id, reason, totals[reason] & 0xFFFFFFFF)) for reason in grown]
