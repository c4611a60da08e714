"""Alleys and lifts as servers: who has which stretch, or which platform, from when to when.

A run's track is held in parts (``ways.MOST_PARTS``), each until it is left, so that one follows another; the plant's
slots are freed one by one. Who works or rests holds where it stands. A platform is held from when somebody drives onto
it until he has left it, and goes empty from stop to stop in between (``onboard.ways.lift_uses``).
"""

from bisect import bisect_right, insort
from dataclasses import dataclass, field
from typing import NamedTuple

from bus_sim.systems.car_park.design.times import RIDE_US
from onboard.ways.kinematics import RestToRest, time_at_us
from onboard.ways.lift_uses import run_up_us
from onboard.ways.site import WaySite

#: Of what was over so long ago nobody asks any more, us: a call is made half a minute ahead at most.
KEPT_US = 60_000_000


class Stretch(NamedTuple):
    """A robot's turn in a stretch of an alley, from index to index, both included; times in us."""

    begin_us: int
    end_us: int
    low: int
    high: int
    owner: int


class PlatformUse(NamedTuple):
    """A robot's turn on a platform, from the stop where it boards to that where it leaves."""

    begin_us: int
    end_us: int
    board: int
    leave: int


@dataclass
class AlleyServer:
    """The turns of one alley or spur, in the order in which they begin; those in other parts of it may overlap."""

    turns: list[Stretch] = field(default_factory=list)

    def free_from(self, ready_us: int, lasts_us: int, low: int, high: int, owner: int) -> int:
        """When a stretch is free of others for so long, from ``ready_us`` on."""
        begin_us, waits = ready_us, True
        while waits:
            waits = False
            for turn in self.turns:
                if turn.begin_us >= begin_us + lasts_us:
                    break
                meets = turn.end_us > begin_us and turn.low <= high and low <= turn.high
                if meets and turn.owner != owner:
                    begin_us, waits = turn.end_us, True
        return begin_us

    def next_turn(self, time_us: int, index: int, owner: int) -> Stretch | None:
        """The next turn of another from ``time_us`` on over an index, or the one that is under way."""
        for turn in self.turns:
            if turn.end_us > time_us and turn.low <= index <= turn.high and turn.owner != owner:
                return turn
        return None

    def take(self, turn: Stretch) -> None:
        """Take a turn that is free."""
        insort(self.turns, turn)

    def give_back(self, turn: Stretch) -> None:
        """A turn that was taken is not needed."""
        self.turns.remove(turn)

    def forget(self, before_us: int) -> None:
        """Drop turns that are long over."""
        self.turns = [turn for turn in self.turns if turn.end_us > before_us]


@dataclass
class LiftServer:
    """One lift by its track; it stands at its first stop at the start."""

    site: WaySite
    track: int
    uses: list[PlatformUse] = field(default_factory=list)
    _ride_us: dict[tuple[int, int], int] = field(default_factory=dict)
    _empty_us: dict[tuple[int, int], int] = field(default_factory=dict)
    _stands_at: int = 1
    used_us: int = 0
    edge_us: int = field(init=False)

    def __post_init__(self) -> None:
        # From crossing the sill to standing on the platform: the last pitch of a run, braking.
        pitch_mm = self.site.tracks[self.site.tracks[self.track].joins[0].track].pitch_mm
        run = RestToRest(2 * pitch_mm, self.site.carrier)
        self.edge_us = time_at_us(run, 2 * pitch_mm) - time_at_us(run, pitch_mm)

    def ride_us(self, board: int, leave: int) -> int:
        """How long a ride takes."""
        found = self._ride_us.get((board, leave))
        if found is None:
            found = self._ride_us[board, leave] = run_up_us(self.site, self.track, board, leave) + RIDE_US
        return found

    def _empty(self, here: int, there: int) -> int:
        found = self._empty_us.get((here, there))
        if found is None:
            found = self._empty_us[here, there] = run_up_us(self.site, self.track, here, there)
        return found

    def boards_at(self, ready_us: int, board: int, leave: int, called_us: int = 0) -> int:
        """When a robot that could be aboard at ``ready_us`` is: the platform has come, and nobody else misses it.

        It sets off for nobody before he has said that he comes, at ``called_us``.
        """
        lasts_us, free_us, here = self.ride_us(board, leave) + self.edge_us, 0, self._stands_at
        # Before who boards sooner than that there is no gap for it.
        first = bisect_right(self.uses, ready_us, key=lambda use: use.begin_us)
        if first:
            free_us, here = self.uses[first - 1].end_us, self.uses[first - 1].leave
        for use in self.uses[first:]:
            begin_us = max(ready_us, max(free_us, called_us) + self._empty(here, board) + self.edge_us)
            if begin_us + lasts_us + self._empty(leave, use.board) <= use.begin_us:
                return begin_us
            free_us, here = use.end_us, use.leave
        return max(ready_us, max(free_us, called_us) + self._empty(here, board) + self.edge_us)

    def use(self, aboard_us: int, board: int, leave: int) -> PlatformUse:
        """What a ride that begins at ``aboard_us`` takes of the platform's time."""
        end_us = aboard_us + self.ride_us(board, leave) + self.edge_us
        return PlatformUse(aboard_us - self.edge_us, end_us, board, leave)

    def meet(self, one: PlatformUse, other: PlatformUse) -> bool:
        """Whether the platform cannot serve both, going empty from one to the other."""
        first, second = sorted((one, other))
        return first.end_us + self._empty(first.leave, second.board) > second.begin_us

    def take(self, use: PlatformUse) -> None:
        """Take a use that is free."""
        insort(self.uses, use)
        self.used_us += use.end_us - use.begin_us

    def give_back(self, use: PlatformUse) -> None:
        """A use that was taken is not needed."""
        self.uses.remove(use)
        self.used_us -= use.end_us - use.begin_us

    def forget(self, before_us: int) -> None:
        """Drop uses that are long over; the last of them says where the platform stands."""
        while self.uses and self.uses[0].end_us <= before_us:
            self._stands_at = self.uses.pop(0).leave
