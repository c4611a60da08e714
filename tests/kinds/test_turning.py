"""A carriage before, in and after a turn: what it asks for, orders and tells (design, section 5)."""

from onboard.contract.codes import DriveMode, Grade, KindCode, LegAction, Reason, Side, TokenKind
from onboard.contract.messages import (
    DriveOrder,
    DriveState,
    Itinerary,
    Leg,
    Progress,
    Stamp,
    TokenGrant,
    TokenRequest,
)
from onboard.core.authority import TokenBook, segment_token
from onboard.core.effects import Actuate, Effect, Send
from onboard.core.negotiation import Negotiation
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.systems.car_park.travel import Carriage
from onboard.ways.mirror import WayFleet, WayMirror
from tests.kinds.test_giving_way import Nobody
from tests.sites import one_floor

PITCH_MM = 2_400
MOUTH, INSIDE = Segment(1, 7), Segment(192, 1)
MOUTH_MM = 6 * PITCH_MM
ROBOT, OTHER, STEWARD = 11, 12, 1


def site() -> CarPark:
    return one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n')


def carriage() -> Carriage:
    here = site()
    negotiation = Negotiation(ROBOT, KindCode.ROBOT, here.timing, Nobody(), boot=1)
    fleet = WayFleet(here, here.machines[ROBOT], TokenBook(here, ROBOT), WayMirror(here, ROBOT), negotiation)
    return Carriage(fleet, 1)


def state(
    position_mm: int, mode: DriveMode = DriveMode.STANDING, *, across: bool = False, sequence: int = 1
) -> DriveState:
    return DriveState(ROBOT, sequence, position_mm, 0, mode, True, across)


def get(one: Carriage, slot: Segment) -> None:
    one.fleet.tokens.on_grant(TokenGrant(STEWARD, TokenKind.SEGMENT, slot.number, 1, ROBOT), 0)
    assert one.fleet.tokens.holds(segment_token(slot))


def orders(effects: list[Effect]) -> list[tuple[int, bool]]:
    return [
        (e.message.target_mm, e.message.across)
        for e in effects
        if isinstance(e, Actuate) and isinstance(e.message, DriveOrder)
    ]


def places(effects: list[Effect]) -> list[tuple[int, int, int]]:
    said = [e.message for e in effects if isinstance(e, Send) and isinstance(e.message, Progress)]
    return [(one.track, one.index, one.offset_mm) for one in said]


def in_mouth() -> Carriage:
    """It stands in the mouth, which it holds, and is to go into the spur."""
    one = carriage()
    one.sense(state(MOUTH_MM), 0)
    one.go(MOUTH)
    one.advance(0)
    get(one, MOUTH)
    one.go(INSIDE)
    return one


def test_without_the_spur_it_asks_and_stands_on_the_alley_as_before() -> None:
    one = in_mouth()
    effects = one.advance(0)
    asked = [e.message.token for e in effects if isinstance(e, Send) and isinstance(e.message, TokenRequest)]
    assert asked == [INSIDE.number] and orders(effects) == []
    assert one.occupied() == [MOUTH]
    # The drive says again slowly where it is; it is no news, and the fleet is told of the alley.
    assert places(one.sense(state(MOUTH_MM), 1)) == []
    assert places(one.statement(0)) == [(1, 7, 0)]


def test_with_both_it_is_sent_in_and_tells_of_the_turn() -> None:
    one = in_mouth()
    one.advance(0)
    get(one, INSIDE)
    assert orders(one.advance(0)) == [(0, True)]
    assert places(one.sense(state(MOUTH_MM, DriveMode.TURNING), 1)) == [(192, 0, 0)]
    assert set(one.occupied()) == {MOUTH, INSIDE}
    one.sense(state(-PITCH_MM, DriveMode.MOVING, across=True), 2)
    one.sense(state(0, across=True), 3)
    assert [one.arrived] == [False], "it has not heard the last order yet"
    one.sense(state(0, across=True, sequence=one.sequence), 3)
    assert (one.arrived, one.occupied()) == (True, [INSIDE])
    given = [e.message for e in one.advance(3) if isinstance(e, Send) and isinstance(e.message, TokenGrant)]
    assert [(m.token, m.holder) for m in given] == [(MOUTH.number, STEWARD)]


def test_arrived_it_keeps_nothing_of_a_way_for_which_it_had_asked_as_a_whole() -> None:
    # `standard --random 15 5 --cars 100 --seed 4`: a robot in the spur kept its mouth, and the street stood.
    one = in_mouth()
    one.whole.begin((MOUTH, MOUTH, INSIDE), 0)
    get(one, INSIDE)
    one.advance(0)
    one.sense(state(0, across=True, sequence=one.sequence), 3)
    given = [e.message for e in one.advance(3) if isinstance(e, Send) and isinstance(e.message, TokenGrant)]
    assert [(m.token, m.holder) for m in given] == [(MOUTH.number, STEWARD)]


def test_who_waits_by_its_plan_keeps_nothing_of_the_way_that_comes_after() -> None:
    # `changi`, overloaded: what it had asked for as a whole led out again, to where the one was that it waited for.
    one = in_mouth()
    one.whole.begin((MOUTH, INSIDE, MOUTH, Segment(1, 6)), 0)
    for slot in (INSIDE, Segment(1, 6)):
        get(one, slot)
    one.advance(0)
    one.sense(state(0, across=True, sequence=one.sequence), 3)
    one.advance(3)
    assert one.fleet.tokens.holds(segment_token(MOUTH)), "it is to go on"
    one.go(INSIDE, waits=True)
    given = [e.message for e in one.advance(3) if isinstance(e, Send) and isinstance(e.message, TokenGrant)]
    assert sorted(m.token for m in given) == [Segment(1, 6).number, MOUTH.number]


def test_a_slot_that_is_not_in_use_goes_to_who_comes_first_there_while_it_stands() -> None:
    one = in_mouth()
    get(one, INSIDE)
    one.advance(0)
    key, request = segment_token(MOUTH), TokenRequest(OTHER, TokenKind.SEGMENT, MOUTH.number, 1, 1, 0)
    way = (
        Leg(LegAction.STAND, 1, 9, 9, Side.NEAR, 1_000),
        Leg(LegAction.TRAVEL, 1, 9, 5, Side.NEAR, 9_000),
    )
    one.fleet.mirror.on_itinerary(Itinerary(OTHER, 1, Grade.FIRM, Stamp(0, OTHER, 0), way), 0)
    one.fleet.petitions.hear(key, request, 0)
    assert one.may_grant(key, OTHER, 0) is Reason.TOKEN_NOT_GRANTABLE_YET, "it stands there"
    one.sense(state(-PITCH_MM, DriveMode.MOVING, across=True), 2)
    assert one.may_grant(key, OTHER, 2) is Reason.TOKEN_NOT_GRANTABLE_YET, "it drives"
    one.target = None
    assert one.may_grant(key, OTHER, 2) is Reason.TOKEN_NOT_GRANTABLE_YET, "it drives by an order of a life before"
    one.sense(state(0, across=True, sequence=one.sequence), 3)
    assert one.may_grant(key, OTHER, 3) is Reason.NONE
    assert one.may_grant(segment_token(INSIDE), OTHER, 3) is Reason.TOKEN_NOT_GRANTABLE_YET


def test_out_it_drives_into_the_mouth_first_and_then_turns() -> None:
    one = in_mouth()
    one.advance(0)
    get(one, INSIDE)
    one.sense(state(0, across=True), 1)
    one.go(MOUTH)
    assert orders(one.advance(1)) == [(-PITCH_MM, True)]
    one.sense(state(-PITCH_MM, across=True), 2)
    assert [one.arrived] == [False]
    assert orders(one.advance(2)) == [(MOUTH_MM, False)]
    one.sense(state(-PITCH_MM, DriveMode.TURNING, across=True), 3)
    assert orders(one.advance(3)) == [], "the same order stands"
    assert places(one.sense(state(MOUTH_MM, sequence=one.sequence), 4)) == [(1, 7, 0)]
    assert (one.arrived, one.track) == (True, 1)


def test_a_way_given_up_before_the_turn_leaves_it_on_the_alley() -> None:
    one = in_mouth()
    one.go(Segment(1, 5))
    assert (one.track, one.standing_at) == (1, MOUTH)


def test_turned_into_some_spur_that_nobody_remembers_it_is_nowhere_known() -> None:
    one = carriage()
    assert one.sense(state(0, across=True), 0) == []
    one.go(Segment(1, 5))
    assert one.standing_at is None and one.occupied() == [] and orders(one.advance(0)) == []


def test_a_silent_machine_that_is_turned_in_a_mouth_stands_in_both_for_the_others() -> None:
    mirror = WayMirror(site(), ROBOT)
    mirror.on_progress(Progress(OTHER, 1, 0, 192, 0, 0, 0))
    mirror.set_aside(OTHER, frozenset((MOUTH, INSIDE)), Reason.NODE_SILENT, 0)
    assert {one.track for one in mirror.others_standing()} == {1, 192}
