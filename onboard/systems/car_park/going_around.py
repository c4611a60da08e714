"""Going around obstacles, and giving back what cannot be done (design, section 4 and 5; issue 4, point 3).

A plan that leads through an obstacle is made anew from where the carrier can turn; all others stay as they are. Where
there is no way for a while, tasks whose car was not touched are forfeited with a reason, the last one first, and called
for anew by their initiators. A task whose car is aboard is never given back: it waits until there is a way.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from onboard.contract.codes import Grade, LegAction, Reason, TaskPhase, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import CallForProposals, CarAt, Itinerary, Message, Reference, TaskReport, TokenGrant
from onboard.core.authority import segment_token, station_token
from onboard.core.effects import Effect, Report, Send
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey
from onboard.systems.car_park import custody
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.handling import ShuttleWork
from onboard.systems.car_park.kept_out import KeptOut
from onboard.systems.car_park.places import PlaceChoice
from onboard.systems.car_park.program import CarHandling, CarStep, HandlingPhase, Program, StationWork, to_itinerary
from onboard.systems.car_park.recovery import forfeited_record, sink_record
from onboard.systems.car_park.standoff import Standoff
from onboard.systems.car_park.travel import Carriage
from onboard.ways.lifts import gate, lift_at
from onboard.ways.mirror import WayFleet
from onboard.ways.occupancy import itinerary_windows
from onboard.ways.reservations import FOREVER, SlotWindow
from onboard.ways.retreats import put_off
from onboard.ways.tokens import car_token
from onboard.ways.told_way import BegunItinerary

#: A plan that finds no way is tried again after this, us: others' plans change within seconds.
RETRY_US = 3_000_000
#: A run that has not come to a stand is looked at again after this, us: braking takes so long.
LOOK_US = 500_000
#: Tasks are kept so long without a way, us: a machine that is only restarted is back by then.
KEEP_US = 12_000_000
#: FORFEITED is said again so often and so many times, until the task is called or awarded anew: a lost word would leave
#: a customer waiting.
SAY_AGAIN_US, SAY_AGAIN = 1_000_000, 20
#: Who makes room for another has so long until that goes on, us: as long as a run of ten positions.
ASIDE_US = 16_000_000
#: A plan is made anew for so much that all its work is done sooner, us: what two plans that answer it cost (4 s each).
SOONER_US = 8_000_000


@dataclass
class GoingAround:
    """One robot's way around obstacles. ``take_up(kept, steps, works, now)`` makes a new program the robot's own."""

    fleet: WayFleet
    generation: CarParkGeneration
    carriage: Carriage
    shuttle: ShuttleWork
    take_up: Callable[[int, Sequence[CarStep], list[StationWork], int], list[Effect]]
    #: Tasks given back, with why, how often to say so still, and when next.
    given_back: dict[Reference, tuple[Reason, int, int]] = field(default_factory=dict)
    #: Whether the drive does not do what it is told.
    is_stuck: bool = False
    _seen: int = 0
    _tokens_seen: int = -1
    _admissions: int = 0
    _since_us: int | None = None
    _retry_at_us: int | None = None
    #: Plans and cars heard, what was known when places were last looked at, and when to look again.
    _heard: int = 0
    _places_seen: tuple[int, ...] = ()
    _place_at_us: int | None = None
    #: Since when somebody stands in my way for ever, by its plan.
    _stands_since_us: int | None = None
    #: Plans heard, and when that was, when it last looked whether it can set off sooner.
    _plans_seen: int = -1
    _looked_us: int = 0

    def __post_init__(self) -> None:
        self.places = PlaceChoice(self.fleet, self.generation, self.shuttle)
        self.standoff = Standoff(self.fleet, self.carriage)
        self.kept_out = KeptOut(self.fleet, self.shuttle)
        self.fleet.tokens.before_taking = self._before_taking

    @property
    def program(self) -> Program:
        """The order program in hand."""
        return self.generation.program

    @property
    def is_at_ease(self) -> bool:
        """Whether the drive moves, and no plan is to be made anew."""
        return not self.is_stuck and self._retry_at_us is None and self._since_us is None

    def next_wake(self) -> int | None:
        """When to try again, or to say again what was given back."""
        stands_us = None if self._stands_since_us is None else self._stands_since_us + KEEP_US
        times = [
            self.next_word(),
            self._retry_at_us,
            self._place_at_us,
            stands_us,
            self.standoff.due_us,
            self.kept_out.next_wake(),
        ]
        return min((time for time in times if time is not None), default=None)

    def next_word(self) -> int | None:
        """When a task that was given back is to be named again, bus time in us."""
        return min((due_us for _, _, due_us in self.given_back.values()), default=None)

    def advance(self, now_us: int) -> list[Effect]:
        """Look whether the plan leads through an obstacle, where anything about them has changed, or a task was won."""
        effects = self.say_again(now_us) + self._return_rights(now_us)
        if self.fleet.admissions != self._admissions:
            self._admissions = self.fleet.admissions
            self._since_us = self._retry_at_us = now_us
        changes = self.fleet.mirror.obstacles.changes
        if changes != self._seen:
            self._seen = changes
            if self._since_us is not None or self._is_hindered(self.program.remaining, now_us):
                self._since_us = now_us if self._since_us is None else self._since_us
                self._retry_at_us = now_us
        if self._stood_for_us(now_us) >= KEEP_US:
            return effects + self._make_room(now_us)
        if self._retry_at_us is not None and self._retry_at_us <= now_us:
            effects += self._try(now_us)
        effects += self._set_off_sooner(now_us)
        kept_out = self.kept_out.look(self.program, now_us)
        if kept_out is not None:
            effects += self._choose_for(kept_out, now_us)
        other = self.standoff.look(now_us)
        if other != NOBODY:
            effects += self._turn_away(other, now_us)
        return effects + self._leave_elsewhere(now_us)

    def _stood_for_us(self, now_us: int) -> int:
        """How long whoever has the slot that I wait for has stood there for ever by its own plan, us; 0 where nobody.

        Who only stands gives way (``giving_way``); one that does not finds no way around what I plan.
        """
        slot, me = self.carriage.blocked, self.fleet.node_id
        stands = False
        if slot is not None and self.carriage.refresh_at_us is None:
            holder = self.fleet.tokens.holder_of(segment_token(slot))
            window = SlotWindow(slot, now_us, FOREVER)
            stands = holder != me and holder in self.fleet.mirror.reservations.standing_in(me, [window])
        if not stands:
            self._stands_since_us = None
            return 0
        self._stands_since_us = now_us if self._stands_since_us is None else self._stands_since_us
        return now_us - self._stands_since_us

    def _make_room(self, now_us: int) -> list[Effect]:
        """Another way; where there is none, stand without a plan until the other has gone: it plans around mine."""
        self._stands_since_us = None
        works = self.program.works()
        kept, origin, start_us = self.turning((), now_us)
        steps = self.generation.reroute(origin, start_us, self._ahead(works, kept), now_us)
        if steps is None:
            self.turn_later(now_us)
        return self.take_up(kept, steps or (), works, now_us)

    def looks_from(self) -> int:
        """From when on every event counts, bus us: while it waits for a slot, rides, or a drive has got stuck."""
        step = self.program.step
        if self.is_stuck or self.carriage.blocked is not None or (step is not None and step.action is LegAction.RIDE):
            return 0
        return min(self.carriage.stall.stuck_from_us, self.shuttle.stall.stuck_from_us)

    def drive_changes(self, now_us: int) -> bool:
        """Whether drive or shuttle have got stuck by now, or are so no more."""
        return (self.carriage.stall.is_stuck(now_us) or self.shuttle.stall.is_stuck(now_us)) is not self.is_stuck

    def watch_drive(self, now_us: int) -> list[Effect]:
        """A drive that does not move makes the robot an obstacle: it goes on trying, others get its untouched tasks.

        So does a shuttle that does not take up its order.
        """
        if not self.drive_changes(now_us):
            return []
        self.is_stuck = not self.is_stuck
        if not self.is_stuck:
            self.turn_later(now_us)
            return [Report("the drive moves again")]
        lost = self.untouched()
        effects: list[Effect] = [Report("the drive does not move")]
        effects += self.drop(lost, now_us) if lost else []
        for task in lost:
            effects += self.forfeit(task, Reason.ACTUATOR_FAULT, now_us)
        return effects

    def turn_later(self, now_us: int) -> None:
        """The program does not end where a machine may stand for ever: make it anew as soon as that is possible."""
        self._since_us = now_us if self._since_us is None else self._since_us
        self._retry_at_us = now_us + RETRY_US

    def won(self) -> None:
        """A task was taken on by its bid, which may be older than an obstacle that it leads through."""
        self._seen = -1

    def hear(self, message: Message) -> None:
        """What was given back is called or awarded anew: enough was said of it. A place may have been taken."""
        self._heard += isinstance(message, Itinerary | CarAt)
        if isinstance(message, CallForProposals) and message.task in self.given_back and not message.depth:
            del self.given_back[message.task]

    def forfeit(self, task: Reference, reason: Reason, now_us: int) -> list[Effect]:
        """Give an untouched task back; its steps are the caller's business."""
        self.given_back[task] = reason, SAY_AGAIN, now_us + SAY_AGAIN_US
        return [forfeited_record(task), Send(self._report(task, reason))]

    def lose(self, task: Reference) -> list[Effect]:
        """A task is another's by its initiator's word; nobody need hear of that from me."""
        return [forfeited_record(task), Report(f"task {task.origin}.{task.number} is another's now")]

    def untouched(self, *, is_lost: bool = False) -> list[Reference]:
        """Tasks in the program whose car was not touched and is in others' custody, in order.

        Of one that is lost, void or another's, the right to the station does not count: it may have come for the next
        task there, and whose the task is now waits for it.
        """
        tokens = self.fleet.tokens
        found = []
        for work in self.program.works():
            begun = self.shuttle.work == work and self.shuttle.phase not in (HandlingPhase.ACQUIRE, HandlingPhase.DONE)
            has_right = tokens.holds(car_token(*work.car))
            has_right |= tokens.holds(station_token(work.station)) and not is_lost
            if work.handling is CarHandling.TAKE and not begun and not has_right:
                found.append(work.call.task)
        return found

    def drop(self, tasks: Sequence[Reference], now_us: int) -> list[Effect]:
        """Take untouched tasks out of the program and plan the rest anew."""
        works = [work for work in self.program.works() if work.call.task not in tasks]
        if self.shuttle.work is not None and self.shuttle.work.call.task in tasks:
            self.shuttle.drop()
        kept, origin, start_us = self.turning(tasks, now_us)
        steps = self.generation.reroute(origin, start_us, self._ahead(works, kept), now_us)
        if steps is None or self._is_trapped(now_us):
            self.turn_later(now_us)
            steps = ()
            if not works and self._is_trapped(now_us):
                # Who waits aboard for its lift plans no further than off it: more would stand in the way of others.
                self._cut_behind_ride()
        return self.take_up(kept, steps, works, now_us)

    def _return_rights(self, now_us: int) -> list[Effect]:
        """Give back what was granted for work that is dropped; looked for where tokens have moved."""
        if self.fleet.tokens.changes == self._tokens_seen:
            return []
        effects = custody.give_back(self.fleet, self._needed(), now_us)
        self._tokens_seen = self.fleet.tokens.changes
        return effects

    def _needed(self) -> set[TokenKey]:
        works, at_hand = self.program.works(), self.shuttle.work
        if at_hand is not None and self.shuttle.phase is not HandlingPhase.DONE:
            works.append(at_hand)
        return {key for work in works for key in (station_token(work.station), car_token(*work.car))}

    def _before_taking(self, grant: TokenGrant) -> list[Effect] | None:
        """A car that no work of mine needs is taken once its place is heard: without, it could not be given back."""
        is_car, key = grant.token_kind is TokenKind.CAR, TokenKey(grant.token_kind, grant.token)
        if not is_car or key in self._needed() or self.fleet.mirror.car_station(custody.car_of(grant)) is not None:
            return []
        self.fleet.drops[Reason.MIRROR_BEHIND] += 1
        return None

    def _cut_behind_ride(self) -> None:
        steps = self.program.remaining[:2]
        if len(steps) == 2 and steps[1].action is LegAction.TRAVEL:
            off = steps[1]
            step = 1 if off.to_index > off.from_index else -1
            self.program.steps[self.program.current + 1] = off._replace(to_index=off.from_index + step)

    def _set_off_sooner(self, now_us: int) -> list[Effect]:
        """Who stands by its plan looks, as others tell theirs, whether all can be done much sooner by now.

        What they gave up, or are done with before its time, would be waited for to its planned end.
        """
        if self._heard == self._plans_seen or now_us < self._looked_us + LOOK_US:
            return []
        step, works = self.program.step, self.program.works()
        if step is None or step.action is not LegAction.STAND or step.end_us - now_us < SOONER_US or not works:
            return []
        self._plans_seen, self._looked_us = self._heard, now_us
        kept, origin, start_us = self.turning((), now_us)
        steps = None if kept else self.generation.reroute(origin, start_us, works, now_us)
        if steps is None or _worked_us(self.program.remaining) - _worked_us(steps) < SOONER_US:
            return []
        return self.take_up(kept, steps, works, now_us)

    # --- other places ------------------------------------------------------------------------------------------

    def _leave_elsewhere(self, now_us: int) -> list[Effect]:
        """A car whose place has become another's goes to a place that is free."""
        changed = (self.fleet.tokens.changes, self.fleet.tokens.beliefs.changes, self._heard)
        retries = self._place_at_us is not None and self._place_at_us <= now_us
        if changed == self._places_seen and not retries:
            return []
        self._places_seen, self._place_at_us = changed, None
        for work in self.places.lost():
            effects = self._choose_for(work, now_us)
            if effects:
                return effects
            self._place_at_us = now_us + RETRY_US
        for work in self.places.moved():
            effects = self._take_at(work, now_us)
            if effects:
                return effects
            self._place_at_us = now_us + RETRY_US
        return []

    def _take_at(self, work: StationWork, now_us: int) -> list[Effect]:
        """Fetch a car from where it stands by now; nothing while there is no way there."""
        was = next(one for one in self.program.works() if one._replace(station=work.station) == work)
        in_hand = self.program.step is not None and self.program.step.work == was
        kept, origin, start_us = self.turning([work.call.task] if in_hand else (), now_us)
        works = self._ahead(self.program.works(), kept)
        moved = [work if one == was else one for one in works]
        steps = self.generation.reroute(origin, start_us, moved, now_us) if was in works else None
        if steps is None:
            return []
        if self.shuttle.work == was:
            self.shuttle.drop()
        self._heard += 1
        told = Report(f"car {work.car.number} is fetched from {work.station}: it stands there by now")
        return [told, *self.take_up(kept, steps, moved, now_us)]

    def _choose_for(self, work: StationWork, now_us: int) -> list[Effect]:
        """Nothing where there is no other place, or no way there, now: it waits at its own then.

        Who stands there with it gives back what it has not touched, the last first, where all does not fit into one
        plan behind another place: whoever waits for that is served by nobody while it stands.
        """
        in_hand = self.program.step is not None and self.program.step.work == work
        untouched = self.untouched() if in_hand else []
        for first in range(len(untouched), -1, -1):
            lost = untouched[first:]
            effects = self._choose_without(lost, work, now_us)
            if effects:
                return effects + [word for task in lost for word in self.forfeit(task, Reason.IMPOSSIBLE, now_us)]
        return []

    def _choose_without(self, lost: Sequence[Reference], work: StationWork, now_us: int) -> list[Effect]:
        """The same, of a program that has none of ``lost`` any more."""
        in_hand = self.program.step is not None and self.program.step.work == work
        kept, origin, start_us = self.turning([work.call.task] if in_hand else (), now_us)
        works = [one for one in self._ahead(self.program.works(), kept) if one.call.task not in lost]
        for place in self.places.instead(work, now_us) if work in works else ():
            moved = [one._replace(station=place) if one == work else one for one in works]
            steps = self.generation.reroute(origin, start_us, moved, now_us)
            if steps is None:
                continue
            if self.shuttle.work == work:
                self.shuttle.drop()
            self._heard += 1
            told = Report(f"car {work.car.number} is left at {place}: {work.station} is another's")
            return [sink_record(work.call.task, place), told, *self.take_up(kept, steps, moved, now_us)]
        return []

    # --- inner works -------------------------------------------------------------------------------------------

    def _try(self, now_us: int) -> list[Effect]:
        """Plan anew from where the carrier can turn; forfeit what finds no way for too long."""
        self._retry_at_us = now_us + RETRY_US
        remaining = self.program.remaining
        step = remaining[0] if remaining else None
        is_driving = self.carriage.standing_at is None or self.carriage.target is not None
        if step is not None and step.action is LegAction.TRAVEL and is_driving and self._is_hindered([step], now_us):
            # It comes to a stand by itself where its rights end.
            self._retry_at_us = now_us + LOOK_US
            return []
        works = self.program.works()
        kept, origin, start_us = self.turning((), now_us)
        steps = self.generation.reroute(origin, start_us, self._ahead(works, kept), now_us)
        assert self._since_us is not None
        lost, is_late = self.untouched(), now_us - self._since_us >= KEEP_US
        if steps is None and is_late and not lost:
            # With a car aboard: who only stands in its way gives it, as it may stand in theirs.
            steps = self.generation.reroute(origin, start_us, self._ahead(works, kept), now_us, asks=True)
        if steps is not None and not self._is_trapped(now_us):
            self._since_us = self._retry_at_us = None
            return self.take_up(kept, steps, works, now_us)
        if not is_late or not lost:
            return []
        task = lost[-1]
        effects: list[Effect] = [Report(f"gives task {task.origin}.{task.number} back: no way")]
        return effects + self.drop([task], now_us) + self.forfeit(task, Reason.IMPOSSIBLE, now_us)

    def _turn_away(self, other: int, now_us: int) -> list[Effect]:
        """Plan anew as if who stands face to face with me stood there for ever, or else until I am out of its way."""
        mirror, machine = self.fleet.mirror, self.fleet.site.machines[other]
        kept, origin, start_us = self._aboard(now_us) or self.turning((), now_us)
        if kept or other in mirror.obstacles.machines:
            return []
        # Rights that it has beyond me it cannot use: it grants them to me, who goes first then.
        slots = mirror.obstacles.slots_of(machine, mirror.progress.get(other), lambda slot: NOBODY)
        works = self.program.works()
        with mirror.as_obstacle(other, slots, now_us):
            steps = self.generation.reroute(origin, start_us, works, now_us)
        self._seen = mirror.obstacles.changes
        if not steps:
            # None, or to stand in the other's way for ever.
            aside = self._step_aside(other, origin, start_us, now_us)
            steps = steps if aside is None else aside
        if steps is None:
            return []
        self.standoff.turned(other, now_us)
        return self.take_up(0, steps, works, now_us)

    def _step_aside(self, other: int, origin: Segment, start_us: int, now_us: int) -> tuple[CarStep, ...] | None:
        """The same work by a way that leads around all that ``other`` has left to do, once I have made room for it."""
        mirror = self.fleet.mirror
        plan, progress = mirror.plans.get(other), mirror.progress.get(other)
        if plan is None or progress is None:
            return None
        place = Segment(progress.track, progress.index)
        # By its own word, not by the order of passing, which has led here.
        leg = progress.leg if progress.itinerary_version == plan.itinerary.version else 0
        later = put_off(self.fleet.site, plan, leg, place, now_us + ASIDE_US)
        if later is None:
            return None
        with mirror.as_told(BegunItinerary(later, now_us), now_us):
            return self.generation.reroute(origin, start_us, self.program.works(), now_us)

    def _aboard(self, now_us: int) -> tuple[int, Segment, int] | None:
        """From where to plan for who stands aboard a lift and was to leave it: it rides on instead.

        Who stands before the sill may have nowhere else to go than onto the platform, in an alley that ends behind it.
        """
        here, step = self.carriage.standing_at, self.program.step
        if here is None or step is None or self.carriage.target is not None or step.action is not LegAction.TRAVEL:
            return None
        return None if lift_at(self.fleet.site, here) is None else (0, here, now_us)

    def _is_trapped(self, now_us: int) -> bool:
        """Whether the ride in hand is with a lift that is an obstacle."""
        remaining = self.program.remaining
        return bool(remaining) and remaining[0].action is LegAction.RIDE and self._is_hindered(remaining[:1], now_us)

    def turning(self, tasks: Sequence[Reference], now_us: int) -> tuple[int, Segment, int]:
        """As ``Program.turning``, but a run that stands at a mark before an obstacle, or work dropped, ends there.

        No plan begins in a mouth on the axis of the track inside: it begins at the mouth, turned or not.
        """
        remaining, here = self.program.remaining, self.carriage.standing_at
        if remaining and remaining[0].work is not None and remaining[0].work.call.task in tasks:
            # Where it was pushed to as well: of a step that is kept it would be told that it is done.
            return 0, self.carriage.nearest, now_us
        is_run = remaining and remaining[0].action is LegAction.TRAVEL and self.carriage.target is None
        if is_run and here is not None and lift_at(self.fleet.site, here) is None:
            return 0, self.carriage.axis.mouths.get(here.index, here), now_us
        return self.program.turning(now_us)

    def _ahead(self, works: list[StationWork], kept: int) -> list[StationWork]:
        """Works that are not in the steps that are kept."""
        done = [step.work for step in self.program.remaining[:kept] if step.work is not None]
        return [work for work in works if work not in done]

    def _is_hindered(self, steps: Sequence[CarStep], now_us: int) -> bool:
        """Whether steps lead through an obstacle, but for slots whose tokens I hold myself."""
        obstacles, tokens = self.fleet.mirror.obstacles, self.fleet.tokens
        if not steps or not (obstacles.machines or obstacles.blocked):
            return False
        told = to_itinerary(self.fleet.node_id, 1, Grade.FIRM, self.program.stamp, list(steps))
        windows = itinerary_windows(self.fleet.site, told, now_us, steps[0].begin_us)
        slots = {window.segment for window in windows}
        slots |= {gate(step.track) for step in steps if step.action is LegAction.RIDE}
        if any(slot in obstacles.blocked for slot in slots.difference(self.carriage.occupied())):
            return True
        return any(obstacles.is_at(slot) and not tokens.holds(segment_token(slot)) for slot in slots)

    def say_again(self, now_us: int) -> list[Effect]:
        """Name what was given back once more, where that is due."""
        effects: list[Effect] = []
        for task, (reason, left, due_us) in list(self.given_back.items()):
            if due_us > now_us:
                continue
            effects.append(Send(self._report(task, reason)))
            if left > 1:
                self.given_back[task] = reason, left - 1, now_us + SAY_AGAIN_US
            else:
                del self.given_back[task]
        return effects

    def _report(self, task: Reference, reason: Reason) -> TaskReport:
        return TaskReport(self.fleet.node_id, task, TaskPhase.FORFEITED, 0, reason)


def _worked_us(steps: Sequence[CarStep]) -> int:
    """When the last work of a program is done, bus us; 0 where it has none."""
    return max((step.end_us for step in steps if step.work is not None), default=0)
