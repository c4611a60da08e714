"""A lift's phases: each meets all that its sensors, rights, journal and the robots' plans may come to."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import DriveMode, Grade, LegAction, Reason, Side
from onboard.contract.messages import DriveOrder, DriveState, Itinerary, Leg, PlatformState, Progress, Stamp
from onboard.core.authority import segment_token
from onboard.core.effects import Actuate, Effect, Record
from onboard.core.motion_authority import acts
from onboard.holon.holon import Holon
from onboard.systems.car_park.lift import Lift, Ride
from onboard.systems.car_park.lift_steps import LIFT_TABLE, LiftDeed, LiftFinding, LiftPhase
from onboard.systems.car_park.records import RideOverRecord, RideRecord
from onboard.systems.car_park.site import car_park
from onboard.systems.registry import factory_for
from onboard.ways.lifts import gate, platform

SITE = car_park(find_site("small"))
BAY, LIFT, ROBOT, SHAFT = 1, 5, 11, 128
BOARD, LEAVE = 2, 3
PITCH_MM = SITE.tracks[SHAFT].pitch_mm
NOW_US = 10_000_000


@dataclass(frozen=True)
class Words:
    """Where the lift is, what its platform senses, who has which right, and which ride the robot's plan has."""

    index: int
    moves: bool
    is_aboard: bool
    is_crossing: bool
    is_gate_out: bool
    is_platform_out: bool
    #: Floors of the ride that the robot plans: from where it is aboard it may plan another.
    plan: tuple[int, int] | None
    was_out: bool = False
    in_journal: bool = False


FLAGS = (False, True)
PLANS = (None, (BOARD, LEAVE), (LEAVE, BOARD))
ALL = [
    Words(index, moves, is_aboard, is_crossing, is_gate_out, is_platform_out, plan, was_out, in_journal)
    for index, (moves, is_aboard, is_crossing, is_gate_out, is_platform_out), plan, was_out, in_journal in product(
        (BOARD, LEAVE), product(FLAGS, repeat=5), PLANS, FLAGS, FLAGS
    )
]


def words_for(phase: LiftPhase) -> Iterator[Words]:
    """What can be in a phase: only STARTING reads the journal, only BOARDING looks back at the gate."""
    for words in ALL:
        if words.in_journal and phase is not LiftPhase.STARTING:
            continue
        if words.was_out and phase is not LiftPhase.BOARDING:
            continue
        yield words


def lift(phase: LiftPhase, words: Words) -> Lift:
    machine = SITE.machines[LIFT]
    entries = [RideRecord(ROBOT, BOARD, LEAVE).entry] if words.in_journal else []
    one = Holon(SITE, machine, factory_for(SITE, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(one, Lift)
    one.fleet.tokens.trust()
    one.fleet.motion.why_still = acts
    if words.plan is not None:
        leg = Leg(LegAction.RIDE, SHAFT, *words.plan, Side.NEAR, 60_000)
        one.fleet.mirror.on_itinerary(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(1, BAY, 1), (leg,)), NOW_US)
        one.fleet.mirror.on_progress(Progress(ROBOT, 1, 0, SHAFT, words.plan[0], 0, 0))
    one.phase = phase
    if phase in (LiftPhase.BOARDING, LiftPhase.RIDING, LiftPhase.LEAVING):
        one.ride = Ride(ROBOT, BOARD, LEAVE, 0)
    if words.was_out:
        one.sense(at(BOARD, moves=False), NOW_US)
        assert one.may_grant(segment_token(gate(SHAFT)), ROBOT, NOW_US) is Reason.NONE
    one.sense(at(words.index, moves=words.moves), NOW_US)
    one.sense(PlatformState(LIFT, words.is_aboard, words.is_crossing, 0), NOW_US)
    for slot, is_out in ((gate(SHAFT), words.is_gate_out), (platform(SHAFT), words.is_platform_out)):
        if is_out:
            one.fleet.tokens.give(segment_token(slot), ROBOT, NOW_US)
    return one


def at(index: int, *, moves: bool) -> DriveState:
    return DriveState(LIFT, 0, (index - 1) * PITCH_MM, 0, DriveMode.MOVING if moves else DriveMode.STANDING, not moves)


def stands(words: Words, index: int) -> bool:
    return not words.moves and words.index == index


def meant(phase: LiftPhase, words: Words) -> LiftFinding:
    """What the words come to, told once more."""
    is_inside = words.is_aboard and not words.is_crossing
    match phase:
        case LiftPhase.STARTING:
            return meant_at_start(words)
        case LiftPhase.FREE:
            return LiftFinding.WANTED if words.plan is not None else LiftFinding.NOTHING
        case LiftPhase.BOARDING:
            if words.was_out and not words.is_gate_out and is_inside:
                return LiftFinding.ABOARD
            return LiftFinding.NOTHING if words.is_platform_out else LiftFinding.GIVEN_UP
        case LiftPhase.RIDING:
            return LiftFinding.THERE if stands(words, LEAVE) else LiftFinding.ON_THE_WAY
    if not words.is_gate_out and not words.is_platform_out:
        return LiftFinding.OUT
    rides_on = is_inside and not words.is_gate_out and words.plan == (LEAVE, BOARD)
    return LiftFinding.ONWARD if rides_on else LiftFinding.NOTHING


def meant_at_start(words: Words) -> LiftFinding:
    if words.moves:
        return LiftFinding.NOTHING
    if not words.is_platform_out:
        return LiftFinding.NOTHING if words.is_aboard or words.is_crossing else LiftFinding.CLEAR
    if words.in_journal:
        return LiftFinding.RIDE_AT_END if words.index == LEAVE else LiftFinding.RIDE_BEGUN
    is_carried = words.is_aboard and not words.is_crossing and not words.is_gate_out and words.plan is not None
    if is_carried and words.plan is not None and words.plan[1] == words.index:
        return LiftFinding.RIDE_AT_END
    plans_from_here = words.plan is not None and words.plan[0] == words.index
    if plans_from_here:
        return LiftFinding.RIDE_PLANNED
    return LiftFinding.RIDE_BEGUN if is_carried else LiftFinding.NOTHING


def expected(phase: LiftPhase, words: Words) -> tuple[LiftPhase, list[object]]:
    """The phase that follows, what is written, and to which floor the drive is sent."""
    following, deed = LIFT_TABLE[phase, meant(phase, words)]
    end = LEAVE if words.plan != (LEAVE, BOARD) or phase is not LiftPhase.LEAVING else BOARD
    match deed:
        case LiftDeed.TO_BOARD:
            assert words.plan is not None
            return following, goes(words, words.plan[0])
        case LiftDeed.SET_OFF:
            begun = RideRecord(ROBOT, LEAVE if end == BOARD else BOARD, end)
            return following, [begun, *goes(words, end)]
        case LiftDeed.TO_END:
            return following, goes(words, LEAVE)
        case LiftDeed.END:
            # A ride that its robot still plans from where it began is made; another is the next.
            after = goes(words, LEAVE) if words.plan == (LEAVE, BOARD) else []
            return following, [RideOverRecord(ROBOT), *after]
    return following, []


def goes(words: Words, index: int) -> list[object]:
    """Only with its gate, and with nothing over the sill."""
    may = not words.is_gate_out and not words.is_crossing
    return [(index - 1) * PITCH_MM] if may and not stands(words, index) else []


def told(effects: list[Effect]) -> Iterator[object]:
    for one in effects:
        match one:
            case Record(RideRecord() | RideOverRecord() as record):
                yield record
            case Actuate(DriveOrder() as order):
                yield order.target_mm


@pytest.mark.parametrize("phase", LiftPhase)
def test_every_phase_meets_every_word(phase: LiftPhase) -> None:
    for words in words_for(phase):
        one = lift(phase, words)
        effects = one.advance(NOW_US)
        assert (one.phase, list(told(effects))) == expected(phase, words), words


@pytest.mark.parametrize("phase", LiftPhase)
def test_the_platform_goes_to_the_robot_of_the_next_ride_where_that_begins_and_only_from_a_free_lift(
    phase: LiftPhase,
) -> None:
    for words in words_for(phase):
        if words.is_platform_out:
            continue
        one = lift(phase, words)
        is_given = one.may_grant(segment_token(platform(SHAFT)), ROBOT, NOW_US) is Reason.NONE
        is_next = words.plan is not None and stands(words, words.plan[0])
        assert is_given is (phase is LiftPhase.FREE and is_next)
        assert one.phase is (LIFT_TABLE[phase, LiftFinding.GRANTED][0] if is_given else phase)


def test_after_a_ride_the_gate_goes_to_who_has_the_platform_still() -> None:
    """Behind the platform it would keep the ride from ending: who is off may want the next one, and wait for that."""
    for words in words_for(LiftPhase.LEAVING):
        if words.is_gate_out:
            continue
        one = lift(LiftPhase.LEAVING, words)
        is_given = one.may_grant(segment_token(gate(SHAFT)), ROBOT, NOW_US) is Reason.NONE
        rides_on = words.plan == (LEAVE, BOARD)
        assert is_given is (words.is_platform_out and stands(words, LEAVE) and not rides_on), words


def test_a_line_of_the_table_is_for_what_can_be() -> None:
    met = {(phase, meant(phase, words)) for phase in LiftPhase for words in words_for(phase)}
    assert met | {(LiftPhase.FREE, LiftFinding.GRANTED)} == set(LIFT_TABLE)


@pytest.mark.parametrize(("told_of", "orders"), [(0, 1), (1, 1), (9, 1), (11, 0)])
def test_who_is_aboard_and_tells_a_plan_that_rides_on_is_carried_on(told_of: int, orders: int) -> None:
    """A robot that a power cut caught on the sill came back aboard and planned anew: it was let out time and again.

    It has said of that plan only that it is told, as it stands where it did; by a word of a later plan, which was
    missed, it may be anywhere in that.
    """
    one = lift(LiftPhase.LEAVING, Words(LEAVE, False, True, False, False, True, None))
    leg = Leg(LegAction.RIDE, SHAFT, LEAVE, BOARD, Side.NEAR, 60_000)
    one.fleet.mirror.on_progress(Progress(ROBOT, told_of, 3, SHAFT, LEAVE, 0, 0))
    one.fleet.mirror.on_itinerary(Itinerary(ROBOT, 10, Grade.FIRM, Stamp(1, BAY, 1), (leg,)), NOW_US)
    said = one.advance(NOW_US)
    assert len([effect for effect in said if isinstance(effect, Actuate)]) == orders
