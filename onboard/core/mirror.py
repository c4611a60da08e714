"""The mirror: what this machine believes of the others, built from bus traffic alone (row P35).

A wrong mirror costs time, never safety: what moves is guarded by tokens.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.core.codes import ANY_STATION, MOBILE_KINDS, OUTSIDE, Grade, KindCode, MachineState, Reason
from onboard.core.messages import Blocked, CarAt, Clear, Heartbeat, Itinerary, Progress, Reference
from onboard.core.serial import is_newer, reread_us
from onboard.core.site import Segment, Site, Station
from onboard.ways.lift_uses import standing_after
from onboard.ways.lifts import lift_tracks
from onboard.ways.obstacles import Obstacles
from onboard.ways.occupancy import final_position, itinerary_windows, lift_uses, turned_in
from onboard.ways.passing import Plan, next_plan
from onboard.ways.passing_order import PassingOrder
from onboard.ways.reservations import Reservations

#: Heartbeats missed before a node counts as silent.
MISSED_HEARTBEATS = 3
#: Cars that have left and are still remembered; bounds the memory of a machine that runs for years.
MAX_GONE_CARS = 64


@dataclass
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


@dataclass(frozen=True, slots=True)
class CarRecord:
    """Where a car stands, who vouches for it, under which version of its token, and its wheelbase in mm."""

    station: int
    custodian: int
    version: int
    wheelbase_mm: int


def _crc16(values: list[int]) -> int:
    """CRC-16/CCITT-FALSE over the values as 32-bit big-endian words: short, and the same in any language."""
    crc = 0xFFFF
    for value in values:
        for byte in (value & 0xFFFFFFFF).to_bytes(4, "big"):
            crc ^= byte << 8
            for _ in range(8):
                crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


@dataclass
class Mirror:
    """Everybody's itineraries by version, cars by custodian, and who is alive."""

    site: Site
    node_id: int
    peers: dict[int, Peer] = field(default_factory=dict)
    itineraries: dict[int, Itinerary] = field(default_factory=dict)
    #: The same with when their first legs began, and what each replaced: the order of passing comes from there.
    plans: dict[int, Plan] = field(default_factory=dict)
    replaced: dict[int, Plan] = field(default_factory=dict)
    cars: dict[Reference, CarRecord] = field(default_factory=dict)
    progress: dict[int, Progress] = field(default_factory=dict)
    #: Boot counter of each node's life before the present one, 0 where I knew of none.
    boots_before: dict[int, int] = field(default_factory=dict)
    reservations: Reservations = field(default_factory=Reservations)
    order: PassingOrder = field(init=False)
    obstacles: Obstacles = field(init=False)
    #: Who wants to know that a car which left long ago is remembered no longer.
    on_forgotten: list[Callable[[Reference], object]] = field(default_factory=list)
    _digest: int | None = None

    def __post_init__(self) -> None:
        self.order = PassingOrder(self.site)
        self.obstacles = Obstacles(self.site, lambda: self.reservations)

    def on_heartbeat(self, beat: Heartbeat, now_us: int) -> bool:
        """Note a sign of life; True where the sender is new or was restarted, so that its statements are wanted."""
        known = self.peers.get(beat.sender)
        starts = beat.state is MachineState.STARTING and known is not None and known.state is not MachineState.STARTING
        if starts and known is not None and known.boot == beat.boot and self._has_just_come(known, now_us):
            # No board starts so soon again: its first word has come twice.
            return False
        fresh = known is None or known.boot != beat.boot or starts
        if fresh:
            self._drop_itinerary(beat.sender)
            self.boots_before[beat.sender] = known.boot if known is not None else 0
        since_us = now_us if known is None or fresh else known.since_us
        self.peers[beat.sender] = Peer(
            beat.kind,
            beat.state,
            beat.boot,
            beat.mirror_digest,
            now_us,
            beat.contract,
            beat.site_digest,
            since_us,
            beat,
        )
        return fresh

    def _has_just_come(self, peer: Peer, now_us: int) -> bool:
        return now_us - peer.since_us < self.site.timing.heartbeat_us // 2

    def on_itinerary(self, itinerary: Itinerary, now_us: int) -> bool:
        """Take up a firm itinerary by version; True where it was news. Tentative ones are hints and not kept here."""
        if itinerary.grade is Grade.TENTATIVE:
            return False
        known = self.itineraries.get(itinerary.sender)
        if known is not None and not is_newer(itinerary.version, known.version, 8):
            return False
        self.itineraries[itinerary.sender] = itinerary
        plans = self.plans
        if known is not None and itinerary.sender in plans:
            self.replaced[itinerary.sender] = plans[itinerary.sender]
        plans[itinerary.sender] = next_plan(plans.get(itinerary.sender), itinerary, now_us)
        if itinerary.sender not in self.obstacles.machines:
            self._count_on(plans[itinerary.sender], now_us)
        self._digest = None
        return True

    def _count_on(self, plan: Plan, now_us: int) -> None:
        """Plan around a machine's plan, and keep its place in the order of passing."""
        itinerary = plan.itinerary
        self.order.on_plan(plan, now_us)
        self.reservations.release(itinerary.sender)
        self.reservations.reserve(
            itinerary.sender,
            itinerary_windows(self.site, itinerary, now_us, plan.first_begin_us),
            lift_uses(self.site, itinerary, now_us, plan.first_begin_us),
        )

    def retime(self, now_us: int) -> None:
        """My clock was set anew: read the times of all plans again, as the nearest to ``now_us`` that they can be."""
        self.reservations, self.order = Reservations(), PassingOrder(self.site)
        for plans in (self.plans, self.replaced):
            for node, plan in plans.items():
                plans[node] = plan._replace(first_begin_us=reread_us(plan.first_begin_us, now_us))
        for node, plan in self.plans.items():
            if node not in self.obstacles.machines:
                self._count_on(plan, now_us)
        for progress in self.progress.values():
            self.order.on_progress(progress)
        self.obstacles.retime(now_us)

    def on_word(self, word: Blocked | Clear, now_us: int) -> bool:
        """Take up that a segment is blocked, or clear again; True where it is news."""
        self._digest = None
        return self.obstacles.hear(word, now_us)

    def set_aside(self, node: int, slots: frozenset[Segment], reason: Reason, now_us: int) -> None:
        """A machine does not follow its plan: it is an obstacle at ``slots`` and passes nothing."""
        if self.obstacles.take_up(node, slots, reason, now_us):
            self.order.drop(node)

    def admit(self, node: int, now_us: int) -> None:
        """A machine that was an obstacle takes part: its plan counts, if it has told one."""
        if self.obstacles.let_go(node) and node in self.plans:
            self._count_on(self.plans[node], now_us)

    def on_progress(self, progress: Progress) -> None:
        """Last known position of a machine, my own included."""
        self.progress[progress.sender] = progress
        self.order.on_progress(progress)

    def on_car(self, statement: CarAt) -> bool:
        """Take up a custodian's statement; True where it changed anything."""
        known = self.cars.get(statement.car)
        record = CarRecord(statement.station, statement.sender, statement.version, statement.wheelbase_mm)
        if known == record:
            return False
        if known is not None and not is_newer(statement.version, known.version, 16):
            # One version of a car's token has one custodian: whoever else speaks under it is wrong.
            again = statement.version == known.version and statement.sender == known.custodian
            if not again:
                return False
        self.cars[statement.car] = record
        self._digest = None
        self._prune_gone()
        return True

    def _prune_gone(self) -> None:
        """Keep the last cars that left, so that a late statement about them is still known to be old."""
        if len(self.cars) <= MAX_GONE_CARS:
            return
        gone = [car for car, record in self.cars.items() if record.station == OUTSIDE]
        for car in gone[: max(0, len(gone) - MAX_GONE_CARS)]:
            del self.cars[car]
            for listener in self.on_forgotten:
                listener(car)

    def others_standing(self) -> list[Segment]:
        """Where the plans of all other machines end: there they stand until they plan anew; obstacles stand now."""
        found = [
            final_position(self.site, itinerary)
            for node, itinerary in sorted(self.itineraries.items())
            if node != self.node_id and node not in self.obstacles.machines
        ]
        for node in sorted(self.obstacles.machines):
            seen, machine = self.progress.get(node), self.site.machines[node]
            if machine.kind in MOBILE_KINDS:
                here = machine.home if seen is None else Segment(seen.track, seen.index)
                found += [here, turned_in(self.site, here)]
        return [position for position in found if position is not None]

    def lift_floors(self, now_us: int, at_us: int) -> dict[int, int]:
        """Where each lift (by its track) stands at ``at_us``, by its own word and the rides planned until then."""
        standing = {}
        uses = []
        for track in lift_tracks(self.site):
            seen = self.progress.get(self.site.stewards[track])
            standing[track] = seen.index if seen is not None else 1
            uses += self.reservations.uses(track, excluding=0)
        return standing_after(uses, standing, now_us, at_us)

    def free_places(self) -> list[Station]:
        """Places at which no car is known to stand, in the site's order."""
        taken = {record.station for record in self.cars.values()}
        return [place for place in self.site.places if place.number not in taken]

    def car_station(self, car: Reference) -> Station | None:
        """Where a car stands, or None where it is unknown or aboard a machine."""
        record = self.cars.get(car)
        if record is None or record.station in (ANY_STATION, OUTSIDE):
            return None
        return Station.from_number(record.station)

    def alive(self, now_us: int) -> set[int]:
        """Nodes heard within ``MISSED_HEARTBEATS`` heartbeat periods."""
        limit_us = now_us - MISSED_HEARTBEATS * self.site.timing.heartbeat_us
        return {node for node, peer in self.peers.items() if peer.heard_at_us >= limit_us}

    def digest(self) -> int:
        """16 bits over firm itineraries (node, version), cars (number, station) and blocked segments."""
        if self._digest is None:
            words = [node << 8 | it.version for node, it in sorted(self.itineraries.items())]
            for car, record in sorted(self.cars.items()):
                if record.station == OUTSIDE:
                    continue
                words += [car.origin << 16 | car.number, record.station]
            words += [1 << 31 | segment.number for segment in sorted(self.obstacles.blocked)]
            self._digest = _crc16(words)
        return self._digest

    def _drop_itinerary(self, node: int) -> None:
        # Its body is still somewhere: the reservation stays until its first new itinerary replaces it.
        self.plans.pop(node, None)
        self.replaced.pop(node, None)
        if self.itineraries.pop(node, None) is not None:
            self._digest = None
