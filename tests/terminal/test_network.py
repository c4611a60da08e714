"""The temporal network of the paper's section 3 (rows M09 to M22, M30 to M34), on the numbers of its Fig. 3."""

from dataclasses import replace
from itertools import pairwise

import pytest

from onboard.contract.messages import NO_REFERENCE
from onboard.contract.terminal import Action
from onboard.systems.terminal.dates import DateConstraint, StepDate
from onboard.systems.terminal.plan import ActionPlan, ActionStep, EntityStay, Load
from onboard.systems.terminal.site import Entity, EntityKind
from onboard.systems.terminal.traffic import Traffic, is_for_good
from tests.terminal.fig3 import A4, C1, L3, PRINTED, S1, S2, fig3, intervals, plan_of


def three(capacity: int) -> Traffic:
    """Three robots with the printed plan, all in area 1 at t = 10, one after the other."""
    site = fig3(capacity)
    traffic = Traffic(site)
    for owner in site.vehicles:
        plan = plan_of(site, owner, box=owner)
        steps = []
        for first, last in plan.visits():
            row = traffic.lists.get(plan.steps[first].entity, [])
            after = row[-1].key if row else EntityStay(0, 0)
            steps += [step._replace(after=after) for step in plan.steps[first : last + 1]]
        traffic.take_up(ActionPlan(owner, 1, 10, tuple(steps), plan.loads), 10)
    return traffic


def ends(traffic: Traffic, now: int = 10) -> list[int]:
    return [traffic.end_of(owner, now) for owner in traffic.plans]


def test_m09_m10_m12_m14_the_printed_plan_comes_out_to_the_second() -> None:
    site = fig3()
    traffic = Traffic(site)
    plan = plan_of(site, 11)
    traffic.take_up(plan, 10)
    found = intervals(traffic, 11, 10)
    assert [(step.action, step.entity, *at) for step, at in zip(plan.steps, found, strict=True)] == PRINTED
    assert all(end == begin for (_, end), (begin, _) in pairwise(found))
    assert (found[0][0], found[7][1], found[-1][1]) == (10, 83, 131)


def test_m13_m30_a_step_that_takes_longer_moves_all_that_follow() -> None:
    """Vector (b): lane 3 left at 55 instead of 50."""
    site = fig3()
    traffic = Traffic(site)
    traffic.take_up(plan_of(site, 11), 10)
    assert traffic.report(11, 1, 0, 40) and traffic.report(11, 1, 1, 55)
    found = intervals(traffic, 11, 55)
    assert len(found) == 13, "both steps are deleted"
    assert found[0] == (55, 60) and found[-1] == (134, 136) and found[-2] == (132, 134)
    assert not traffic.report(11, 1, 1, 56), "a report that was heard before changes nothing"


def test_m06_m16_m31_only_the_plan_that_misses_its_date_is_violated() -> None:
    """Vector (b) again: a date "before 132" is violated by one robot, and another's plan is left alone."""
    site = fig3()
    traffic = Traffic(site)
    traffic.take_up(plan_of(site, 11, before=132), 10)
    other = ActionPlan(
        12, 1, 0, (ActionStep(Action.GOTO, 7, 6), *plan_of(site, 12).steps[12:]), (Load(4, NO_REFERENCE, 31, 2),)
    )
    traffic.take_up(other, 10)
    assert traffic.violations(40) == []
    traffic.report(11, 1, 0, 40)
    traffic.report(11, 1, 1, 55)
    assert [one.owner for one in traffic.violations(55)] == [11]
    traffic.plans[11].plan = plan_of(site, 11, before=135)
    traffic.changes += 1
    assert traffic.violations(55) == [], "the end must come before the date, and 134 does"


@pytest.mark.parametrize(("capacity", "expected"), [(1, [131, 152, 173]), (0, [131, 138, 145])])
def test_m15_m19_three_robots_with_one_plan(capacity: int, expected: list[int]) -> None:
    """Vector (c): a lane for one robot, and lanes without a limit, where station and order still bind."""
    traffic = three(capacity)
    assert ends(traffic) == expected
    first, second = (dict(zip(range(15), intervals(traffic, owner, 10), strict=True)) for owner in (11, 12))
    assert second[5][0] == first[7][1] + 1 or capacity == 1, "the station is free one tick after it was left"
    assert all(second[number][1] > first[number][1] for number in (1, 3, 9)), "nobody overtakes"


def lane_alone(capacity: int) -> list[tuple[int, int]]:
    site = fig3()
    waiting = {90 + n: Entity(90 + n, f"W{n}", EntityKind.AREA, n, 0, (L3,)) for n in range(4)}
    lane = Entity(L3, "L3", EntityKind.LANE, 10, capacity, (C1,))
    site = replace(site, entities={**site.entities, **waiting, L3: lane})
    traffic = Traffic(site)
    for number in range(4):
        after = EntityStay(10 + number, 1) if number else EntityStay(0, 0)
        steps = (ActionStep(Action.GOTO, 90 + number, number), ActionStep(Action.GOTO, L3, 10, 0, after))
        traffic.take_up(ActionPlan(11 + number, 1, 0, steps), 0)
    return [intervals(traffic, owner, 0)[1] for owner in (11, 12, 13, 14)]


def test_m18_m19_one_lane_alone() -> None:
    """Vector (d): entries wished at 0, 1, 2, 3."""
    assert lane_alone(2) == [(0, 10), (1, 11), (11, 21), (12, 22)]
    assert lane_alone(1) == [(0, 10), (11, 21), (22, 32), (33, 43)]


def test_m17_the_upper_box_is_picked_up_first() -> None:
    """B4 stands on B3; whoever comes for B3 waits until B4 is up, and a tick more."""
    site = fig3()
    site = replace(site, entities={**site.entities, S2: replace(site.entities[S2], capacity=2)})
    traffic = Traffic(site, below={4: (3,)})
    traffic.take_up(plan_of(site, 11, box=4), 10)
    steps = (
        ActionStep(Action.GOTO, A4, 10),
        *(one._replace(after=EntityStay(11, 5)) for one in plan_of(site, 12).steps[5:8]),
    )
    traffic.take_up(ActionPlan(12, 1, 60, steps, (Load(3, NO_REFERENCE, 2, 31),)), 10)
    dates = intervals(traffic, 12, 10)
    assert dates[1] == (70, 82) and dates[2] == (82, 84), "docked from 70 on; the upper one is up at 81"


def test_m20_crossings_and_areas_have_no_limit_where_the_site_says_none() -> None:
    traffic = three(0)
    at = [intervals(traffic, owner, 10) for owner in traffic.plans]
    assert [one[2] for one in at] == [(50, 55), (51, 56), (52, 57)], "three bodies in one crossing at once"
    assert [one[0] for one in at] == [(10, 40), (10, 41), (10, 42)]


def test_m22_m34_a_delay_moves_the_dates_of_all_robots() -> None:
    traffic = three(1)
    before = ends(traffic)
    traffic.report(11, 1, 0, 40)
    traffic.report(11, 1, 1, 60)
    assert ends(traffic, 60) == [end + 10 for end in before]


def test_m31_plans_that_wait_for_each_other_are_told_by_the_later_one() -> None:
    site = fig3(1)
    traffic = Traffic(site)
    steps = (ActionStep(Action.GOTO, 1, 1), ActionStep(Action.GOTO, S1, 5, 0), ActionStep(Action.GOTO, S2, 5, 0))
    other = (
        ActionStep(Action.GOTO, 1, 1),
        ActionStep(Action.GOTO, S2, 5, 0),
        ActionStep(Action.GOTO, S1, 5, 0, EntityStay(0, 0)),
    )
    traffic.take_up(ActionPlan(11, 1, 0, steps), 0)
    traffic.take_up(ActionPlan(12, 1, 1, other), 0)
    for entity in (S1, S2):
        traffic.lists[entity].sort(key=lambda visit: visit.first == 1)
    traffic.changes += 1
    assert [one.owner for one in traffic.violations(0)] == [12]


def test_m03_m32_a_blocked_lane_holds_up_whoever_goes_there() -> None:
    site = fig3()
    traffic = Traffic(site)
    traffic.take_up(plan_of(site, 11), 10)
    traffic.blocked[L3] = 12
    assert intervals(traffic, 11, 12)[1] == (40, 50), "it may be free again by then"
    traffic.blocked[L3] = 30
    assert intervals(traffic, 11, 30)[1] == (40, 60)
    assert intervals(traffic, 11, 70)[1] == (70, 80)
    assert traffic.through(L3) == [11]


def by_the_dates(traffic: Traffic, now: int) -> tuple[frozenset[int], frozenset[int]]:
    """Who leaves where it is, and who ends its plan, only by help: worked out from the dates of this very moment."""
    dates = traffic.dates(now).at
    late = {node for node, date in dates.items() if is_for_good(date, now)}
    plans = traffic.plans.items()
    here = frozenset(owner for owner, owned in plans if StepDate(owner, owned.current + 1) in late)
    return here, frozenset(owner for owner, owned in plans if StepDate(owner, len(owned.plan.steps)) in late)


def test_who_waits_for_one_that_is_out_is_known_at_any_later_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was worked out from all dates at each event of each vehicle: a third of what a disturbed yard cost."""
    traffic = three(capacity=1)
    networks: list[int] = []
    patience, network = traffic.site.patience_us, Traffic._network

    def counted(self: Traffic, now: int) -> tuple[dict[StepDate, int], list[DateConstraint]]:
        networks.append(now)
        return network(self, now)

    first, second, third = traffic.plans
    traffic.out[second], traffic.changes = 40, traffic.changes + 1
    seen = []
    for now in (40, 39 + patience, 40 + patience, 41 + patience, 10**9 + patience):
        seen.append(by_the_dates(traffic, now))
        with monkeypatch.context() as patched:
            patched.setattr(Traffic, "_network", counted)
            at_the_end = frozenset(owner for owner in traffic.plans if traffic.waits_for_good(owner, now))
            assert (traffic.stuck(now), at_the_end) == seen[-1], now
    assert not any(seen[0] + seen[1]) and seen[2] == seen[4] == (frozenset({second, third}), frozenset({second, third}))
    traffic.out, traffic.changes = {first: 40}, traffic.changes + 1
    assert traffic.stuck(50 + patience) == by_the_dates(traffic, 50 + patience)[0] == set(traffic.plans)
    networks.clear()
    with monkeypatch.context() as patched:
        patched.setattr(Traffic, "_network", counted)
        assert all(traffic.waits_for_good(owner, now + patience) for owner in traffic.plans for now in range(60, 99))
    assert not networks
