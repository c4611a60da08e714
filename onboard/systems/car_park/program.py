"""A robot's order program: chronological steps with their planned times, as data (rows P20, P23).

A step is one leg of the itinerary together with what is done in it, so the program can be printed, compared with what
happened, and sent as an itinerary, all from one value.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import CallForProposals, Itinerary, Leg, Reference, Stamp
from onboard.core.serial import from_bus_ms, successor, to_bus_ms
from onboard.core.site import Segment, Station
from onboard.ways.lifts import lift_at, platform_on, sill
from onboard.ways.occupancy import hop_origins
from onboard.ways.sipp import Route
from onboard.ways.site import WaySite
from onboard.ways.told_way import TOLERANCE_US

#: Most steps that fit in an itinerary: the leg number has 5 bits.
MAX_STEPS = 31
#: Farthest end of a leg after the stamp: 24 bits of milliseconds (4.6 h).
MAX_LEG_US = ((1 << 24) - 1) * 1000
#: A stamp that lies farther ahead of its own machine's clock than this was made by a clock that was wrong, us:
#: awards come at the end of a call, which is seconds away.
STAMP_AHEAD_US = 60_000_000


class CarHandling(StrEnum):
    """What the shuttle does with a car at a station."""

    TAKE = "take"
    LEAVE = "leave"


class HandlingPhase(StrEnum):
    """How far one handling of a car is."""

    ACQUIRE = "acquire"
    REACH = "reach"
    REFUSED = "refused"
    CLAMP = "clamp"
    RETRACT = "retract"
    DONE = "done"


class StationWork(NamedTuple):
    """One handling of ``car`` (wheelbase in mm) at ``station``, for the task of ``call``."""

    handling: CarHandling
    station: Station
    car: Reference
    wheelbase_mm: int
    call: CallForProposals


class CarStep(NamedTuple):
    """One leg with its planned ``[begin_us, end_us)`` in bus time; ``work`` where the action is WORK."""

    action: LegAction
    track: int
    from_index: int
    to_index: int
    begin_us: int
    end_us: int
    work: StationWork | None = None

    @property
    def destination(self) -> Segment:
        """The segment in which the step ends."""
        return Segment(self.track, self.to_index)

    def shifted(self, by_us: int) -> "CarStep":
        """The same step later (or earlier) by ``by_us``."""
        return self._replace(begin_us=self.begin_us + by_us, end_us=self.end_us + by_us)

    def __str__(self) -> str:
        start, end = self.begin_us / 1e6, self.end_us / 1e6
        if self.work is not None:
            text = f"{self.work.handling.value} car {self.work.car.number} at {self.work.station}"
        elif self.action is LegAction.RIDE:
            text = f"ride lift {self.track} from {self.from_index} to {self.to_index}"
        elif self.action is LegAction.TRAVEL:
            text = f"travel {Segment(self.track, self.from_index)} to {self.destination}"
        else:
            text = f"stand at {self.destination}"
        return f"[{start:.3f} {end:.3f}] {text}"


@dataclass
class Program:
    """What a robot does now and next. ``current`` indexes the step in hand.

    ``standing`` is where the last step that is over left it, never where a step to come will; it is None until the
    robot has found its place and taken up what its journal knows (``begin``), and till then nothing is planned or
    changed here: whoever tries gets ``ValueError``. ``unplanned`` are handlings in hand, after those of the steps,
    to which no way leads at present. ``version`` is the firm itinerary's 8-bit version, 0 before the first.
    """

    site: WaySite
    standing: Segment | None = None
    steps: list[CarStep] = field(default_factory=list)
    unplanned: list[StationWork] = field(default_factory=list)
    current: int = 0
    version: int = 0
    stamp: Stamp = field(default_factory=lambda: Stamp(0, 0, 0))
    #: A wait before the steps, where only it tells through which mouth the first one comes, or when it began.
    named: tuple[CarStep, ...] = ()

    @property
    def leg(self) -> int:
        """Number of the leg in hand in the itinerary as it was told last."""
        return self.current + len(self.named)

    @property
    def step(self) -> CarStep | None:
        """The step in hand, or None where all is done."""
        return self.steps[self.current] if self.current < len(self.steps) else None

    @property
    def remaining(self) -> list[CarStep]:
        """The step in hand and all later ones."""
        return self.steps[self.current :]

    def works(self) -> list[StationWork]:
        """All handlings not yet done, in order."""
        return [*(step.work for step in self.remaining if step.work is not None), *self.unplanned]

    def branch(self, now_us: int) -> tuple[int, Segment, int]:
        """From where a further task can be planned: the number of remaining steps kept, the segment and the time.

        All work in hand is kept and the way to the refuge behind it is given up, but for a run already begun. Raises
        ``ValueError`` where the robot's position is not known yet.
        """
        standing = self._place()
        remaining = self.remaining
        kept = 0
        for number, step in enumerate(remaining, start=1):
            if step.work is not None:
                kept = number
        if kept == 0 and remaining and remaining[0].action in (LegAction.TRAVEL, LegAction.RIDE):
            kept = 1
        while 0 < kept < len(remaining) and self._is_on_platform(remaining[kept - 1]):
            kept += 1
        if kept == 0:
            where = Segment(remaining[0].track, remaining[0].from_index) if remaining else standing
            return 0, where, now_us
        last = remaining[kept - 1]
        return kept, last.destination, max(last.end_us, now_us)

    def turning(self, now_us: int) -> tuple[int, Segment, int]:
        """From where the rest can be done by another way: the number of remaining steps kept, the segment and the time.

        The step in hand is kept, and what follows aboard a lift; a wait in hand is given up. Raises ``ValueError``
        where the robot's position is not known yet.
        """
        standing = self._place()
        remaining = self.remaining
        if not remaining:
            return 0, standing, now_us
        if remaining[0].action is LegAction.STAND and not self._is_on_platform(remaining[0]):
            return 0, remaining[0].destination, now_us
        kept = 1
        while kept < len(remaining) and self._is_on_platform(remaining[kept - 1]):
            kept += 1
        last = remaining[kept - 1]
        return kept, last.destination, max(last.end_us, now_us)

    def _is_on_platform(self, step: CarStep) -> bool:
        """Whether a step ends aboard a lift: nobody changes plans there."""
        return step.action is LegAction.RIDE or lift_at(self.site, step.destination) is not None

    def _place(self) -> Segment:
        if self.standing is None:
            raise ValueError("no position is known yet")
        return self.standing

    def begin(self, place: Segment, steps: list[CarStep], stamp: Stamp, unplanned: Sequence[StationWork] = ()) -> None:
        """The robot stands at ``place`` and knows what is in hand: from now on the program is there."""
        self.standing = place
        self.replace(steps, stamp, unplanned)

    def replace(self, steps: list[CarStep], stamp: Stamp, unplanned: Sequence[StationWork] = ()) -> None:
        """Take up a new programme of remaining ``steps`` under the next version."""
        self.stamp = stamp
        self.unplanned = list(unplanned)
        self._tell_anew(steps)

    def leave_out(self, tasks: Collection[Reference]) -> None:
        """What is in hand for these tasks is no more; nothing is told anew."""
        self.unplanned = [work for work in self.unplanned if work.call.task not in tasks]
        self.steps = [step for step in self.steps if step.work is None or step.work.call.task not in tasks]

    def over(self) -> None:
        """The step in hand is over: the robot stands where it ends."""
        step = self.step
        if step is not None:
            self.standing = ends_at(self.site, step)
            self.current += 1

    def shift(self, by_us: int) -> None:
        """Delay (or advance) the remaining steps; stamp and order stay, the version grows.

        A planned wait keeps its end, as it waits for something else: it takes up a delay as far as it is long enough.
        """
        self._tell_anew(_later(self.remaining, by_us))

    def lengthen(self, by_us: int) -> None:
        """The step in hand ends later, and what follows comes later; it began where it began."""
        first, *rest = _later(self.remaining, by_us)
        self._tell_anew([first._replace(begin_us=first.begin_us - by_us), *rest])

    def delay(self, number: int, by_us: int) -> None:
        """Let remaining step ``number`` begin later by ``by_us`` > 0 and stand before it; that in hand lasts longer.

        Stamp and order stay, the version grows. Where no step more can be told, the one before lasts longer instead.
        """
        steps = self.remaining
        before, after = steps[:number], steps[number:]
        if number == 0:
            first = after[0]
            rest = _later(after[1:], by_us)
            self._tell_anew([first._replace(end_us=first.end_us + by_us), *rest])
            return
        last = before[-1]
        if last.action is LegAction.STAND or len(steps) >= MAX_STEPS:
            before[-1] = last._replace(end_us=last.end_us + by_us)
        else:
            place, begin_us = last.destination, after[0].begin_us
            if last.action is LegAction.RIDE:
                place = Segment(after[0].track, after[0].from_index)
            before.append(CarStep(LegAction.STAND, place.track, place.index, place.index, begin_us, begin_us + by_us))
        self._tell_anew([*before, *_later(after, by_us)])

    def _tell_anew(self, steps: list[CarStep]) -> None:
        self._place()
        self.steps = steps
        self.named = self._named(steps)
        self.current = 0
        self.version = successor(self.version, 8)

    def _named(self, steps: list[CarStep]) -> tuple[CarStep, ...]:
        """What the first step does not tell by itself: where a hop comes from, or when a run began if after its award.

        Who hears the plan would have to take the run for one that began with the award, before all others on its way.
        """
        first = steps[0] if 0 < len(steps) < MAX_STEPS else None
        if first is None or first.action is not LegAction.TRAVEL:
            return ()
        here, begin_us = self._place(), first.begin_us
        if first.from_index != first.to_index:
            here = Segment(first.track, first.from_index)
            if begin_us - from_bus_ms(self.stamp.award_ms, begin_us) <= TOLERANCE_US:
                return ()
        elif len(hop_origins(self.site, first.destination)) == 1:
            return ()
        return (CarStep(LegAction.STAND, here.track, here.index, here.index, begin_us, begin_us),)

    def itinerary(self, sender: int, now_us: int) -> Itinerary:
        """The firm itinerary as it goes on the bus; one STAND leg where nothing is left to do."""
        steps, stamp = self.remaining, self.stamp
        if not steps:
            return standing_itinerary(sender, self.version, stamp, self._place(), now_us)
        if not _reaches(stamp, steps, now_us):
            # Hours late, or awarded while a clock was wrong: its place among the plans is that of one made now.
            stamp = stamp._replace(award_ms=to_bus_ms(now_us))
        named = () if self.current else self.named
        return to_itinerary(sender, self.version, Grade.FIRM, stamp, [*named, *steps])


def standing_itinerary(sender: int, version: int, stamp: Stamp, place: Segment, now_us: int) -> Itinerary:
    """The firm itinerary of a robot that only stands at ``place``, from ``now_us`` on: one STAND leg."""
    steps = [CarStep(LegAction.STAND, place.track, place.index, place.index, now_us, now_us + 1000)]
    # What was awarded is long done: an old award time could not be reached by the leg's 24 bits.
    return to_itinerary(sender, version, Grade.FIRM, stamp._replace(award_ms=to_bus_ms(now_us)), steps)


def steps_of(route: Route, works: Sequence[StationWork]) -> tuple[CarStep, ...]:
    """The legs of a route as steps, each WORK leg with the next work."""
    ahead = iter(works)
    return tuple(
        CarStep(
            leg.action,
            leg.track,
            leg.from_index,
            leg.to_index,
            leg.begin_us,
            leg.end_us,
            next(ahead) if leg.action is LegAction.WORK else None,
        )
        for leg in route.legs
    )


def waiting_at(bays: Collection[Station], steps: Sequence[CarStep]) -> tuple[CarStep, ...]:
    """The same steps, but a wait right before work at one of ``bays`` is part of it: there one waits for a door.

    The work begins when its robot is there, and ends when it was planned to, or sooner.
    """
    found: list[CarStep] = []
    for step in steps:
        last = found[-1] if found else step
        is_at_bay = step.work is not None and step.work.station in bays
        if is_at_bay and last.action is LegAction.STAND and last.destination == step.destination:
            found[-1] = step._replace(begin_us=last.begin_us)
        else:
            found.append(step)
    return tuple(found)


def ends_at(site: WaySite, step: CarStep) -> Segment:
    """Where a carrier is after a step; after a ride on the platform, as a position of the floor's alley."""
    if step.action is not LegAction.RIDE:
        return step.destination
    there = platform_on(site, step.track, sill(site, step.track, step.to_index).track)
    assert there is not None
    return there


def _later(steps: list[CarStep], by_us: int) -> list[CarStep]:
    """The same steps later (or earlier); a planned wait keeps its end and takes up a delay as far as it can.

    So does time that no step fills: behind a run that is very late, what follows may have been planned anew already.
    """
    shifted: list[CarStep] = []
    for step in steps:
        if shifted and by_us > 0:
            by_us = max(0, min(by_us, shifted[-1].end_us - step.begin_us))
        moved = step.shifted(by_us)
        if step.action is LegAction.STAND:
            moved = moved._replace(end_us=max(moved.begin_us, step.end_us))
            by_us = moved.end_us - step.end_us
        shifted.append(moved)
    return shifted


def to_itinerary(sender: int, version: int, grade: Grade, stamp: Stamp, steps: list[CarStep]) -> Itinerary:
    """Steps as legs on the wire; ends are rounded up to the millisecond.

    An end that a delay has pushed before the stamp, or beyond what 24 bits hold, is told as the nearest that fits.
    """
    legs = tuple(
        Leg(
            step.action,
            step.track,
            step.from_index,
            step.to_index,
            step.work.station.side if step.work is not None else Side.NEAR,
            _leg_end_ms(step.end_us, stamp.award_ms),
        )
        for step in steps
    )
    return Itinerary(sender, version, grade, stamp, legs)


def _reaches(stamp: Stamp, steps: list[CarStep], now_us: int) -> bool:
    """Whether a stamp is of before now, and all legs' ends can be told from it."""
    award_us = from_bus_ms(stamp.award_ms, now_us)
    return award_us <= now_us + STAMP_AHEAD_US and steps[-1].end_us - award_us <= MAX_LEG_US


def _leg_end_ms(end_us: int, award_ms: int) -> int:
    award_us = from_bus_ms(award_ms, end_us)
    return to_bus_ms(max(award_us, min(end_us, award_us + MAX_LEG_US)))
