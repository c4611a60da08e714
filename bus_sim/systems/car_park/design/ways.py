"""How a robot of the model goes from one position to another: the earliest way, around the turns of the others."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import NamedTuple

from bus_sim.systems.car_park.design.servers import KEPT_US, AlleyServer, LiftServer, PlatformUse, Stretch
from onboard.core.site import Segment
from onboard.ways.roads import Move, Roads, roads_of
from onboard.ways.site import WaySite

#: Between two legs: the end is sensed and told, and the next order given. Measured in the plant (docs/design-tool.md).
LEG_US = 300_000


class ModelLeg(NamedTuple):
    """A move from rest to rest, and what it takes: stretches by track, and a use of a lift."""

    here: Segment
    there: Segment
    begin_us: int
    end_us: int
    turns: tuple[tuple[int, Stretch], ...] = ()
    ride: tuple[int, PlatformUse] | None = None
    distance_mm: int = 0


#: A position with the way to it: legs, the last first, as a chain.
_Chain = tuple[ModelLeg, "_Chain | None"]


@dataclass
class ModelTraffic:
    """All alleys and lifts of a site with the turns that were taken."""

    site: WaySite
    roads: Roads = field(init=False)
    alleys: dict[int, AlleyServer] = field(init=False)
    lifts: dict[int, LiftServer] = field(init=False)
    _rests_us: dict[frozenset[Segment], dict[Segment, int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.roads = roads_of(self.site)
        self.alleys = {track: AlleyServer() for track in self.site.tracks if track not in self.site.lifts}
        self.lifts = {track: LiftServer(self.site, track) for track in self.site.lifts}

    def plan(self, origin: Segment, ready_us: int, goals: frozenset[Segment], owner: int) -> list[ModelLeg] | None:
        """The legs by which a robot is at any of ``goals`` first, none where it stands there; None without a way."""
        by_track: dict[int, list[Segment]] = {}
        for goal in goals:
            by_track.setdefault(goal.track, []).append(goal)
        # As many times as there are positions are kept for each set of goals: an estimate never above the way itself.
        rest_us = self._rests_us.setdefault(goals, {})
        open_: list[tuple[int, int, int, Segment, _Chain | None]] = [(ready_us, 0, ready_us, origin, None)]
        seen: set[Segment] = set()
        number = 0
        while open_:
            _, _, time_us, here, chain = heappop(open_)
            if here in seen:
                continue
            if here in goals:
                return _legs(chain)
            seen.add(here)
            for leg in self._legs_from(here, time_us, by_track.get(here.track, ()), owner):
                there = leg.there
                if there not in seen:
                    number += 1
                    if there not in rest_us:
                        rest_us[there] = self.roads.nearest_us(there, goals)
                    there_us = leg.end_us + LEG_US
                    heappush(open_, (there_us + rest_us[there], number, there_us, there, (leg, chain)))
        return None

    def _legs_from(self, here: Segment, time_us: int, goals: Sequence[Segment], owner: int) -> Iterator[ModelLeg]:
        roads = self.roads
        for move in roads.hops(here):
            if move.lift_track is not None:
                yield self._ride(here, move, move.lift_track, time_us)
            else:
                yield self._hop(here, move, time_us, owner)
        alley = self.alleys[here.track]
        for there in (*roads.junctions(here.track), *goals):
            run = roads.runs(here.track)[there.index - here.index]
            if run is not None:
                low, high = min(here.index, there.index), max(here.index, there.index)
                begin_us = alley.free_from(time_us, run[0], low, high, owner)
                turn = Stretch(begin_us, begin_us + run[0], low, high, owner)
                yield ModelLeg(here, there, begin_us, begin_us + run[0], ((here.track, turn),), None, run[1])

    def _ride(self, here: Segment, move: Move, track: int, time_us: int) -> ModelLeg:
        lift, boards, leaves = self.lifts[track], self.roads.lift_at(here), self.roads.lift_at(move.destination)
        assert boards is not None and leaves is not None, "a ride begins and ends at doors of a lift"
        begin_us = lift.boards_at(time_us, boards[1], leaves[1])
        end_us = begin_us + lift.ride_us(boards[1], leaves[1])
        return ModelLeg(here, move.destination, begin_us, end_us, (), (track, lift.use(begin_us, boards[1], leaves[1])))

    def _hop(self, here: Segment, move: Move, time_us: int, owner: int) -> ModelLeg:
        """A turn through a mouth takes the slots at both of its ends."""
        there, begin_us, waits = move.destination, time_us, True
        while waits:
            waits = False
            for slot in (here, there):
                free_us = self.alleys[slot.track].free_from(begin_us, move.duration_us, slot.index, slot.index, owner)
                waits, begin_us = waits or free_us > begin_us, free_us
        end_us = begin_us + move.duration_us
        turns = tuple((slot.track, Stretch(begin_us, end_us, slot.index, slot.index, owner)) for slot in (here, there))
        return ModelLeg(here, there, begin_us, end_us, turns, None, move.distance_mm)

    def stands(self, at: Segment, begin_us: int, end_us: int, owner: int) -> None:
        """A robot stands and works somewhere."""
        if end_us > begin_us:
            self.alleys[at.track].take(Stretch(begin_us, end_us, at.index, at.index, owner))

    def take(self, legs: list[ModelLeg]) -> None:
        """Take all that these legs need."""
        for leg in legs:
            for track, turn in leg.turns:
                self.alleys[track].take(turn)
            if leg.ride is not None:
                self.lifts[leg.ride[0]].take(leg.ride[1])

    def give_back(self, legs: list[ModelLeg]) -> None:
        """These legs are not driven."""
        for leg in legs:
            for track, turn in leg.turns:
                self.alleys[track].give_back(turn)
            if leg.ride is not None:
                self.lifts[leg.ride[0]].give_back(leg.ride[1])

    def forget(self, now_us: int) -> None:
        """Drop what was long over at ``now_us``."""
        for alley in self.alleys.values():
            alley.forget(now_us - KEPT_US)
        for lift in self.lifts.values():
            lift.forget(now_us - KEPT_US)


def arrival_us(legs: list[ModelLeg], ready_us: int) -> int:
    """When the last leg has ended, and was told; ``ready_us`` without legs."""
    return legs[-1].end_us + LEG_US if legs else ready_us


def _legs(chain: "_Chain | None") -> list[ModelLeg]:
    found: list[ModelLeg] = []
    while chain is not None:
        leg, chain = chain
        found.append(leg)
    return found[::-1]
