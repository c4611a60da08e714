"""The mirror of a site with ways: what everybody's plans occupy, who passes first, and what is in the way there."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, ClassVar

from onboard.contract.codes import LegAction, MachineState, Reason, Side, TokenKind
from onboard.contract.constants import ANY_STATION, MOBILE_KINDS, NOBODY, OUTSIDE, STILL
from onboard.contract.messages import Blocked, CarAt, Clear, Itinerary, Leg, Message, Progress, SyncDone
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect
from onboard.core.mirror import Mirror, digest_words
from onboard.core.petitions import UNORDERED
from onboard.core.site import Machine, Segment, Station
from onboard.core.token_keys import TokenKey, segment_token
from onboard.ways.blocked_words import BlockedWords
from onboard.ways.bodies import Bodies
from onboard.ways.cars import CarFleet, CarMirror
from onboard.ways.lift_uses import standing_after
from onboard.ways.lifts import lift_tracks
from onboard.ways.missed_cars import MissedCars
from onboard.ways.obstacles import Obstacles
from onboard.ways.occupancy import LegWindows, final_position, leg_windows, lift_uses, standing_segments, turned_in
from onboard.ways.passing_order import PassingOrder
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow
from onboard.ways.site import WaySite
from onboard.ways.standing import Standing
from onboard.ways.tokens import tokens_of
from onboard.ways.told_way import TOLERANCE_US, BegunItinerary, next_plan, reread_us


@dataclass
class WayMirror(CarMirror):
    """What one machine believes of the others' ways."""

    digested: ClassVar[tuple[type[Message], ...]] = (*CarMirror.digested, Blocked, Clear)

    site: WaySite

    #: Plans with when their first legs began, and what each replaced: the order of passing comes from there.
    plans: dict[int, BegunItinerary] = field(default_factory=dict)
    replaced: dict[int, BegunItinerary] = field(default_factory=dict)
    reservations: Reservations = field(default_factory=Reservations)
    order: PassingOrder = field(init=False)
    obstacles: Obstacles = field(init=False)
    standing: Standing = field(init=False)
    bodies: Bodies = field(init=False)
    blocked_words: BlockedWords = field(init=False)
    missed: MissedCars = field(init=False)
    #: Who told a plan without a leg.
    _without_leg: set[int] = field(default_factory=set)
    #: Whose plan is thought of for a while (``as_told``): what it really told hinders no run of mine.
    _as_told: int = NOBODY

    def __post_init__(self) -> None:
        self.order = PassingOrder(self.site)
        self.obstacles = Obstacles(self.site, lambda: self.reservations, self.aside)
        self.standing = Standing(self.site, self.itineraries, self.is_laden)
        self.bodies = Bodies(self.site)
        self.blocked_words = BlockedWords(self.site, self.node_id, self.obstacles)
        self.missed = MissedCars(self.cars)

    # --- what is heard -----------------------------------------------------------------------------------------

    def handlers(self) -> dict[type[Message], Callable[[Any, int], list[Effect]]]:
        """Words about blocked segments as well."""
        return {**super().handlers(), **dict.fromkeys((Blocked, Clear), self._on_word)}

    def replay(self, entries: Iterable[Mapping[str, str | int]]) -> None:
        """What is in my journal is blocked, or clear, as it was."""
        self.blocked_words.replay(entries)
        self._digest = None

    def hear(self, message: Message, now_us: int) -> None:
        """Who moves, who says what it waits for, and what cars who has told all has not named."""
        self.standing.hear(message, now_us)
        if isinstance(message, SyncDone) and self._takes_part(message.sender):
            for car in self.missed.answered(message.sender):
                self.drop_car(car)

    def _takes_part(self, node: int) -> bool:
        """Whether a machine has its rights: who starts, or lost its journal, answers without them."""
        peer = self.peers.get(node)
        is_ready = peer is not None and peer.state not in (*STILL, MachineState.STARTING)
        return is_ready and node not in self.aside and not self.is_frozen()

    def statements(self) -> list[Effect]:
        """What is blocked, or clear again, of the tracks that I am steward of."""
        return self.blocked_words.statements()

    def _hear_car(self, statement: CarAt, now_us: int) -> list[Effect]:
        """A car stands in the site, is aboard or has left; a word of any other place is none."""
        self.missed.named(statement)
        if statement.station not in (ANY_STATION, OUTSIDE):
            station = Station.from_number(statement.station)
            track = self.site.tracks.get(station.track)
            if track is None or not 1 <= station.index <= track.length:
                if self.words is not None:
                    self.words.drops[Reason.VALUE_OUT_OF_RANGE] += 1
                return []
        return super()._hear_car(statement, now_us)

    def _on_word(self, word: Blocked | Clear, now_us: int) -> list[Effect]:
        self._digest = None
        return self.blocked_words.hear(word, now_us)

    def on_itinerary(self, itinerary: Itinerary, now_us: int) -> bool:
        """Take up a firm itinerary, and what it occupies."""
        node, is_continued = itinerary.sender, itinerary.sender in self.itineraries
        told, itinerary = itinerary, self._as_standing(itinerary)
        if not super().on_itinerary(itinerary, now_us):
            return False
        (self._without_leg.discard if told.legs else self._without_leg.add)(node)
        if is_continued and node in self.plans:
            self.replaced[node] = self.plans[node]
        known = self.plans.get(node)
        in_hand = 0 if known is None else self.order.leg_in_hand(known)
        self.plans[node] = next_plan(known, in_hand, itinerary, now_us)
        if node not in self.aside:
            self._count_on(self.plans[node], now_us)
        return True

    def _as_standing(self, itinerary: Itinerary) -> Itinerary:
        """A plan without a leg leaves its machine where it is by its last word, which is in the way there."""
        machine = self.site.machines.get(itinerary.sender)
        if itinerary.legs or machine is None or machine.kind not in MOBILE_KINDS or not self.site.tracks:
            return itinerary
        seen, ends_ms = self.progress.get(machine.node_id), itinerary.stamp.award_ms
        here = machine.home if seen is None else Segment(seen.track, seen.index)
        return replace(itinerary, legs=(Leg(LegAction.STAND, *here, here.index, Side.NEAR, ends_ms),))

    def _stands_elsewhere(self, node: int) -> None:
        plan = self.plans[node]
        self.itineraries[node] = self._as_standing(replace(plan.itinerary, legs=()))
        self.plans[node] = plan._replace(itinerary=self.itineraries[node])
        if node not in self.aside:
            self._count_on(self.plans[node], plan.first_begin_us)

    def _count_on(self, plan: BegunItinerary, now_us: int) -> None:
        """Plan around a machine's plan, and keep its place in the order of passing."""
        windows = self._occupy(plan, now_us)
        self.order.on_plan(plan.itinerary, windows, now_us)

    def _occupy(self, plan: BegunItinerary, now_us: int) -> LegWindows:
        """Plan around a machine's plan; the windows of its legs."""
        itinerary, begin_us = plan
        windows = leg_windows(self.site, itinerary, now_us, begin_us)
        uses = lift_uses(self.site, itinerary, now_us, begin_us)
        self.reservations.release(itinerary.sender)
        self.reservations.reserve(itinerary.sender, chain.from_iterable(windows), uses)
        return windows

    def _forget_plan(self, node: int) -> None:
        # Its body is still somewhere: the reservation stays until its first new itinerary replaces it.
        self.plans.pop(node, None)
        self.replaced.pop(node, None)
        self.standing.forget(node)
        super()._forget_plan(node)

    def on_progress(self, progress: Progress) -> None:
        """Last known position of a machine, and how far it has come on its way."""
        super().on_progress(progress)
        if progress.sender in self._without_leg & self.plans.keys():
            self._stands_elsewhere(progress.sender)
        self.bodies.hear(progress)
        self.order.on_progress(progress)

    def retime(self, now_us: int) -> None:
        """Times of plans are read anew, as the nearest to ``now_us`` that they can be."""
        self.reservations, self.order = Reservations(), PassingOrder(self.site)
        for plans in (self.plans, self.replaced):
            for node, plan in plans.items():
                plans[node] = plan._replace(first_begin_us=reread_us(plan.first_begin_us, now_us))
        for node, plan in self.plans.items():
            if node not in self.aside:
                self._count_on(plan, now_us)
        for progress in self.progress.values():
            self.order.on_progress(progress)
        self.obstacles.retime(now_us)
        self.slept(now_us)

    def slept(self, now_us: int) -> None:
        """Nobody has stood for any time that I know of."""
        self.standing.begin_anew(now_us)

    # --- who is in the way -------------------------------------------------------------------------------------

    def set_aside(self, node: int, slots: frozenset[Segment], reason: Reason, now_us: int) -> bool:
        """A machine is an obstacle at ``slots`` and passes nothing."""
        if not super().set_aside(node, slots, reason, now_us):
            return False
        self.obstacles.put(node, slots, now_us)
        self.order.drop(node)
        return True

    def admit(self, node: int, now_us: int) -> bool:
        """A machine takes part: its plan counts again."""
        if not super().admit(node, now_us):
            return False
        self.obstacles.let_go(node)
        if node in self.plans:
            self._count_on(self.plans[node], now_us)
        if node in self.progress:
            self.order.on_progress(self.progress[node])
        return True

    @contextmanager
    def as_obstacle(self, node: int, slots: frozenset[Segment], now_us: int) -> Iterator[None]:
        """Plan as if a machine that takes part stood at ``slots`` for ever; how far it has come is not forgotten."""
        order = self.order.copy()
        self.set_aside(node, slots, Reason.NOT_AUTHORISED, now_us)
        yield
        self.admit(node, now_us)
        self.order = order

    @contextmanager
    def as_told(self, plan: BegunItinerary, now_us: int) -> Iterator[None]:
        """Plan around this plan of a machine, as if it had told that and no other."""
        node = plan.itinerary.sender
        self._occupy(plan, now_us)
        self._as_told = node
        yield
        self._as_told = NOBODY
        self._occupy(self.plans[node], now_us)

    def slots_of(self, machine: Machine, holder_of: Callable[[TokenKey], int]) -> frozenset[Segment]:
        """Slots that a machine is in by its last word, and those whose tokens it holds."""
        seen = self.progress.get(machine.node_id)
        return self.obstacles.slots_of(machine, seen, lambda slot: holder_of(segment_token(slot)))

    def stands(self, node: int, now_us: int) -> bool:
        """Whether a machine that is heard has stood for too long where its plan does not leave it."""
        known = self.aside.get(node)
        if known is not None and known.reason is not Reason.FALSE_STATEMENT:
            self.standing.returned(node, known.since_us, now_us)
        return self.standing.stands(node, now_us)

    def is_planless(self, machine: Machine) -> bool:
        """Whether a machine that moves has told no plan; where there are no tracks it may have none to tell."""
        return bool(self.site.tracks) and machine.kind in MOBILE_KINDS and machine.node_id not in self.itineraries

    # --- the order of passing ----------------------------------------------------------------------------------

    def predecessor(self, node: int, key: TokenKey) -> int:
        """Who passes a slot right before ``node``; 0 for nobody, and for what is no slot."""
        if key.kind is not TokenKind.SEGMENT:
            return NOBODY
        return self.order.predecessor(node, slot_of(key)) or NOBODY

    def on_return(self, node: int, key: TokenKey) -> None:
        """A machine gave a slot back."""
        if key.kind is TokenKind.SEGMENT:
            self.order.on_return(node, slot_of(key))
            self.bodies.left(node, slot_of(key))

    # --- what plans need ---------------------------------------------------------------------------------------

    def others_standing(self) -> list[Segment]:
        """Where the plans of all other machines end: there they stand until they plan anew; obstacles stand now."""
        found = [
            final_position(self.site, itinerary)
            for node, itinerary in sorted(self.itineraries.items())
            if node != self.node_id and node not in self.aside
        ]
        for node in sorted(self.aside):
            seen, machine = self.progress.get(node), self.site.machines[node]
            if machine.kind in MOBILE_KINDS:
                here = machine.home if seen is None else Segment(seen.track, seen.index)
                found += [here, turned_in(self.site, here)]
        return [position for position in found if position is not None]

    def reservations_at(self, here: Segment, from_us: int, *, may_stay: bool) -> Reservations:
        """What others plan, for a way that this machine begins ``here`` at ``from_us``.

        Whose next run leads through here before that cannot make it: it stands where it is until this machine has gone.
        Not for who ``may_stay``, and need not go at all: it makes room.
        """
        own = found = self.reservations.apart(self.node_id, TOLERANCE_US)
        for node in sorted(self.plans) if not may_stay else ():
            place, comes_us = self.order.place(node), self.order.comes_us(node, here)
            if node in (self.node_id, self._as_told) or place is None:
                continue
            if comes_us is not None and comes_us < from_us:
                found = found.copy() if found is own else found
                found.release(node)
                found.reserve(node, [SlotWindow(slot, 0, FOREVER) for slot in standing_segments(self.site, place)])
        return found

    def lift_floors(self, now_us: int, at_us: int, planned: Reservations | None = None) -> dict[int, int]:
        """Where each lift (by its track) stands at ``at_us``, by its own word and the rides ``planned`` until then.

        By default those of all plans.
        """
        planned = self.reservations if planned is None else planned
        standing = {}
        uses = []
        for track in lift_tracks(self.site):
            seen = self.progress.get(self.site.stewards[track])
            standing[track] = min(max(seen.index, 1), self.site.tracks[track].length) if seen is not None else 1
            uses += planned.uses(track, excluding=0)
        return standing_after(uses, standing, now_us, at_us)

    def free_places(self) -> list[Station]:
        """Places at which no car is known to stand, in the site's order."""
        taken = {record.station for record in self.cars.values()}
        return [place for place in self.site.places if place.number not in taken]

    def site_tokens(self) -> Iterable[TokenKey]:
        """All tokens of segments and stations."""
        return tokens_of(self.site)

    def _believed(self) -> bytes:
        """Blocked segments as well."""
        blocked = self.obstacles.blocked
        said = super()._believed()
        return said + digest_words([1 << 31 | one.number for one in sorted(blocked)]) if blocked else said


@dataclass
class WayFleet(CarFleet):
    """What a machine works with that moves along ways, or deals in them."""

    mirror_type: ClassVar[type[Mirror]] = WayMirror

    site: WaySite
    mirror: WayMirror

    def passing_verdict(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Whether ``requester`` may have a slot now: in the plans' order, as its holder and the requester both see it.

        Without an agreed order it goes to whoever has asked for longest. Whose body stands in it comes before all that:
        it was pushed there by hand, and nobody else can come there.
        """
        claim, bodies = self.petitions.claim(key, requester), self.mirror.bodies
        if claim is None:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        if bodies.is_in(requester, slot_of(key)):
            return Reason.NONE
        if bodies.is_another_in(slot_of(key), requester):
            return Reason.TOKEN_NOT_GRANTABLE_YET
        if claim.itinerary_version == UNORDERED:
            oldest = self.petitions.is_oldest_unordered(key, requester, now_us)
            return Reason.NONE if oldest else Reason.TOKEN_NOT_GRANTABLE_YET
        return self.mirror.order.verdict(requester, slot_of(key), claim.itinerary_version, claim.predecessor)

    def is_shared(self, slot: Segment) -> bool:
        """Whether who has the right to a slot stands in it: another that was pushed into it too cannot have that."""
        holder = self.tokens.holder_of(segment_token(slot))
        return holder != self.node_id and self.mirror.bodies.is_in(holder, slot)


def way_mirror(mirror: Mirror) -> WayMirror:
    """The same mirror, for machines of a site with ways. Raises ``TypeError`` for any other."""
    if not isinstance(mirror, WayMirror):
        raise TypeError(f"node {mirror.node_id}: its mirror knows no ways")
    return mirror


def way_fleet(fleet: Fleet) -> WayFleet:
    """The same fleet, for machines of a site with ways. Raises ``TypeError`` for any other."""
    if not isinstance(fleet, WayFleet):
        raise TypeError(f"node {fleet.node_id}: its fleet knows no ways")
    return fleet


def slot_of(key: TokenKey) -> Segment:
    """The slot of a segment's token."""
    return Segment(key.number >> 8, key.number & 0xFF)
