"""Driving along a track under authority: ask for segments ahead, order the drive as far as they are held, give back.

The drive's target is always the centre of the last segment of an unbroken line of held ones, so the machine can stop
inside its authority at any moment; orders are repeated only while ``authorised`` still agrees, and a drive that hears
nothing brakes by itself.

Through a mouth a carrier turns into another track (``placing``), and needs the mouth's slot and the one inside first.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import takewhile

from onboard.contract.codes import DriveMode, Reason, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import DriveOrder, DriveState, Progress, Waiting
from onboard.core.authority import TokenKey, segment_token
from onboard.core.effects import Effect, Send
from onboard.core.motion_authority import ALONE, Permit, authorised
from onboard.core.serial import successor
from onboard.core.site import Segment
from onboard.systems.car_park.axis import TrackAxis
from onboard.systems.car_park.placing import Placing
from onboard.systems.car_park.sill import SillProof
from onboard.systems.car_park.stall import MOVES, PlaceWords, Stall, carrier_silence_us
from onboard.systems.car_park.way import line_to_refuge
from onboard.ways.all_or_none import AllOrNone
from onboard.ways.kinematics import run_duration_us
from onboard.ways.left_behind import LeftBehind
from onboard.ways.lifts import GATE_INDEX, MARK_TOLERANCE_MM, gate, platform
from onboard.ways.mirror import WayFleet, slot_of
from onboard.ways.site import TrackKind

#: A holder's view of the order that has differed from mine for this long will not be mended by asking again, us:
#: several answers have come and gone.
ORDER_PATIENCE_US = 5_000_000
#: Slots that are asked for at once beyond those that are needed soon: a run is one request, one grant and one answer.
#: Not the front of a compartment: who gets stuck before it would close it.
MORE_AHEAD = 4


@dataclass
class Carriage:
    """The carrier of one robot: its sensed position, its drive orders and the segments around it."""

    fleet: WayFleet
    track: int
    #: As last told by the drive, its position on the axis in hand.
    sensed: DriveState | None = None
    goal: Segment | None = None
    sequence: int = 0
    target: Segment | None = None
    refresh_at_us: int | None = None
    blocked: Segment | None = None
    stopped: bool = False
    #: Where the drive was sent, by the order's sequence, since the one that it goes by: whatever the goal is by now.
    _sent: dict[int, Segment] = field(default_factory=dict)
    _told: PlaceWords[Segment] = field(default_factory=PlaceWords)
    #: What ``advance`` looked at when it last found nothing to do.
    _settled: tuple[object, ...] | None = None
    #: What permitted the last order.
    _permit: Permit | None = None
    #: Where the carrier stood by the last word of its sensors, on which track and after which order.
    _stood: tuple[DriveState | None, tuple[int, int], Segment | None] | None = None
    #: Slots behind the goal up to the next refuge, for a way without an agreed order; the robot knows its next legs.
    route_ahead: Callable[[], list[Segment]] = list
    #: Version of the itinerary as told, and the leg of it in hand.
    in_hand: Callable[[], tuple[int, int]] = lambda: (0, 0)
    #: Whether nothing stands out of the carrier, by its sensors: it gets no order to move else (row P32).
    is_clear: Callable[[], bool] = lambda: True
    whole: AllOrNone = field(init=False)
    left: LeftBehind = field(init=False)
    #: Whether the goal is another than when what was left was given back last.
    _turned: bool = False
    sill: SillProof = field(init=False)
    stall: Stall = field(init=False)
    placing: Placing = field(init=False)

    def __post_init__(self) -> None:
        self.placing, self.whole = Placing(self.fleet.site), AllOrNone(self.fleet.tokens)
        self.stall = Stall(silence_us=carrier_silence_us(self.fleet.site))
        self.left = LeftBehind(self.fleet)
        self.sill = SillProof(self.fleet)

    @property
    def axis(self) -> TrackAxis:
        """The track that the carrier is on, turns into or comes out of."""
        return self.placing.axis(self.track)

    @property
    def standing_at(self) -> Segment | None:
        """The position at whose mark the carrier stands still, or None while it moves or stands between marks.

        Both must say so: the measured way, which tells the marks apart, and the fine sensor, which sees one (row P34).

        On a lift's platform it is index 0 or length + 1 of the alley; so it is turned in a mouth, of the track inside.
        """
        now = (self.track, self.sequence)
        if self._stood is None or self._stood[0] is not self.sensed or self._stood[1] != now:
            self._stood = (self.sensed, now, self._mark())
        return self._stood[2]

    def run_us(self, there: Segment) -> int:
        """How long a run to ``there`` on its track takes from the mark where it stands, us; 0 while it moves."""
        here = self.standing_at
        if here is None or here.track != there.track:
            return 0
        pitch_mm = self.fleet.site.tracks[here.track].pitch_mm
        return run_duration_us(abs(there.index - here.index) * pitch_mm, self.fleet.site.carrier)

    def _mark(self) -> Segment | None:
        state = self.sensed
        if state is None or state.mode is not DriveMode.STANDING or not state.at_mark:
            return None
        if state.sequence != self.sequence:
            # It has not taken up the last order yet, and may still go by it.
            return None
        index = self.axis.index_at(state.position_mm)
        off_mm = abs(state.position_mm - self.axis.position_mm(index))
        return Segment(self.track, index) if off_mm <= MARK_TOLERANCE_MM else None

    @property
    def nearest(self) -> Segment:
        """The position with the nearest mark at which a plan can begin. Raises ``ValueError`` where none is known."""
        if self.sensed is None:
            raise ValueError("no position is known yet")
        index = self.axis.index_at(self.sensed.position_mm)
        return self.axis.mouths.get(index) or Segment(self.track, index)

    @property
    def way_out(self) -> Segment | None:
        """The alley's position beside the sill that the body is across, where its lift is an obstacle; else None.

        The gate in hand keeps the lift where the body came from: that way it can always leave, and aboard it cannot.
        """
        obstacles, site = self.fleet.mirror.obstacles.machines, self.fleet.site
        here = self.occupied()
        lifts = {slot.track for slot in here if slot.index == GATE_INDEX and slot.track in site.lifts}
        if not any(site.stewards[lift] in obstacles for lift in lifts):
            return None
        return next((slot for slot in here if slot.track == self.track), None)

    @property
    def arrived(self) -> bool:
        """Whether the carrier stands at its goal."""
        return self.goal is not None and self.standing_at == self.goal

    def ride_to(self, floor: int) -> None:
        """The platform under the carrier has come to another floor: the same position on another alley."""
        self.sensed = self.placing.ridden(self.sensed, self.track, floor)
        self.track = floor
        self._sent.clear()
        self.goal = self.target = None
        self._told.last = (None, False, 0)

    def occupied(self) -> list[Segment]:
        """Slots that the body is in now, with the gate where it is across a sill; empty where it is unknown."""
        return [] if self.sensed is None else self.placing.slots(self.sensed, self.track)

    def sense(self, state: DriveState, now_us: int) -> list[Effect]:
        """Take up the drive's state: tell the fleet where the body stops, and now and then where it has come to."""
        if self.placing.is_far_off(state, self.track):
            self.fleet.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            return []
        turn_us = self.fleet.site.carrier_turn_us if state.mode is DriveMode.TURNING else 0
        self.stall.sensed(state.position_mm, now_us, turn_us)
        if self.sensed is None:
            self.sequence = state.sequence
        self.track, placed = self.placing.placed(state, self.track, self.goal)
        self.sensed = placed
        if placed is None:
            # Turned into some spur, but nobody remembers which.
            return []
        self._face()
        now, known = self._progress(), self.fleet.mirror.progress.get(self.fleet.node_id)
        here = Segment(now.track, now.index)
        is_news = self._told.is_news(here, placed.mode, now_us)
        if placed.mode is DriveMode.STANDING and self._told.slots and not self._told.slots.issuperset(self.occupied()):
            # Pushed: it asks for that too, also where it does nothing any more.
            return self.statement(now_us) + self.claim(now_us)
        if is_news:
            return self.statement(now_us)
        if known is not None and here != (known.track, known.index):
            # It counts for me before others hear it: I give what lies behind to who asks.
            self.fleet.mirror.on_progress(now)
        return []

    def statement(self, now_us: int) -> list[Effect]:
        """Where the body is, in the leg in hand of the itinerary as told; nothing where no position is known.

        A journal that is lost knew the track, which the drive does not know: who makes its rights anew tells it.
        """
        if self.sensed is None or self.fleet.has_no_rights or self.fleet.slots_told:
            return []
        progress = self._progress()
        self._told.last = (Segment(progress.track, progress.index), self.sensed.mode in MOVES, now_us)
        self._told.slots = {*self.occupied()}
        self.fleet.mirror.on_progress(progress)
        return [Send(progress)]

    def _progress(self) -> Progress:
        assert self.sensed is not None
        (track, index), offset_mm = self.placing.told(self.sensed, self.track)
        return Progress(self.fleet.node_id, *self.in_hand(), track, index, offset_mm, self.sensed.speed_mm_s)

    def go(self, goal: Segment, *, waits: bool = False) -> None:
        """Set the goal; ``advance`` does the rest. Who ``waits`` there by its plan wants nothing beyond for now."""
        if waits or goal not in self.whole.slots:
            self.whole.end()
        if goal != self.goal:
            self.goal = goal
            self._turned = True
            self.target = self.blocked = None
            self._face()

    def _face(self) -> None:
        """Take the axis in hand that leads to the goal, also for who was pushed out of the mouth and is back in it."""
        if self.sensed is not None and self.goal is not None and self.goal.track != self.track:
            self.track, self.sensed = self.placing.faced(self.sensed, self.track, self.goal)

    def stay(self) -> None:
        """Drop the goal: the drive gets no more orders, and brakes by itself where it moves."""
        self.goal = self.target = self.blocked = self.refresh_at_us = None
        self.stall.rests()
        self.whole.end()

    def advance(self, now_us: int) -> list[Effect]:
        """Ask for the segments ahead, extend the drive's target as far as they are held, and repeat its order."""
        asking_us, outlook = self._asks_at_us(), self._outlook()
        if self._settled == outlook and (asking_us is None or now_us < asking_us):
            return self._go_on_as_before(now_us)
        effects = self._go_on(now_us)
        self._settled = None if effects else self._outlook()
        return effects

    def _go_on_as_before(self, now_us: int) -> list[Effect]:
        """Nothing has changed since nothing was to be done: at most the order is repeated, while it is permitted."""
        if self.refresh_at_us is None or now_us < self.refresh_at_us:
            return []
        permit = self._permit.again() if self._permit is not None else None
        return self._order(permit, now_us) if permit else self._go_on(now_us)

    def _outlook(self) -> tuple[object, ...]:
        """All that decides what is to be done, but the time: each message on the bus asks, and few change anything."""
        words = [self.sill.word(lift) for lift in self.axis.lifts]
        seen = self.fleet.tokens.changes, self.fleet.mirror.obstacles.changes, self.whole.slots, *words
        return self.sensed, self.goal, self.target, self.track, self.stopped, self.is_clear(), *seen

    def _go_on(self, now_us: int) -> list[Effect]:
        if self.goal is None or self.sensed is None or self.arrived:
            return self._rest(now_us)
        if not self.is_clear():
            self.refresh_at_us = self.target = None
            self.stall.rests()
            return []
        ahead = self._ahead()
        effects = self._return_left(now_us) if self._turned else []
        effects += self.claim(now_us) + self._ask(ahead, now_us) + self._ask_lifts(ahead, now_us)
        reach, permit, reason = self._reach(ahead)
        if self.whole.slots and not self.whole.is_complete:
            reach, reason = None, Reason.NOT_AUTHORISED
        if reach is None:
            effects += self._hold(ahead, reason)
            return effects + (self._return_left(now_us) if self._open(ahead) == ahead else self._give_back(now_us))
        if reach != self.target:
            self.target = reach
            self.sequence = successor(self.sequence, 8)
            return [*effects, *self._order(permit, now_us)]
        if self.refresh_at_us is not None and self.refresh_at_us <= now_us:
            effects += self._order(permit, now_us)
        return effects + self._give_back(now_us)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """What was left goes on at once, and what is not in use while it stands; all else goes back by itself."""
        stands = self.target is None and self.sensed is not None and self.sensed.mode is DriveMode.STANDING
        is_used = not stands or slot_of(key) in {*self.occupied(), *self._may_come_to()}
        return self.left.may_grant(key, requester, now_us, is_used=is_used)

    def next_wake(self) -> int | None:
        """When the drive's order is to be repeated, or something is to be done about missing tokens."""
        due = [time for time in (self._asks_at_us(), self.refresh_at_us) if time is not None]
        return min(due, default=None)

    def _asks_at_us(self) -> int | None:
        """When something is to be done about missing tokens, while it is on its way."""
        due = (self.whole.due_us, self._patience_over_us(), self.sill.next_wake(), self.left.due_us)
        if not any(due) or self.goal is None or self.sensed is None or self.arrived or not self.is_clear():
            return None
        return min(time for time in due if time is not None)

    def _ask(self, ahead: list[int], now_us: int) -> list[Effect]:
        """Ask for the segments ahead; all of them to the next refuge where the order of passing cannot be agreed."""
        over_us = self._patience_over_us()
        if over_us is not None and over_us <= now_us:
            self.whole.begin(self._way_to_refuge(ahead), now_us)
        self.whole.passed(self.occupied())
        if self.whole.slots:
            return self.whole.advance(self.occupied(), now_us)
        effects, tokens, soon = list[Effect](), self.fleet.tokens, self.axis.soon
        line = self.axis.rights(self._open(ahead))[: soon + MORE_AHEAD]
        if all(self._is_asked(slot) for slots in line[:soon] for slot in slots):
            return effects
        more = takewhile(self.left.fronts.isdisjoint, line[soon:])
        for slot in (slot for slots in (*line[:soon], *more) for slot in slots):
            effects += tokens.want(segment_token(slot), now_us)
        return effects

    def _is_asked(self, slot: Segment) -> bool:
        key = segment_token(slot)
        return key in self.fleet.tokens.wanted or self.fleet.tokens.holds(key)

    def _ask_lifts(self, ahead: list[int], now_us: int) -> list[Effect]:
        """Have the word of the lift at an end of this way while its gate is held; one that is elsewhere waits for us.

        Whoever is on the sill or the platform keeps them: it stands until the lift says that it may go on.
        """
        line = {slot for slots in self.axis.rights(ahead) for slot in slots}.union(self.occupied())
        lifts = [lift for lift in self.axis.lifts if gate(lift) in line]
        effects = self.sill.ask(lifts, now_us)
        for lift in lifts:
            if platform(lift) not in self.occupied():
                effects += self.sill.refuse(lift, self.track, now_us)
        return effects

    def _patience_over_us(self) -> int | None:
        """When to give up agreeing on an order with the holder of a wanted token, or None."""
        behind = self.fleet.tokens.behind_since_us
        return min(behind.values()) + ORDER_PATIENCE_US if behind and not self.whole.slots else None

    def _way_to_refuge(self, ahead: list[int]) -> tuple[Segment, ...]:
        return line_to_refuge(self.fleet.site, [self.axis.slot(index) for index in ahead], self.route_ahead)

    def _rest(self, now_us: int) -> list[Effect]:
        self.refresh_at_us = None
        if self.sensed is None or self.sensed.mode is not DriveMode.STANDING:
            return []
        self.target = self.blocked = None
        self.stall.rests()
        self.whole.passed(self.occupied())
        return self.claim(now_us) + self._give_back(now_us)

    def claim(self, now_us: int) -> list[Effect]:
        """Ask for what the body is in: pushed there by hand, or found there after a restart."""
        wanted = (self.fleet.tokens.want(segment_token(slot), now_us) for slot in self.occupied())
        return [effect for effects in wanted for effect in effects]

    def _ahead(self) -> list[int]:
        """Indices from where the body is to the goal, the goal included, in the order of travel."""
        assert self.goal is not None and self.sensed is not None
        here = self.axis.index_at(self.sensed.position_mm)
        # Out of this track the way on its axis ends in the mouth.
        there = self.goal.index if self.goal.track == self.track else self.placing.way_out(self.track, self.goal)
        step = 1 if there >= here else -1
        return list(range(here, there + step, step))

    def _open(self, ahead: list[int]) -> list[int]:
        """``ahead`` as far as the slot that I wait for, where its holder stands in it: it goes first beyond that."""
        slot = self.blocked
        holder = NOBODY if slot is None else self.fleet.tokens.holder_of(segment_token(slot))
        seen = self.fleet.mirror.progress.get(holder)
        if slot is None or holder == self.fleet.node_id or seen is None or (seen.track, seen.index) != slot:
            return ahead
        return ahead[: ahead.index(slot.index) + 1] if slot.track == self.track and slot.index in ahead else ahead

    def _reach(self, ahead: list[int]) -> tuple[Segment | None, Permit, Reason]:
        """The last position of the unbroken authorised line and what permits it, or None; and why it ends there."""
        is_out = self.goal is not None and self.goal == self.way_out
        own = Reason.OPERATOR if self.stopped else Reason.POSITION_UNKNOWN if self.sensed is None else Reason.NONE
        here = [slot for slot in self.occupied() if not self._leaves_to_another(slot, ahead)]
        permit = self._may_be_in(here, authorised(self.fleet.motion, ALONE, own), is_out=is_out)
        if not permit:
            return None, permit, permit.reason
        aside = self.placing.aside(self.sensed, self.track)
        if aside is not None:
            return aside, permit, Reason.NONE
        reach = None
        reason = Reason.NONE
        blocked = self.fleet.mirror.obstacles.blocked
        for index, slots in zip(ahead, self.axis.rights(ahead), strict=True):
            if reach is not None and any(slot in blocked for slot in slots):
                reason = Reason.IMPOSSIBLE
                break
            onward = self._may_be_in(slots, permit, is_out=is_out)
            reason = onward.reason
            if not onward:
                break
            reach, permit = Segment(self.track, index), onward
        if reach is not None and self._turns_back:
            return self.goal, permit, reason
        if reach is None or (reach == self.standing_at and reach != self.goal):
            return None, permit, reason
        return reach, permit, reason

    def _leaves_to_another(self, slot: Segment, ahead: list[int]) -> bool:
        """Whether it goes out of a slot that it was pushed to, and cannot have: who has the right stands in it too."""
        return self.fleet.is_shared(slot) and self.placing.leaves(slot, self.sensed, self.track, ahead[-1])

    def _may_be_in(self, slots: Iterable[Segment], permit: Permit, *, is_out: bool) -> Permit:
        """The permit for these slots too. Out of a sill, to the side from where the body came, nothing is proved."""
        for slot in slots:
            permit = authorised(self.fleet.motion, [segment_token(slot)], besides=permit)
            permit = permit if is_out or not permit else permit.unless(self.sill.lacks(slot, self.track))
        return permit

    @property
    def _turns_back(self) -> bool:
        """Whether the carrier is in the mouth of its track, and all that is left is to turn out of it."""
        state = self.sensed
        if state is None or self.goal is None or self.goal.track == self.track:
            return False
        end = self.placing.way_out(self.track, self.goal)
        is_at_mark = abs(state.position_mm - self.axis.position_mm(end)) <= MARK_TOLERANCE_MM
        return end in self.axis.mouths and state.mode in (DriveMode.STANDING, DriveMode.TURNING) and is_at_mark

    def _hold(self, ahead: list[int], reason: Reason) -> list[Effect]:
        """Say once for what the machine waits, for whom and why; no order is repeated, so the drive brakes."""
        self.refresh_at_us = None
        self.target = None
        self.stall.rests()
        tokens = self.fleet.tokens
        line = [slot for slots in self.axis.rights(ahead) for slot in slots]
        waits_for = next((slot for slot in line if not tokens.holds(segment_token(slot))), line[0])
        refused = segment_token(waits_for) in tokens.refused
        if self.blocked == waits_for or not refused:
            return []
        self.blocked = waits_for
        blocker = tokens.holder_of(segment_token(waits_for))
        return [Send(Waiting(self.fleet.node_id, waits_for.track, waits_for.index, blocker, reason))]

    def _order(self, permit: Permit, now_us: int) -> list[Effect]:
        assert self.target is not None
        self._permit = permit
        self._sent[self.sequence] = self.target
        self.stall.ordered(now_us)
        self.refresh_at_us = now_us + self.fleet.site.timing.drive_refresh_us
        site, target = self.fleet.site, self.target
        tape_mm, across = self.placing.tape_mm(target), site.across(target.track)
        order = DriveOrder(self.fleet.node_id, self.sequence, tape_mm, site.carrier.speed_mm_s, across)
        return permit.order(order)

    def _give_back(self, now_us: int) -> list[Effect]:
        """Return segments that the body has left and does not need again before its goal, once it says where it is.

        Aboard a lift the gate stays: returned, it lets the platform move, and that only a ride may ask for. Else a
        controller that starts again aboard would take the floor of its journal for the one where it is.
        """
        here = self.occupied()
        tracks = self.fleet.site.tracks
        gates = [gate(slot.track) for slot in here if tracks[slot.track].kind is TrackKind.LIFT]
        needed = {*here, *gates, *self.whole.slots, *self._may_come_to()}
        if self.goal is not None and not self.arrived:
            needed.update(slot for slots in self.axis.rights(self._open(self._ahead())) for slot in slots)
        tokens = self.fleet.tokens
        for key in [key for key in tokens.wanted if key.kind is TokenKind.SEGMENT]:
            if slot_of(key) not in needed:
                tokens.forget(key)
        free = [slot for slot in map(slot_of, self._held_segments()) if slot not in needed]
        is_under_way = self.goal is not None and not self.arrived and self.target is not None
        went = not set(self.left.slots) <= set(free)
        return self._after_place(self.left.give_back(free, now_us, is_under_way=is_under_way), now_us, went=went)

    def _return_left(self, now_us: int) -> list[Effect]:
        self._turned = False
        if not self.left.slots:
            return []
        return self._after_place(self.left.give_all({*self.occupied(), *self._may_come_to()}, now_us), now_us)

    def _after_place(self, given: list[Effect], now_us: int, *, went: bool = False) -> list[Effect]:
        """What is given back, or ``went`` to who asked, after the word that the body has left it."""
        has_left = self.sensed is not None and not (
            self.placing.told(self.sensed, self.track)[0] == self._told.last[0]
            and self._told.slots <= {*self.occupied()}
        )
        return [*self.statement(now_us), *given] if (given or went) and has_left else given

    def _may_come_to(self) -> set[Segment]:
        """Slots up to where the drive may still be on its way, and those in which it brakes; none where it stands."""
        state = self.sensed
        if state is None or (state.mode is DriveMode.STANDING and state.sequence == self.sequence):
            self._sent.clear()
            return set()
        while state.sequence in self._sent and next(iter(self._sent)) != state.sequence:
            del self._sent[next(iter(self._sent))]
        speed_mm_s, limits = state.speed_mm_s, self.fleet.site.carrier
        braking_mm = speed_mm_s * abs(speed_mm_s) // (2 * limits.acceleration_mm_s2)
        here, ends = self.axis.index_at(state.position_mm), [self.axis.index_at(state.position_mm + braking_mm)]
        ends += [sent.index for sent in self._sent.values() if sent.track == self.track]
        slots: set[Segment] = set()
        for end in ends:
            step = 1 if end >= here else -1
            slots.update(*self.axis.rights(list(range(here, end + step, step))))
        return slots

    def _held_segments(self) -> list[TokenKey]:
        tokens = self.fleet.tokens
        keys = [key for key in tokens.mine() if key.kind is TokenKind.SEGMENT]
        home = segment_token(self.fleet.machine.home)
        if home not in tokens.held and tokens.holds(home):
            keys.append(home)
        return keys
