"""MARTHA's vectors (rows M06 to M34) as they travel: plans, calls, reports, and what a listener makes of them."""

import re
from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import pytest

from bus_sim.options import RunOptions
from bus_sim.sites import find_site, site_text
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalRun
from onboard.config.site import parse_site
from onboard.contract.codes import CallResult
from onboard.contract.messages import Award, Bid, CallForProposals, CarAt, Heartbeat
from onboard.contract.terminal import LaneState, PlanHead, PlanStep, PlanTask, StepReport, TaskTerms
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.vehicle import terminal
from tests.cut import Timed, first_of, shown_at
from tests.terminal import fig3
from tests.terminal.bus_fig3 import ROBOTS, SECOND, ended_ms, head, held, listener, missions, said, site, steps

R1, R2, R3 = ROBOTS
THREE = missions("B4", "B3", "B2")
#: The paper's first step begins at 10.
BEGIN = 10
#: Plans are adopted, and told, before this; the first step is over long after, s.
TOLD_S = 8
#: When R1 leaves area 1, and lane 3, where nobody is in its way, by its plan, s.
ENTERS_S, LEAVES_S = 36, 46


def as_printed(heard: Sequence[Timed], robot: int) -> list[tuple[float, float]]:
    """[st et] of each step of a robot's first plan, s, the first robot's beginning being the paper's 10."""
    zero, begin = head(heard, R1).begin_ms, head(heard, robot).begin_ms
    assert len(steps(heard, robot, 1)) == len(fig3.PRINTED)
    ends = [begin, *(begin + one.end_ms for one in steps(heard, robot, 1))]
    return [(BEGIN + (st - zero) / 1000, BEGIN + (et - zero) / 1000) for st, et in pairwise(ends)]


def dates_us(mirror: TerminalMirror, robot: int, now_us: int) -> list[tuple[int, int]]:
    """[st et] of each step that is left, as a listener knows them, us; raises ``AssertionError`` without a plan."""
    assert robot in mirror.traffic.plans
    return fig3.intervals(mirror.traffic, robot, now_us)


def test_m09_m10_m12_m14_the_printed_plan_travels_to_the_second() -> None:
    """Vector (a): fifteen elementary actions, loading and unloading, each from the end of the one before."""
    names = {one.number: one.name.replace("Area ", "A").replace("Lane ", "L") for one in fig3.fig3().entities.values()}
    names = {number: name.replace("Crossing ", "C").replace("Station ", "S") for number, name in names.items()}
    printed = [(action, names[entity], float(st), float(et)) for action, entity, st, et in fig3.PRINTED]
    where = site(1, THREE)

    def check(heard: Sequence[Timed]) -> None:
        told = zip(steps(heard, R1, 1), as_printed(heard, R1), strict=True)
        assert [(one.action, where.entities[one.entity].name, *at) for one, at in told] == printed
        zero_us = head(heard, R1).begin_ms * 1000 - BEGIN * SECOND
        known = dates_us(listener(where, heard, TOLD_S * SECOND), R1, TOLD_S * SECOND)
        assert [(st - zero_us, et - zero_us) for st, et in known] == [
            (st * SECOND, et * SECOND) for _, _, st, et in fig3.PRINTED
        ]
        _, load = first_of(heard, PlanTask, lambda one: one.sender == R1)
        assert (load.pick, load.put, where.boxes[load.box - 1].name) == (6, 13, "B3")

    shown_at(check, said(1, THREE, until_s=TOLD_S), PlanHead, PlanStep, PlanTask)


@pytest.mark.parametrize(("capacity", "ends"), [(1, [131, 152, 173]), (2, [131, 138, 152]), (9, [131, 138, 145])])
def test_m15_m18_m19_m20_three_plans_of_one_moment_travel_as_the_vectors_say(capacity: int, ends: list[int]) -> None:
    """Vector (c): lanes for one robot, for two, and as good as without a limit."""

    def check(heard: Sequence[Timed]) -> None:
        first, second, third = (as_printed(heard, robot) for robot in ROBOTS)
        assert [one[14][1] for one in (first, second, third)] == ends
        assert second[5][0] == max(first[7][1] + 1, second[4][0] + 10), "one tick after the station was left"
        if capacity == 2:
            assert second[:6] == [(10.048, 41), (41, 51), (51, 56), (56, 68), (68, 84), (84, 86)]
        if capacity == 9:
            assert [one[2] for one in (first, second, third)] == [(50, 55), (51, 56), (52, 57)], "all in one crossing"

    shown_at(check, said(capacity, THREE, until_s=TOLD_S), PlanHead, PlanStep)


def test_m20_a_crossing_holds_one_robot_unless_the_site_says_more() -> None:
    """Of three that come a tick apart the second enters it one tick after the first has left."""

    def check(heard: Sequence[Timed]) -> None:
        assert [as_printed(heard, robot)[2] for robot in ROBOTS] == [(50, 55), (56, 61), (62, 67)]

    shown_at(check, said(9, THREE, until_s=TOLD_S, crossing=1), PlanHead, PlanStep)


def test_m02_in_a_stacker_every_box_can_be_had() -> None:
    """The lowest of four is called for, and planned, at once; in a stack nobody calls for it."""
    stack = [one for _, one in said(2, missions("B1"), "stack", until_s=15)]
    assert not [one for one in stack if isinstance(one, CallForProposals | PlanTask)]

    def check(heard: Sequence[Timed]) -> None:
        _, call = first_of(heard, CallForProposals)
        _, load = first_of(heard, PlanTask)
        assert (call.car.number, load.box) == (1, 1)

    shown_at(check, said(2, missions("B1"), until_s=15), CallForProposals, PlanTask)


def visits_ms(heard: Sequence[Timed], where: str) -> list[tuple[int, int, int]]:
    """Who was in an entity from when to when, in the order of their coming, by the robots' own reports."""
    number = site(2, THREE).by_name[where].number
    ended, found = ended_ms(heard), []
    for robot, version, step in ended:
        way = {one.step: one.entity for one in steps(heard, robot, version)}
        if way.get(step) == number and way.get(step + 1) != number:
            gone = ended[robot, version, step]
            mine = [(which, at) for (who, _, which), at in ended.items() if who == robot]
            come = [at for which, at in mine if at < gone and way.get(which) != number]
            found += [(max(come), gone, robot)] if come else []
    return sorted(found)


def test_m15_m18_m19_what_the_robots_report_keeps_order_capacity_and_station() -> None:
    """Vector (d) driven: in lanes for two nobody overtakes and no third is inside; one robot at a station at a time."""

    def check(heard: Sequence[Timed]) -> None:
        for lane in ("L3", "L2", "L11"):
            stays = visits_ms(heard, lane)
            assert len(stays) == 3
            for one, two in pairwise(stays):
                assert one[1] < two[1], "nobody overtakes"
            assert stays[2][0] > stays[0][1], "the third comes when the first has left"
        assert any(one[0] < two[0] < one[1] for lane in ("L3", "L2") for one, two in pairwise(visits_ms(heard, lane)))
        for station in ("S2", "S1"):
            stays = visits_ms(heard, station)
            assert len(stays) >= 2
            assert all(one[1] < two[0] for one, two in pairwise(stays))

    shown_at(check, said(2, THREE), PlanStep, StepReport)


# --- delays -----------------------------------------------------------------------------------------------------------


def test_m13_m30_a_step_that_takes_longer_is_reported_and_moves_all_that_follow() -> None:
    """Vector (b): R1 is held at the end of lane 3 and leaves it 5 s late: the end is 136 and not 131."""
    more = missions("B4") + held("R1", 40, LEAVES_S + 5 - 40)

    def check(heard: Sequence[Timed]) -> None:
        at_us, report = first_of(heard, StepReport, lambda one: (one.sender, one.step) == (R1, 1))
        begun_us, _ = first_of(heard, StepReport, lambda one: (one.sender, one.step) == (R1, 0))
        before = dates_us(listener(site(1, more), heard, begun_us), R1, begun_us)
        after = dates_us(listener(site(1, more), heard, at_us), R1, at_us)
        late_us = report.at_ms * 1000 - before[0][1]
        assert late_us == pytest.approx(5 * SECOND, abs=400_000)
        assert after[0][0] == report.at_ms * 1000, "the report's time is the beginning of the next"
        assert after == [(st + late_us, et + late_us) for st, et in before[1:]], "all others moved"
        zero_us = head(heard, R1).begin_ms * 1000 - BEGIN * SECOND
        assert round((after[-1][1] - zero_us) / SECOND) == 136
        put_us = ended_ms(heard).get((R1, 1, 13), 0) * 1000
        assert 0 <= put_us - after[-2][1] < SECOND // 2, "and so it went"

    shown_at(check, said(1, more), PlanHead, PlanStep, StepReport)


def test_m22_m34_one_robots_delay_is_known_of_all_at_once() -> None:
    """In lanes for one robot the two behind it are later by what it is late, the moment that it reports."""
    more = THREE + held("R1", 40, LEAVES_S + 10 - 40)
    where = site(1, more)

    def check(heard: Sequence[Timed]) -> None:
        at_us, report = first_of(heard, StepReport, lambda one: (one.sender, one.step) == (R1, 1))
        planned_us = (ENTERS_S + 1) * SECOND
        before, after = listener(where, heard, planned_us), listener(where, heard, at_us)
        late_us = report.at_ms * 1000 - dates_us(before, R1, planned_us)[0][1]
        assert late_us > 9 * SECOND
        moved = [dates_us(after, robot, at_us)[-1][1] - dates_us(before, robot, planned_us)[-1][1] for robot in ROBOTS]
        assert moved == [pytest.approx(late_us, abs=2_000)] * 3

    shown_at(check, said(1, more, until_s=70), PlanHead, PlanStep, StepReport)


def test_m06_m16_only_the_plan_that_misses_its_date_is_violated() -> None:
    """A date "before 16:03" travels with the call in ms from the day's begin; held for long, R1 alone will miss it."""
    more = missions("B4", before="16:03") + missions("B3", "B2") + held("R1", 45, 120)
    where = site(2, more)

    def check(heard: Sequence[Timed]) -> None:
        called = {one.task: one.car.number for _, one in heard if isinstance(one, CallForProposals)}
        terms = {called.get(one.task): one.before_ms for _, one in heard if isinstance(one, TaskTerms)}
        assert terms == {4: 180_000, 3: 0, 2: 0}
        mine = [one.sender for _, one in heard if isinstance(one, PlanTask) and one.box == 4]
        assert mine[:1] == [R1]
        for at_s, late in ((ENTERS_S + 1, []), (LEAVES_S + 40, []), (103, [R1])):
            mirror = listener(where, heard, at_s * SECOND)
            assert mirror.traffic.plans.keys() == set(ROBOTS)
            assert [one.owner for one in mirror.traffic.violations(at_s * SECOND)] == late, at_s

    shown_at(check, said(2, more, until_s=104), CallForProposals, TaskTerms, PlanHead, PlanStep, PlanTask)


# --- which box, which robot, which way --------------------------------------------------------------------------------

FOUR = '\n[[missions]]\nat_s = 5\nload = 4\ntype = "T1"\nfrom = "A4"\nto = "S1"\n'
#: By then the fourth box is picked up, s.
FOUR_S = 190


def test_m23_a_box_is_called_for_when_the_one_above_it_is_in_a_plan_and_taken_after_it() -> None:
    """A stack of four: from the top, each call behind the plan with the box above, each picked up behind that one."""

    def check(heard: Sequence[Timed]) -> None:
        called = {one.car.number: at for at, one in reversed(heard) if isinstance(one, CallForProposals)}
        planned = {one.box: at for at, one in reversed(heard) if isinstance(one, PlanTask)}
        assert sorted(called, key=lambda box: called[box]) == [4, 3, 2, 1]
        assert planned.keys() >= {4, 3, 2} and all(planned[above] < called[above - 1] for above in (4, 3, 2))
        ended = ended_ms(heard)
        loads = {(one.sender, one.version, one.pick): one.box for _, one in heard if isinstance(one, PlanTask)}
        taken = {loads[key]: at for key, at in ended.items() if key in loads}
        assert sorted(taken, key=lambda box: taken[box]) == [4, 3, 2, 1]

    shown_at(check, said(2, FOUR, "stack", FOUR_S), CallForProposals, PlanTask, StepReport)


def test_m17_who_comes_for_the_lower_box_waits_until_the_upper_one_is_up() -> None:
    """R1 stands beside the stack and is held while B4 is called for; then it plans, and goes, behind who has it."""
    more = missions("B4") + missions("B3", at_s=12) + held("R1", 1, 9)

    def check(heard: Sequence[Timed]) -> None:
        loads = {(one.sender, one.version, one.pick): one.box for _, one in heard if isinstance(one, PlanTask)}
        taken = {loads[key]: (at, key[0]) for key, at in ended_ms(heard).items() if key in loads}
        assert taken.keys() >= {3, 4}
        (lower_ms, first), (upper_ms, second) = taken[3], taken[4]
        assert first == R1 != second and lower_ms > upper_ms

    shown_at(check, said(2, more, "stack", 110, near="A4"), PlanTask, StepReport)


def test_m24_a_robot_bids_when_its_plan_ends_within_the_horizon() -> None:
    """R3 is held, and three desks call at once: the third call is opened again and again, and nobody with a plan bids.

    When a plan is about to end its robot bids, with the end of a plan behind it.
    """
    more = missions("B4", "B3", "B2") + held("R3", 1, 300)
    where = site(2, more)

    def check(heard: Sequence[Timed]) -> None:
        attempts, behind = 0, 0
        for at_us, one in heard:
            attempts += isinstance(one, CallForProposals)
            if isinstance(one, Bid):
                mirror = listener(where, heard, at_us)
                end_us = mirror.traffic.end_of(one.sender, at_us) if one.sender in mirror.traffic.plans else 0
                assert end_us <= at_us + where.horizon_us
                assert one.cost * 1000 > end_us
                behind += bool(end_us)
        assert attempts > 3 and behind

    shown_at(check, said(2, more, until_s=95), CallForProposals, Bid, PlanHead, PlanStep)


def test_m28_plans_are_made_and_carried_out_at_once_and_all_hold_the_same() -> None:
    """Calls and plans come between the reports of others; 2 s after a word all tell one digest of plans and boxes."""
    machines = {1, 2, 3, *ROBOTS}

    def check(heard: Sequence[Timed]) -> None:
        reports = [at for at, one in heard if isinstance(one, StepReport)]
        assert reports
        late = [at for at, one in heard if isinstance(one, CallForProposals | PlanHead) and min(reports) < at]
        assert len([at for at in late if at < max(reports)]) > 2
        won = [at for at, one in heard if isinstance(one, Award) and one.result is CallResult.AWARDED]
        assert len(won) == 4
        for at_us in won:
            assert first_of(heard, PlanHead, after_us=at_us)[0] < at_us + SECOND // 4
        last: dict[int, int] = {}
        told_us, judged = 0, 0
        for at_us, one in heard:
            if isinstance(one, PlanHead | CarAt):
                told_us = at_us
            if isinstance(one, Heartbeat):
                last[one.sender] = one.mirror_digest
                if at_us > told_us + 2 * SECOND:
                    judged += 1
                    assert last.keys() == machines and len(set(last.values())) == 1
        assert judged > 400

    shown_at(check, said(2, FOUR, "stack", FOUR_S), Award, Heartbeat, PlanHead, StepReport)


def crowd(*targets: str) -> tuple[Timed, ...]:
    """Four vehicles in A4 of the shipped network are to fetch a box each, at one moment, to these stations."""
    text = site_text("terminal")
    text = re.sub(r'(node = 1\d\nhome = ")A\d', r"\1A4", text[: text.index('# "Load station')])
    for number, (box, target) in enumerate(zip(("B4", "B7", "B14", "B13"), targets, strict=True)):
        desk = ("Desk", "Quay")[number % 2]
        text += f'\n[[missions]]\nat_s = 5\ndesk = "{desk}"\ntranship = ["{box}"]\nto = "{target}"\n'
    found: list[Timed] = []
    where = terminal(parse_site(text, "crowd.toml"))
    options = RunOptions(seed=1, quiet=True)
    play(where, options, limit_us=TOLD_S * SECOND, noise=0, prepare=partial(_listen, found))
    return tuple(found)


def _listen(found: list[Timed], run: TerminalRun) -> None:
    run.observers.append(lambda message, at_us: found.append((at_us, message)))


def test_m21_m25_of_several_routes_the_one_that_ends_first_is_told() -> None:
    """Crossing 1 holds one robot: the third of four goes round by L8, and is there sooner than a third by L11 is."""
    numbers = {name: terminal(find_site("terminal")).by_name[name].number for name in ("L11", "L8")}

    def plans(heard: Sequence[Timed]) -> list[tuple[set[str], int]]:
        """Lanes and end, ms, of each plan in the order of their telling."""
        told = [one for _, one in heard if isinstance(one, PlanHead)]
        found = [(one.begin_ms, steps(heard, one.sender, one.version)) for one in told]
        assert len(found) == 4 and all(way for _, way in found)
        return [
            (
                {name for name, number in numbers.items() if number in [one.entity for one in way]},
                begin + way[-1].end_ms,
            )
            for begin, way in found
        ]

    def check(heard: Sequence[Timed]) -> None:
        ways = plans(heard)
        assert [way for way, _ in ways] == [{"L11"}, {"L11"}, {"L8"}, {"L11"}]
        assert ways[0][1] < ways[1][1] < ways[2][1] < third
        assert not [one for _, one in heard if isinstance(one, LaneState) and one.blocked]

    # Where all go to one station, that is what each waits for, and no way round is sooner.
    (*_, (way, third), _) = plans(crowd("S1", "S1", "S1", "S1"))
    assert way == {"L11"}
    shown_at(check, crowd("S1", "S1", "S4", "S4"), PlanHead, PlanStep)
