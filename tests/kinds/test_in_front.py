"""No plan leads through a body: who stands in another's next run goes first beyond that, whatever rights there are."""

from onboard.contract.codes import LegAction, Reason, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Progress, TokenGrant, TokenHeld, TokenRefusal, TokenRequest
from onboard.core.authority import segment_token
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.systems.car_park.giving_way import YieldDecision
from onboard.systems.car_park.program import CarStep
from onboard.systems.car_park.travel import Carriage
from onboard.ways.sipp import Route, plan_route
from tests.kinds import test_turning as turning
from tests.kinds.test_giving_way import FIRST, MS, QUICK, SECOND, Robot, robot, stand, tell_all, travel
from tests.ways.lines import ALLEY, line_site

#: Where the two stand: the first on its way from 8 to 1, the second in it; and what is beyond.
BEHIND, BETWEEN, BEYOND = 5, 4, 2


def met(second: list[CarStep]) -> tuple[Robot, Robot]:
    """The first has all rights beyond the second, which was off while it got them, and has the lower stamp."""
    site = line_site(9, 10, QUICK, 10)
    one = robot(site, FIRST, [travel(8, 1, 0, 200)], award_ms=1)
    two = robot(site, SECOND, second, award_ms=2)
    tell_all([one, two])
    for robots in (one, two):
        robots.fleet.mirror.on_progress(Progress(FIRST, one.program.version, 0, ALLEY, BEHIND, 0, 0))
        for index in range(1, BETWEEN):
            robots.fleet.tokens.on_held(TokenHeld(FIRST, TokenKind.SEGMENT, Segment(ALLEY, index).number, 3))
    return one, two


def work(index: int, begin_ms: int, end_ms: int) -> CarStep:
    return CarStep(LegAction.WORK, ALLEY, index, index, begin_ms * MS, end_ms * MS)


def firsts(one: Robot, two: Robot, index: int) -> set[int | None]:
    """Who passes right before each of them, as each of them sees it: the same two answers of both."""
    return {
        robots.fleet.mirror.order.predecessor(node, Segment(ALLEY, index))
        for robots in (one, two)
        for node in (FIRST, SECOND)
    }


def test_who_stands_between_goes_first_whatever_rights_the_other_has_beyond() -> None:
    one, two = met([work(BETWEEN, 0, 100), travel(BETWEEN, 1, 100, 140)])
    assert two.giving_way.heed(FIRST, 0) is YieldDecision.NOTHING
    assert one.giving_way.heed(SECOND, 0) is YieldDecision.ANEW
    assert firsts(one, two, BEYOND) == {SECOND, 0}


def test_who_comes_to_where_another_stands_also_leaves_after_it() -> None:
    """Else each would wait for the other to leave first, and put that off again with each plan (seed 8109)."""
    site = line_site(9, 10, QUICK, 10)
    one = robot(site, FIRST, [travel(8, BETWEEN, 0, 80), travel(BETWEEN, 8, 80, 160)], award_ms=1)
    two = robot(site, SECOND, [work(BETWEEN, 0, 20), travel(BETWEEN, 1, 90, 120)], award_ms=2)
    tell_all([one, two])
    order = two.fleet.mirror.order
    found = order.meetings(SECOND, FIRST)
    assert {meeting.theirs.to_come for meeting in found if meeting.mine.to_come == 0} == {0, 1}
    assert {order.in_front(SECOND, FIRST, meeting) for meeting in found} == {SECOND}


def test_of_two_that_stand_in_each_others_way_neither_is_in_front() -> None:
    one, _ = met([stand(BETWEEN, 0, 150), travel(BETWEEN, 9, 150, 350)])
    order = one.fleet.mirror.order
    found = order.meetings(FIRST, SECOND)
    assert found
    assert {order.in_front(FIRST, SECOND, meeting) for meeting in found} == {NOBODY}


def test_who_works_in_anothers_run_does_not_count_on_it_to_come_past() -> None:
    _, two = met([work(BETWEEN, 0, 100)])
    mirror, here = two.fleet.mirror, Segment(ALLEY, BETWEEN)
    planned = mirror.reservations_at(here, 100 * MS, may_stay=False)
    refuges = frozenset({Segment(ALLEY, 1), Segment(ALLEY, 9)})
    route = plan_route(mirror.site, planned, SECOND, here, 100 * MS, (), refuges, 1_000)
    assert isinstance(route, Route)
    assert [(leg.from_index, leg.to_index, leg.begin_us) for leg in route.legs] == [(BETWEEN, 1, 100 * MS)]


def test_who_only_stands_where_another_should_have_passed_makes_room_as_ever() -> None:
    _, two = met([stand(BETWEEN, 0, 1)])
    mirror, here, late_us = two.fleet.mirror, Segment(ALLEY, BETWEEN), 100 * MS
    assert mirror.reservations_at(here, late_us, may_stay=True) is mirror.reservations
    assert mirror.reservations_at(here, late_us, may_stay=False) is not mirror.reservations


def given(effects: list[Effect]) -> list[int]:
    said = [one.message for one in effects if isinstance(one, Send) and isinstance(one.message, TokenGrant)]
    return sorted(grant.token & 0xFF for grant in said if grant.token & 0xFF < 7)


def waiting(carriage: Carriage) -> list[Effect]:
    """At p(1,2) on its way to p(1,6), it waits for p(1,3), and has what is beyond."""
    carriage.sense(turning.state(turning.PITCH_MM), 0)
    turning.get(carriage, Segment(1, 2))
    carriage.go(Segment(1, 6))
    carriage.advance(0)
    for index in (4, 5):
        turning.get(carriage, Segment(1, index))
    key = segment_token(Segment(1, 3))
    carriage.fleet.tokens.on_held(TokenHeld(turning.OTHER, key.kind, key.number, 1))
    refusal = TokenRefusal(turning.OTHER, key.kind, key.number, 1, turning.ROBOT, Reason.TOKEN_NOT_GRANTABLE_YET)
    carriage.fleet.tokens.on_refusal(refusal, 1)
    return carriage.advance(1) + carriage.advance(2)


def test_rights_beyond_who_stands_in_the_slot_that_is_waited_for_go_back_and_are_not_asked_for() -> None:
    carriage = turning.carriage()
    carriage.fleet.mirror.on_progress(Progress(turning.OTHER, 1, 0, 1, 3, 0, 0))
    assert given(waiting(carriage)) == [4, 5]
    carriage.fleet.tokens.refused.clear()
    asked = [one.message for one in carriage.advance(60_000_000) if isinstance(one, Send)]
    assert all(one.token & 0xFF <= 3 for one in asked if isinstance(one, TokenRequest))
    assert carriage.fleet.tokens.wanted.keys() <= {segment_token(Segment(1, index)) for index in (2, 3)}


def test_rights_are_kept_while_nobody_stands_there() -> None:
    carriage = turning.carriage()
    carriage.fleet.mirror.on_progress(Progress(turning.OTHER, 1, 0, 1, 8, 0, 0))
    assert given(waiting(carriage)) == []
