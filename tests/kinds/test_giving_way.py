"""What a machine does about another's plan: it comes later, it takes another way, or it goes on."""

import random
from typing import NamedTuple

import pytest

from onboard.contract.codes import KindCode, LegAction, TokenKind
from onboard.contract.messages import CallForProposals, Itinerary, Stamp, TokenGrant, TokenHeld
from onboard.core.authority import TokenBook
from onboard.core.negotiation import Negotiation, Proposal
from onboard.core.site import Machine, Segment, Site
from onboard.systems.car_park.giving_way import GivingWay, YieldDecision
from onboard.systems.car_park.program import CarStep, Program
from onboard.systems.car_park.standoff import Standoff
from onboard.systems.car_park.travel import Carriage
from onboard.ways.mirror import WayFleet, WayMirror
from onboard.ways.reservations import FOREVER
from onboard.ways.sipp import Route, Visit, plan_route
from onboard.ways.site import Axis, WaySite, way_site
from tests.ways.buildings import building
from tests.ways.lines import ALLEY, SPUR, line_site

#: 10 mm a segment, 1 m/s, top speed after 5 mm and 10 ms: half-millimetre arithmetic by hand, all times in 5 ms.
QUICK = Axis(1_000, 100_000)
MS = 1_000
FIRST, SECOND, THIRD = 11, 12, 13


class Nobody:
    """A task-generation function that is never asked."""

    def floor(self, call: CallForProposals, now_us: int) -> int:
        raise AssertionError

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        raise AssertionError

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        raise AssertionError


class Robot(NamedTuple):
    """What giving way needs of one machine."""

    fleet: WayFleet
    program: Program
    giving_way: GivingWay

    def told(self, now_us: int = 0) -> Itinerary:
        return self.program.itinerary(self.fleet.node_id, now_us)

    def hears(self, itinerary: Itinerary, now_us: int = 0) -> YieldDecision:
        """As the holon does it: into the mirror, then heeded."""
        assert self.fleet.mirror.on_itinerary(itinerary, now_us)
        return self.giving_way.heed(itinerary.sender, now_us)


def robot(site: WaySite, node: int, steps: list[CarStep], *, award_ms: int = 0) -> Robot:
    machine = Machine(node, f"MR{node}", KindCode.ROBOT, Segment(ALLEY, 1))
    mirror = WayMirror(site, node)
    negotiation = Negotiation(node, KindCode.ROBOT, site.timing, Nobody(), boot=1)
    fleet = WayFleet(site, machine, TokenBook(site, node), mirror, negotiation)
    program = Program(site, standing=Segment(ALLEY, 1))
    program.replace(steps, Stamp(award_ms, node, 1))
    made = Robot(fleet, program, GivingWay(fleet, program, Standoff(fleet, Carriage(fleet, fleet.machine.home.track))))
    mirror.on_itinerary(made.told(), 0)
    return made


def tell_all(robots: list[Robot]) -> None:
    for one in robots:
        for other in robots:
            if one is not other:
                other.fleet.mirror.on_itinerary(one.told(), 0)


def travel(from_index: int, to_index: int, begin_ms: int, end_ms: int) -> CarStep:
    return CarStep(LegAction.TRAVEL, ALLEY, from_index, to_index, begin_ms * MS, end_ms * MS)


def stand(index: int, begin_ms: int, end_ms: int) -> CarStep:
    return CarStep(LegAction.STAND, ALLEY, index, index, begin_ms * MS, end_ms * MS)


def pair(first_ms: int = 200, second_ms: int = 300) -> tuple[Robot, Robot]:
    """One runs from 3 to 8, the other follows from 1 to 6; both plans are known to both."""
    site = line_site(9, 10, QUICK, 10)
    one = robot(site, FIRST, [stand(3, 0, first_ms), travel(3, 8, first_ms, first_ms + 60)])
    two = robot(site, SECOND, [stand(1, 0, second_ms), travel(1, 6, second_ms, second_ms + 60)])
    tell_all([one, two])
    return one, two


def begins_ms(one: Robot) -> list[int]:
    return [step.begin_us // MS for step in one.program.remaining]


def test_p44_whoever_comes_behind_is_late_by_exactly_what_is_missing() -> None:
    one, two = pair()
    one.program.delay(1, 140 * MS)
    assert two.hears(one.told()) is YieldDecision.LATER
    # The first leaves p(1,6) 45 ms after its begin, at 385 ms; so does the second enter it after its own.
    assert begins_ms(two) == [0, 340]
    assert one.hears(two.told()) is YieldDecision.NOTHING


def test_a_delay_that_still_leaves_room_moves_nobody() -> None:
    one, two = pair()
    one.program.delay(1, 80 * MS)
    assert two.hears(one.told()) is YieldDecision.NOTHING
    assert begins_ms(two) == [0, 300]


def test_whoever_comes_first_goes_on_though_the_other_is_late_too() -> None:
    one, two = pair()
    two.program.delay(0, 500 * MS)
    assert one.hears(two.told()) is YieldDecision.NOTHING
    assert begins_ms(one) == [0, 200]


def test_a_run_in_hand_lasts_longer_and_is_not_made_longer_twice() -> None:
    one, two = pair()
    two.program.current = 1
    one.program.delay(1, 140 * MS)
    assert two.hears(one.told()) is YieldDecision.LATER
    two.fleet.mirror.on_itinerary(two.told(), 0)
    assert two.program.remaining[0].end_us == 400 * MS
    one.program.delay(1, 20 * MS)
    assert two.hears(one.told()) is YieldDecision.LATER
    assert two.program.remaining[0].end_us == 420 * MS
    two.fleet.mirror.on_itinerary(two.told(), 0)
    assert two.giving_way.heed(FIRST, 0) is YieldDecision.NOTHING


def test_of_two_plans_made_at_the_same_time_the_lower_stamp_keeps_its_windows() -> None:
    site = line_site(9, 10, QUICK, 10)
    old = robot(site, SECOND, [travel(1, 6, 0, 60)], award_ms=5)
    young = robot(site, FIRST, [travel(8, 3, 0, 60)], award_ms=6)
    assert old.hears(young.told()) is YieldDecision.NOTHING
    assert young.hears(old.told()) is YieldDecision.ANEW


def test_a_token_in_hand_outranks_the_stamp() -> None:
    site = line_site(9, 10, QUICK, 10)
    old = robot(site, SECOND, [travel(1, 6, 0, 60)], award_ms=5)
    young = robot(site, FIRST, [travel(8, 3, 0, 60)], award_ms=6)
    for one in (old, young):
        for index in range(2, 8):
            one.fleet.tokens.on_held(TokenHeld(FIRST, TokenKind.SEGMENT, Segment(ALLEY, index).number, 3))
    for index in range(2, 8):
        grant = TokenGrant(9, TokenKind.SEGMENT, Segment(ALLEY, index).number, 4, FIRST)
        young.fleet.tokens.on_grant(grant, 0)
    assert young.hears(old.told()) is YieldDecision.NOTHING
    assert old.hears(young.told()) is YieldDecision.ANEW


def test_p38_who_only_stands_gives_way_whatever_its_stamp() -> None:
    site = line_site(9, 10, QUICK, 10)
    idle = robot(site, FIRST, [stand(5, 0, 1)], award_ms=1)
    busy = robot(site, SECOND, [travel(1, 8, 100, 180)], award_ms=90)
    assert busy.hears(idle.told()) is YieldDecision.NOTHING
    assert idle.hears(busy.told()) is YieldDecision.ANEW


def test_where_there_is_no_other_way_one_comes_behind_on_the_old() -> None:
    site = line_site(9, 10, QUICK, 10)
    first = robot(site, FIRST, [stand(3, 0, 30), travel(3, 8, 30, 90)], award_ms=1)
    second = robot(site, SECOND, [stand(1, 0, 10), travel(1, 6, 10, 70)], award_ms=2)
    assert second.hears(first.told()) is YieldDecision.ANEW
    assert second.giving_way.fall_back(FIRST, 0) is YieldDecision.LATER
    second.fleet.mirror.on_itinerary(second.told(), 0)
    assert second.fleet.mirror.order.meetings(SECOND, FIRST) == []


def test_who_comes_behind_one_that_it_meets_head_on_waits_until_that_is_past() -> None:
    """On a drawn site it went by in one slot behind the other, in the next before it, and both stood face to face."""
    site = line_site(9, 10, QUICK, 10, spur_at=3)
    out = [stand(7, 0, 200), travel(7, 3, 200, 250), CarStep(LegAction.TRAVEL, SPUR, 1, 1, 250 * MS, 270 * MS)]
    first = robot(site, FIRST, out, award_ms=1)
    second = robot(site, SECOND, [stand(1, 0, 100), travel(1, 8, 100, 180)], award_ms=2)
    assert second.hears(first.told()) is YieldDecision.ANEW
    assert second.giving_way.fall_back(FIRST, 0) is YieldDecision.LATER
    second.fleet.mirror.on_itinerary(second.told(), 0)
    assert second.fleet.mirror.order.meetings(SECOND, FIRST) == []


def test_who_lets_another_pass_in_a_spur_waits_there_and_not_on_the_way_out() -> None:
    """It came out too soon and waited before the spur for who was to pass there first: both waited for ever longer."""
    site = line_site(9, 10, QUICK, 10, spur_at=4)

    def out_at(out_ms: int) -> list[CarStep]:
        inside = CarStep(LegAction.STAND, SPUR, 1, 1, 300 * MS, out_ms * MS)
        into = CarStep(LegAction.TRAVEL, SPUR, 1, 1, 280 * MS, 300 * MS)
        way_in = [stand(2, 0, 250), travel(2, 4, 250, 280), into]
        return [*way_in, inside, travel(4, 4, out_ms, out_ms + 20), travel(4, 8, out_ms + 20, out_ms + 70)]

    one = robot(site, FIRST, [stand(1, 0, 300), travel(1, 9, 300, 390)], award_ms=1)
    two = robot(site, SECOND, out_at(500), award_ms=2)
    tell_all([one, two])
    two.program.replace(out_at(300), two.program.stamp)
    two.fleet.mirror.on_itinerary(two.told(), 0)
    one.program.shift(0)
    assert two.hears(one.told()) is YieldDecision.LATER
    waits = [(step.track, step.from_index) for step in two.program.remaining if step.action is LegAction.STAND]
    assert waits == [(ALLEY, 2), (SPUR, 1)]
    one.fleet.mirror.on_itinerary(one.told(), 0)
    assert one.hears(two.told()) is YieldDecision.NOTHING


def test_nobody_comes_behind_what_another_puts_off_for_hours() -> None:
    """On a drawn site three came behind each other in turn until no time on the wire was late enough, and stood."""
    one, two = pair()
    one.program.delay(1, 2 * 3_600_000 * MS)
    assert two.hears(one.told()) is YieldDecision.NOTHING
    assert begins_ms(two) == [0, 300]


def test_what_is_over_means_nothing() -> None:
    one, two = pair()
    one.program.delay(1, 140 * MS)
    assert two.hears(one.told(), 5_000 * MS) is YieldDecision.NOTHING


# --- any plans, any delays -------------------------------------------------------------------------------------------


def planned(chance: random.Random, node: int, robots: list[Robot], place: Site) -> list[CarStep] | None:
    """A route of one robot around all others': to work somewhere, and to stand on a floor of its own."""
    mirror = WayMirror(way_site(place), node)
    for other in robots:
        mirror.on_itinerary(other.told(), 0)
    length, home = way_site(place).tracks[1].length, node - 10
    start = Segment(home, chance.randint(2, length - 1))
    goal = Segment(chance.randint(1, 3), chance.randint(2, length - 1))
    refuges = frozenset(Segment(home, index) for index in range(2, length))
    visits = (Visit(goal, 20 * MS),)
    route = plan_route(
        way_site(place), mirror.reservations, node, start, chance.randrange(50) * MS, visits, refuges, 20_000
    )
    if not isinstance(route, Route):
        return None
    return [
        CarStep(leg.action, leg.track, leg.from_index, leg.to_index, leg.begin_us, leg.end_us) for leg in route.legs
    ]


@pytest.mark.parametrize("seed", range(80))
def test_any_delay_runs_through_all_plans_and_leaves_them_without_conflict(seed: int) -> None:
    chance = random.Random(seed)
    place = building(3, 6, Axis(1_000, 1_000_000), pitch_mm=10, floor_mm=10, carrier_length_mm=10)
    robots: list[Robot] = []
    for node in (FIRST, SECOND, THIRD):
        steps = planned(chance, node, robots, place)
        if steps is not None:
            robots.append(robot(place, node, steps))
    tell_all(robots)
    unlucky = chance.choice(robots)
    unlucky.program.delay(chance.randrange(len(unlucky.program.remaining)), chance.randint(1, 400) * MS)
    to_tell = [unlucky]
    for _ in range(60):
        if not to_tell:
            break
        speaker = to_tell.pop(0)
        word = speaker.told()
        speaker.fleet.mirror.on_itinerary(word, 0)
        for other in robots:
            if other is not speaker:
                answer = other.hears(word)
                assert answer is not YieldDecision.ANEW, "a delay never makes anybody turn"
                if answer is YieldDecision.LATER and other not in to_tell:
                    to_tell.append(other)
    assert not to_tell, "the delays never come to rest"
    for one in robots:
        for other in robots:
            for witness in robots:
                meetings = witness.fleet.mirror.order.meetings(one.fleet.node_id, other.fleet.node_id)
                assert one is other or [m for m in meetings if m.mine.to_us < FOREVER] == []


def test_a_hop_out_of_a_spur_has_no_time_to_spare() -> None:
    # It holds the mouth from its very begin: a delay of who passes there before is answered in full.
    site = line_site(9, 10, QUICK, 10, spur_at=3)
    one = robot(site, FIRST, [stand(1, 0, 200), travel(1, 8, 200, 280)])
    inside = CarStep(LegAction.STAND, SPUR, 1, 1, 0, 300 * MS)
    two = robot(site, SECOND, [inside, travel(3, 3, 300, 320)])
    tell_all([one, two])
    two.program.current = 1
    two.program.shift(0)
    for each in (one, two):
        each.fleet.mirror.on_itinerary(two.told(), 0)
    one.program.delay(1, 80 * MS)
    assert two.hears(one.told()) is YieldDecision.LATER
    assert two.program.remaining[-1].end_us > 330 * MS
