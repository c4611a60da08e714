"""How a robot of the model goes from one position to another: the earliest way, around the turns of the others."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from heapq import heappop, heappush
from itertools import chain as chained
from typing import NamedTuple

from bus_sim.systems.car_park.design.servers import KEPT_US, AlleyServer, LiftServer, PlatformUse, Stretch
from bus_sim.systems.car_park.design.times import LEG_US
from onboard.core.site import Segment
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import Move, Roads, roads_of
from onboard.ways.site import WaySite


class ModelLeg(NamedTuple):
    """A move from rest to rest, and what it takes: a ride, and stretches by track, the wait before it among them."""

    here: Segment
    there: Segment
    begin_us: int
    end_us: int
    distance_mm: int = 0
    #: Lift, and the stops where one boards and leaves.
    ride: tuple[int, int, int] | None = None
    turns: tuple[tuple[int, Stretch], ...] = ()


#: A run's track is taken and left in parts of so many slots, each from when the first is entered; no more than so many.
PART, MOST_PARTS = 2, 6

#: Where, from when until when, and who.
Stand = tuple[Segment, int, int, int]
#: Until when one stands where one is to be, by when one arrives, us.
Stays = Callable[[int], int]
#: A position with the way to it: legs, the last first, as a chain.
_Chain = tuple[ModelLeg, "_Chain | None"]


@dataclass
class ModelTraffic:
    """All alleys and lifts of a site with the turns that were taken."""

    site: WaySite
    roads: Roads = field(init=False)
    alleys: dict[int, AlleyServer] = field(init=False)
    lifts: dict[int, LiftServer] = field(init=False)
    #: When what is planned is told: no platform goes for it before.
    now_us: int = 0
    _run_parts: dict[tuple[Segment, Segment], list[tuple[int, int, int, int]]] = field(default_factory=dict)
    _rests_us: dict[frozenset[Segment], dict[Segment, int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.roads = roads_of(self.site)
        self.alleys = {track: AlleyServer() for track in self.site.tracks if track not in self.site.lifts}
        self.lifts = {track: LiftServer(self.site, track) for track in self.site.lifts}

    def plan(
        self, origin: Segment, ready_us: int, goals: frozenset[Segment], owner: int, stays: Stays | None = None
    ) -> list[ModelLeg] | None:
        """The legs by which a robot is at any of ``goals`` first, none where it stands there; None without a way.

        With ``stays`` it waits, and stands at the goal until then, where nobody's turn is meanwhile; else anywhere.
        """
        return next(self.plans(origin, ready_us, goals, owner, stays), None)

    def plans(
        self, origin: Segment, ready_us: int, goals: frozenset[Segment], owner: int, stays: Stays | None = None
    ) -> Iterator[list[ModelLeg]]:
        """All such ways, the first first: with ``stays`` one for each time between others' turns at a goal."""
        by_track: dict[int, list[Segment]] = {}
        # Of goals that are as near the lower one is taken, as in the plant.
        for goal in sorted(goals):
            by_track.setdefault(goal.track, []).append(goal)
        # As many times as there are positions are kept for each set of goals. They count a gate as plans do, a quarter
        # of a second a ride more than is taken: of two ways that differ by less, either is found.
        rest_us = self._rests_us.setdefault(goals, {})
        until_us = FOREVER if stays is None else self._until_us(origin, ready_us, owner)
        open_: list[tuple[int, int, int, int, Segment, _Chain | None]] = [
            (ready_us, 0, ready_us, until_us, origin, None)
        ]
        seen: set[tuple[Segment, int, bool]] = set()
        number = 0
        while open_:
            _, _, time_us, until_us, here, chain = heappop(open_)
            is_to_ride = chain is not None and self._boards(chain[0])
            if (here, until_us, is_to_ride) in seen:
                continue
            if here in goals and (stays is None or stays(time_us) <= until_us):
                yield self._legs(chain, ready_us, owner)
                if stays is None:
                    return
            seen.add((here, until_us, is_to_ride))
            rides = self._rides(here, time_us, until_us, owner)
            drives = () if is_to_ride else self._drives(here, time_us, until_us, by_track.get(here.track, ()), owner)
            for leg in chained(rides, drives):
                there, there_us = leg.there, leg.end_us + LEG_US
                until_there_us = FOREVER if stays is None else self._until_us(there, leg.end_us, owner)
                if (there, until_there_us, self._boards(leg)) not in seen:
                    number += 1
                    if there not in rest_us:
                        rest_us[there] = self.roads.nearest_us(there, goals)
                    heappush(open_, (there_us + rest_us[there], number, there_us, until_there_us, there, (leg, chain)))

    def _boards(self, leg: ModelLeg) -> bool:
        """Whether a leg leads onto a platform: as in the plant whoever drives onto one rides."""
        return leg.ride is None and self.roads.lift_at(leg.there) is not None

    def _until_us(self, here: Segment, time_us: int, owner: int) -> int:
        """Until when one may stand somewhere: the begin of another's turn there."""
        turn = self.alleys[here.track].next_turn(time_us, here.index, owner)
        return FOREVER if turn is None else turn.begin_us

    def _drives(
        self, here: Segment, time_us: int, until_us: int, goals: Sequence[Segment], owner: int
    ) -> Iterator[ModelLeg]:
        """Legs that begin by ``until_us``: the first to each position, and those after others' turns there."""
        roads = self.roads
        for move in roads.hops(here):
            if move.lift_track is None:
                yield from self._each(partial(self._hop, here, move, owner), time_us, until_us, owner)
        for there in (*roads.junctions(here.track), *goals):
            run = roads.runs(here.track)[there.index - here.index] if there != here else None
            if run is not None:
                yield from self._each(partial(self._run, here, there, run[0:2], owner), time_us, until_us, owner)

    def _rides(self, here: Segment, time_us: int, until_us: int, owner: int) -> Iterator[ModelLeg]:
        for move in self.roads.hops(here):
            if move.lift_track is not None:
                ride = partial(self._ride, here, move, move.lift_track)
                yield from self._each(ride, time_us, until_us, owner)

    def _each(self, leg_from: Callable[[int], ModelLeg], time_us: int, until_us: int, owner: int) -> Iterator[ModelLeg]:
        leg = leg_from(time_us)
        # Whoever rests somewhere is in the way for ever.
        while leg.begin_us <= until_us and leg.end_us < FOREVER:
            yield leg
            after = self.alleys[leg.there.track].next_turn(leg.end_us, leg.there.index, owner)
            if after is None or after.end_us >= FOREVER:
                return
            # It ends no sooner than the other has gone from there.
            leg = leg_from(after.end_us - (leg.end_us - leg.begin_us))

    def _run(self, here: Segment, there: Segment, run: tuple[int, int], owner: int, time_us: int) -> ModelLeg:
        """A run along a track; whoever follows comes into each part of it as soon as it is left."""
        alley, (duration_us, distance_mm) = self.alleys[here.track], run
        low, high, begin_us = min(here.index, there.index), max(here.index, there.index), time_us
        parts = self._parts(here, there)
        if alley.free_from(begin_us, duration_us, low, high, owner) > begin_us:
            waits = True
            while waits:
                waits = False
                for enter_us, leave_us, first, last in parts:
                    free_us = alley.free_from(begin_us + enter_us, leave_us - enter_us, first, last, owner) - enter_us
                    waits, begin_us = waits or free_us > begin_us, free_us
        return ModelLeg(here, there, begin_us, begin_us + duration_us, distance_mm)

    def _parts(self, here: Segment, there: Segment) -> list[tuple[int, int, int, int]]:
        """From when until when, after the begin of a run, it takes each part of it, from index to index."""
        found = self._run_parts.get((here, there))
        if found is None:
            step, count = (1 if there.index > here.index else -1), abs(there.index - here.index)
            sweeps = [one for one in self.roads.swept(here.track, count)[0] if 0 <= one.offset <= count]
            found, size = [], max(PART, -(-len(sweeps) // MOST_PARTS))
            for number in range(0, len(sweeps), size):
                part = sweeps[number : number + size]
                ends = sorted((here.index + step * part[0].offset, here.index + step * part[-1].offset))
                found.append((part[0].enter_us, part[-1].leave_us, ends[0], ends[1]))
            self._run_parts[here, there] = found
        return found

    def _ride(self, here: Segment, move: Move, track: int, time_us: int) -> ModelLeg:
        lift, boards, leaves = self.lifts[track], self.roads.lift_at(here), self.roads.lift_at(move.destination)
        assert boards is not None and leaves is not None, "a ride begins and ends at doors of a lift"
        begin_us = lift.boards_at(time_us, boards[1], leaves[1], self.now_us)
        end_us = begin_us + lift.ride_us(boards[1], leaves[1])
        return ModelLeg(here, move.destination, begin_us, end_us, 0, (track, boards[1], leaves[1]))

    def _hop(self, here: Segment, move: Move, owner: int, time_us: int) -> ModelLeg:
        there, begin_us, waits = move.destination, time_us, True
        while waits:
            waits = False
            for slot in (here, there):
                free_us = self.alleys[slot.track].free_from(begin_us, move.duration_us, slot.index, slot.index, owner)
                waits, begin_us = waits or free_us > begin_us, free_us
        return ModelLeg(here, there, begin_us, begin_us + move.duration_us, move.distance_mm)

    def _legs(self, chain: "_Chain | None", ready_us: int, owner: int) -> list[ModelLeg]:
        """The legs of a way that was found, with what they take."""
        found: list[ModelLeg] = []
        while chain is not None:
            leg, chain = chain
            since_us = chain[0].end_us if chain is not None else ready_us
            turns = [*self._waits(leg, since_us, owner), *self._takes(leg, owner)]
            found.append(leg._replace(turns=tuple(turns)))
        return found[::-1]

    def _waits(self, leg: ModelLeg, since_us: int, owner: int) -> Iterator[tuple[int, Stretch]]:
        """Who waits for a leg stands where it begins."""
        here = leg.here
        if leg.begin_us > since_us + LEG_US:
            yield here.track, Stretch(since_us, leg.begin_us, here.index, here.index, owner)

    def _takes(self, leg: ModelLeg, owner: int) -> Iterator[tuple[int, Stretch]]:
        here, there, begin_us, end_us = leg[:4]
        if leg.ride is None and here.track != there.track:
            # A turn through a mouth takes the slots at both of its ends.
            for slot in (here, there):
                yield slot.track, Stretch(begin_us, end_us, slot.index, slot.index, owner)
        elif leg.ride is None:
            for enter_us, leave_us, low, high in self._parts(here, there):
                yield here.track, Stretch(begin_us + enter_us, begin_us + leave_us, low, high, owner)

    def stands(self, at: Segment, begin_us: int, end_us: int, owner: int) -> None:
        """A robot stands and works somewhere."""
        if end_us > begin_us:
            self.alleys[at.track].take(Stretch(begin_us, end_us, at.index, at.index, owner))

    def stands_no_more(self, at: Segment, begin_us: int, end_us: int, owner: int) -> None:
        """A robot does not stand there after all."""
        if end_us > begin_us:
            self.alleys[at.track].give_back(Stretch(begin_us, end_us, at.index, at.index, owner))

    def take(self, legs: list[ModelLeg]) -> None:
        """Take all that these legs need."""
        for leg in legs:
            for track, turn in leg.turns:
                self.alleys[track].take(turn)
            if leg.ride is not None:
                self.lifts[leg.ride[0]].take(self._use(leg))

    def give_back(self, legs: list[ModelLeg]) -> None:
        """These legs are not driven."""
        for leg in legs:
            for track, turn in leg.turns:
                self.alleys[track].give_back(turn)
            if leg.ride is not None:
                self.lifts[leg.ride[0]].give_back(self._use(leg))

    def _use(self, leg: ModelLeg) -> PlatformUse:
        assert leg.ride is not None, "it rides"
        track, board, leave = leg.ride
        return self.lifts[track].use(leg.begin_us, board, leave)

    @contextmanager
    def tried(self) -> Iterator[None]:
        """What is taken and given back meanwhile is as before afterwards."""
        turns = [(alley, [*alley.turns]) for alley in self.alleys.values()]
        uses = [(lift, [*lift.uses], lift.used_us) for lift in self.lifts.values()]
        try:
            yield
        finally:
            for alley, kept in turns:
                alley.turns = kept
            for lift, used, used_us in uses:
                lift.uses, lift.used_us = used, used_us

    def meet(
        self,
        mine: list[ModelLeg],
        my_stands: list[Stand],
        theirs: list[ModelLeg],
        their_stands: list[Stand],
    ) -> bool:
        """Whether two robots would be at one place at a time, or on one platform, if both went these ways."""
        turns = [*_turns(theirs, their_stands)]
        for track, one in _turns(mine, my_stands):
            for other_track, other in turns:
                is_by_time = one.begin_us < other.end_us and other.begin_us < one.end_us
                if track == other_track and is_by_time and one.low <= other.high and other.low <= one.high:
                    return True
        rides = [(leg.ride[0], self._use(leg)) for leg in theirs if leg.ride is not None]
        my_rides = [(leg.ride[0], self._use(leg)) for leg in mine if leg.ride is not None]
        return any(lift == two and self.lifts[lift].meet(one, other) for lift, one in my_rides for two, other in rides)

    def give_way(self, by_us: int, but: int | None) -> None:
        """Who stands for ever somewhere, ``but`` one robot, is gone from there by a time."""
        for alley in self.alleys.values():
            alley.turns = [
                one._replace(end_us=by_us) if one.end_us >= FOREVER and one.owner != but else one
                for one in alley.turns
                if one.end_us < FOREVER or one.owner == but or one.begin_us < by_us
            ]

    def forget(self, now_us: int) -> None:
        """Drop what was long over at ``now_us``."""
        for alley in self.alleys.values():
            alley.forget(now_us - KEPT_US)
        for lift in self.lifts.values():
            lift.forget(now_us - KEPT_US)


def _turns(legs: list[ModelLeg], stands: list[Stand]) -> Iterator[tuple[int, Stretch]]:
    for leg in legs:
        yield from leg.turns
    for at, begin_us, end_us, owner in stands:
        yield at.track, Stretch(begin_us, end_us, at.index, at.index, owner)


def arrival_us(legs: list[ModelLeg], ready_us: int) -> int:
    """When the last leg has ended, and was told; ``ready_us`` without legs."""
    return legs[-1].end_us + LEG_US if legs else ready_us
