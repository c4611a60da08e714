"""The holon: a value that eats messages and timers and returns effects. It owns no task, socket or clock.

``receive`` (fleet bus), ``sense`` (device bus) and ``wake`` take the machine's loop time in us; ``next_wake`` tells
when to call ``wake`` again. Inside, all times are bus time. You can drive one from a Python prompt.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from onboard.core.authority import TokenBook, TokenKey
from onboard.core.behaviour import Behaviour, BehaviourFactory, Fleet
from onboard.core.bus_time import BUS_TIME_MODULUS, BusClock
from onboard.core.codes import CONTRACT_VERSION, MOBILE_KINDS, NOBODY, KindCode, MachineState, Reason
from onboard.core.effects import Effect, Halt, Record, Report, Send
from onboard.core.holding import Hold, Holding
from onboard.core.holds import Holds
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
    LeftOut,
    Message,
    Progress,
    SyncRequest,
    TaskReport,
)
from onboard.core.mirror import Mirror
from onboard.core.negotiation import EVENT_TYPES, Negotiation, NegotiationEvent, slot_of
from onboard.core.own_number import OwnNumber
from onboard.core.presence import Presence
from onboard.core.recovery_messages import Go, Halted
from onboard.core.rights import Rights
from onboard.core.serial import is_newer
from onboard.core.site import Machine, Site

#: A mirror that differs from a peer's for this many heartbeats in a row asks for the missing versions.
DIGEST_PATIENCE = 2
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
    ) -> None:
        self.site = site
        self.machine = machine
        self.node_id = machine.node_id
        self.boot = boot
        self.halted: str | None = None
        #: Input dropped here, and below by the shell's decoders and queues, by reason.
        self.drops: Counter[Reason] = Counter()
        self.wire_drops: Counter[Reason] = Counter()
        self._told_drops: Counter[Reason] = Counter()
        self.clock = BusClock(site.timing.bus_time_us)
        self.tokens = TokenBook(site, machine.node_id)
        entries = tuple(entries)
        self.tokens.replay(entries)
        self._has_past = any(entry.get("record") == "boot" for entry in entries)
        self.tokens.genesis_counts = self._has_past
        self._trust_at_us: int | None = None
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
        own = OwnNumber(machine.node_id, self.tokens, self.mirror)
        self.holds = Holds(self.holding, self.presence, own, self.drops, self._heartbeat, self._new_life)
        estimator = factory.estimator(site, machine, self.mirror)
        self.negotiation = Negotiation(
            machine.node_id,
            machine.kind,
            site.timing,
            estimator,
            boot=boot,
            slot=slot_of(site, machine.node_id),
            is_obstacle=self.mirror.obstacles.machines.__contains__,
        )
        self.fleet = Fleet(site, machine, self.tokens, self.mirror, self.negotiation, entries, self.drops)
        self.behaviour: Behaviour = factory.behaviour(self.fleet, estimator)
        self.rights = Rights(self.fleet, self._may_grant)
        self._heartbeat_due_us: int | None = None
        self._bus_time_due_us: int | None = None
        self._mismatches: Counter[int] = Counter()
        self._bus_time_lost = False
        self._sensed_early: dict[type[Message], Message] = {}
        # Each handler takes the class that it is listed under; Any is what a dispatch table costs.
        self._handlers: dict[type[Message], Callable[[Any, int], list[Effect]]] = {
            **self.rights.handlers(),
            CallForProposals: self._negotiate,
            Bid: self._negotiate,
            Award: self._negotiate,
            TaskReport: self._negotiate,
            LeftOut: self._negotiate,
            Itinerary: self._on_itinerary,
            Progress: self._on_progress,
            CarAt: self._on_car,
            Heartbeat: self._on_heartbeat,
            SyncRequest: self._on_sync_request,
            EmergencyStop: self._on_emergency_stop,
            Go: self.holds.on_go,
            Halted: self.holds.on_halted,
            Blocked: self._on_word,
            Clear: self._on_word,
        }

    # --- events in ---------------------------------------------------------------------------------------------

    def start(self, local_us: int) -> list[Effect]:
        """First effects after power-up: the boot counter to the journal, then the first heartbeat."""
        if not self._has_past:
            # A first life, or a lost journal: peers that knew an earlier one have so long to say so.
            self._trust_at_us = local_us + self.site.timing.heartbeat_us
        # Bus time starts somewhere; the lowest fixed node's start is as good as any.
        self._elect_time_source(local_us)
        now_us = self.clock.bus_us(local_us)
        self._heartbeat_due_us = now_us
        effects: list[Effect] = [Record({"record": "boot", "boot": self.boot})]
        effects += self.behaviour.start(now_us)
        effects += self._beat(now_us)
        effects.append(Send(SyncRequest(self.node_id, NOBODY)))
        return self._settle(effects, now_us)

    def receive(self, message: Message, local_us: int) -> list[Effect]:
        """A message of the fleet bus, received at ``local_us``."""
        if isinstance(message, BusTime):
            return self._on_bus_time(message, local_us)
        now_us = self.clock.bus_us(local_us)
        if message.sender == self.node_id:
            return self.holds.on_own_number(message, now_us)
        self.holding.heard(now_us)
        if self.holding.is_apart and not isinstance(message, _WHILE_APART):
            return []
        if message.sender in self.presence.foreign and not isinstance(message, _OF_FOREIGNERS):
            self.drops[self.presence.foreign[message.sender][0]] += 1
            return []
        effects = self._awake(now_us)
        self.presence.standing.hear(message, now_us)
        self.presence.heard(message.sender, now_us)
        handler = self._handlers.get(type(message))
        effects += handler(message, now_us) if handler is not None else []
        if isinstance(message, Itinerary | Heartbeat):
            self.presence.heard(message.sender, now_us)
        effects = effects + self.behaviour.hear(message, now_us)
        return self._settle(effects, now_us)

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
        if self._trust_at_us is not None and self._trust_at_us <= local_us:
            self._trust_at_us = None
            self.tokens.trust_genesis()
        now_us = self.clock.bus_us(local_us)
        effects = self._awake(now_us)
        effects += self.holds.apply(self.holding.wake(now_us, acknowledged=self.is_acknowledged), now_us)
        if not self.holding.is_apart:
            effects += self.tokens.wake(now_us) + self.rights.serve_petitions(now_us)
        self._bus_time_lost = self.clock.is_lost(local_us)
        if self.presence.is_admitted(now_us):
            # What was planned before is old; the first word is that of a machine that takes part.
            self.fleet.admissions += 1
            self._heartbeat_due_us = now_us
        if not self._bus_time_lost and not self._is_still:
            effects += self._carry_out(self.negotiation.wake(now_us), now_us)
        effects += self._beat(now_us)
        return self._settle(effects, now_us)

    def next_wake(self) -> int | None:
        """Loop time in us at which ``wake`` is to be called, or None before ``start``."""
        times = [
            self._heartbeat_due_us,
            self._bus_time_due_us,
            self.holding.next_wake(),
            None if self.holding.is_apart else self.tokens.next_wake(),
            None if self.holding.is_apart else self.rights.petition_due(),
            self.presence.held_until_us,
            None if self._is_still else self._negotiation_due(),
            None if self._is_still else self.behaviour.next_wake(),
        ]
        due = [self.clock.local_us(time) for time in times if time is not None]
        if self._trust_at_us is not None:
            due.append(self._trust_at_us)
        return min(due) if due and self.halted is None else None

    def _awake(self, now_us: int) -> list[Effect]:
        """Whoever finds that it has slept is an obstacle first, says so, and asks what it has missed."""
        if self._heartbeat_due_us is None or not self.presence.awake(now_us):
            return []
        self._heartbeat_due_us = now_us + self.site.timing.heartbeat_us
        # One by one: all are asked at power-up only.
        asked: list[Effect] = [Send(SyncRequest(self.node_id, node)) for node in self.mirror.peers]
        return [Report("woke after a sleep"), Send(self._heartbeat()), *asked]

    def _on_bus_time(self, message: BusTime, local_us: int) -> list[Effect]:
        if message.sender == self.node_id:
            return self.holds.on_own_number(message, self.clock.bus_us(local_us))
        self.holding.heard(self.clock.bus_us(local_us))
        if message.sender in self.presence.foreign:
            return []
        if not self._is_time_source(message.sender):
            # At power-up every fixed machine speaks until it hears a lower one: that is no mistake.
            machine = self.site.machines.get(message.sender)
            if machine is None or machine.kind in MOBILE_KINDS:
                self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            elif self.clock.adopt(message.bus_time_us, local_us):
                self._heartbeat_due_us = self._bus_time_due_us = self.clock.bus_us(local_us)
            return []
        if self.machine.kind not in MOBILE_KINDS and self.clock.refutes(message.bus_time_us, local_us):
            return [Send(BusTime(self.node_id, self.clock.bus_us(local_us) % BUS_TIME_MODULUS))]
        first = not self.clock.is_set
        self._bus_time_lost = False
        self.clock.heard(message.bus_time_us, local_us)
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
        if self._is_still or self.behaviour.state in (
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
        self.mirror.on_car(statement)
        return []

    def _on_heartbeat(self, beat: Heartbeat, now_us: int) -> list[Effect]:
        if beat.contract != CONTRACT_VERSION or beat.site_digest != self.site.digest:
            reason = Reason.OTHER_CONTRACT if beat.contract != CONTRACT_VERSION else Reason.OTHER_SITE
            self.drops[reason] += 1
            self.presence.heard_foreign(beat.sender, reason, now_us)
            return []
        self.presence.foreign.pop(beat.sender, None)
        self.presence.heard_beat(beat)
        fresh = self.mirror.on_heartbeat(beat, now_us)
        if fresh or (self.clock.is_source and beat.sender < self.node_id):
            self._elect_time_source(self.clock.local_us(now_us))
        if self.holding.is_apart:
            return []
        if fresh:
            return [Send(SyncRequest(self.node_id, beat.sender, self.mirror.boots_before[beat.sender]))]
        if beat.mirror_digest == self.mirror.digest():
            del self._mismatches[beat.sender]
            return []
        self._mismatches[beat.sender] += 1
        if self._mismatches[beat.sender] < DIGEST_PATIENCE:
            return []
        del self._mismatches[beat.sender]
        return [Send(SyncRequest(self.node_id, beat.sender))]

    def _on_sync_request(self, request: SyncRequest, now_us: int) -> list[Effect]:
        if request.whom not in (NOBODY, self.node_id):
            return []
        if request.whom == self.node_id and self._has_forgotten(request):
            return self._halt(
                f"the journal is lost or old: node {request.sender} knew this node under boot {request.boot_before}; "
                "a person must regenerate its tokens",
                Reason.JOURNAL_LOST,
                request.sender,
            )
        effects = self.behaviour.statements(now_us) + self._blocked_again()
        known = self.mirror.peers.get(request.sender)
        if (
            request.whom == NOBODY
            and known is not None
            and known.since_us + self.site.timing.heartbeat_us // 2 < now_us
        ):
            # All are asked at power-up only: I knew it before, even where its counter is the same again.
            effects.append(Send(SyncRequest(self.node_id, request.sender, known.boot)))
        if self.clock.is_source:
            # Who asks may just have joined: it need not wait for the next period.
            effects = [Send(BusTime(self.node_id, now_us % BUS_TIME_MODULUS)), *effects]
        return effects

    def _has_forgotten(self, request: SyncRequest) -> bool:
        """Whether my journal lacks a life that a peer knew: tokens that I gave away then would seem to be mine."""
        before = request.boot_before
        if before == 0 or request.sender not in self.site.machines:
            return False
        return not self._has_past or is_newer(before, self.boot, 8)

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
        why = f"emergency stop from node {stop.sender}: {stop.reason.name}"
        return self._halt(why, Reason.EMERGENCY_STOP, stop.sender)

    # --- holds -------------------------------------------------------------------------------------------------

    @property
    def _is_still(self) -> bool:
        """Whether this machine is an obstacle: it neither moves nor bids."""
        return self.presence.is_held or self.holding.is_held

    def _may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Who is held gives no right away: it may be one that it does not have any more."""
        if self.holding.is_held:
            return self.holding.why.reason
        return self.behaviour.may_grant(key, requester, now_us)

    def _new_life(self) -> int:
        """As after a restart."""
        self.boot = self.boot % 255 + 1
        self._has_past = True
        return self.boot

    def last_word(self, reason: Reason) -> Halted:
        """What is said before the process ends: ``reason`` where none was given before."""
        if self.holding.hold is not Hold.HALTED:
            self.holding.halt(reason)
        return self.holding.word(self.boot)

    # --- inner works -------------------------------------------------------------------------------------------

    def _settle(self, effects: list[Effect], now_us: int) -> list[Effect]:
        """Let the machine go on until it waits for something; bounded, as each round must come from the one before."""
        if self.halted is not None:
            return [effect for effect in effects if isinstance(effect, Report | Halt)]
        for _ in range(0 if self._is_still else MAX_ROUNDS):
            more = self.behaviour.advance(now_us)
            if not more:
                break
            effects = effects + more
        else:
            if not self._is_still:
                effects = effects + self._halt("the machine's steps do not come to rest", Reason.RUNAWAY)
        self.holds.own.note(effects)
        return effects

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
            effects += self.holds.words() + self._diagnostics()
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
        return [Halt(why)]

    def _diagnostics(self) -> list[Effect]:
        """One message for each reason whose count has grown, so that the bus itself shows what was dropped and why."""
        totals = self.drops + self.wire_drops
        grown = [reason for reason in sorted(totals) if totals[reason] != self._told_drops[reason]]
        self._told_drops = totals
        return [Send(Diagnostic(self.node_id, reason, totals[reason] & 0xFFFFFFFF)) for reason in grown]
