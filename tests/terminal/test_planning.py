"""Making plans (rows M21, M23 to M27) and telling them, on the shipped network and on that of Fig. 3."""

from dataclasses import replace
from itertools import permutations, product

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.terminal.table import plan_table
from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.messages import CallForProposals, Reference
from onboard.contract.terminal import Action, Verb
from onboard.contract.terminal_device import MissionKey
from onboard.systems.contract import codecs_for
from onboard.systems.terminal.generation import VehicleGeneration
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.missions import MissionBook, types_of
from onboard.systems.terminal.plan import NOBODY_BEFORE, ActionPlan, ActionStep, PlanReader, to_frames
from onboard.systems.terminal.search import BoxTransport, PlanSearch
from onboard.systems.terminal.site import StationKind
from onboard.systems.terminal.traffic import AnewFor, Traffic
from onboard.systems.terminal.vehicle import terminal
from onboard.ways.cars import CarMirror
from onboard.work.order_life import OrderEvent
from tests.terminal.fig3 import A1, PRINTED, S1, S2, fig3, plan_of

SITE = terminal(find_site("terminal"))
BY_NAME = {name: entity.number for name, entity in SITE.by_name.items()}
SECOND = 1_000_000
TABLE = """\
Loading Task   GOTO Area 1         Lane 3      [10 40]
               GOTO Lane 3         Crossing 1  [40 50]
               GOTO Crossing 1     Lane 2      [50 55]
               GOTO Lane 2         Area 4      [55 67]
               GOTO Area 4         Station 2   [67 77]
               DOCK Station 2                  [77 79]
               PICK UP Box B3                  [79 81]
               UNDOCK Station 2                [81 83]
Unloading Task GOTO Area 4         Lane 11     [83 93]
               GOTO Lane 11        Crossing 1  [93 113]
               GOTO Crossing 1     Area 2      [113 119]
               GOTO Area 2         Station 1   [119 125]
               DOCK Station 1                  [125 127]
               PUTDOWN Box B3                  [127 129]
               UNDOCK Station 1                [129 131]"""


def mirror(node: int = 11) -> TerminalMirror:
    return TerminalMirror(SITE, node, CarMirror(SITE, node))


def box(name: str) -> int:
    return next(number for number, one in enumerate(SITE.boxes, 1) if one.name == name)


def plan(picture: TerminalMirror, owner: int, name: str, target: str, *, now: int = 0) -> ActionPlan:
    """The best plan of a vehicle that stands idle, taken up by the picture."""
    job = BoxTransport(box(name), Reference(1, box(name)), picture.station_of(box(name)), BY_NAME[target])
    search = PlanSearch(SITE, picture.traffic, owner, now, picture.long_blocked(now))
    found = search.best(picture.where[owner], now, job, version=1)
    assert found is not None
    picture.take_up(found.plan, now)
    return found.plan


def call(name: str, target: str) -> CallForProposals:
    source = SITE.boxes[box(name) - 1].station
    return CallForProposals(
        1, 1, Reference(1, 1), Operation.TRANSPORT, KindCode.VEHICLE, Criterion.FINISH_TIME, 1, 0, 1000,
        source, BY_NAME[target], SITE.box(box(name)), 0,
    )  # fmt: skip


def entities(found: ActionPlan) -> list[str]:
    return [SITE.entities[step.entity].name for step in found.steps]


def test_m10_the_plan_table_prints_as_in_the_paper() -> None:
    site = fig3()
    traffic = Traffic(site)
    traffic.take_up(plan_of(site, 11), 10)
    assert "\n".join(line.rstrip() for line in plan_table(site, traffic, 11, 10, tick=1)) == TABLE


def test_m09_the_search_makes_the_printed_plan() -> None:
    site = fig3()
    search = PlanSearch(site, Traffic(site), 11, 10)
    found = search.best(A1, 10, BoxTransport(3, Reference(1, 1), S2, S1), version=1)
    assert found is not None and not found.pushes
    steps = [(step.action, step.entity, step.end) for step in found.plan.steps]
    assert steps == [(action, entity, end) for action, entity, _, end in PRINTED]


def test_m21_m25_of_several_routes_the_one_that_ends_first_is_taken() -> None:
    """Alone by L11; with L11 blocked for long, or taken by others, by L8."""
    picture = mirror()
    alone = plan(picture, 14, "B4", "S1")
    assert "L11" in entities(alone) and "L8" not in entities(alone)
    blocked = mirror()
    blocked.traffic.blocked[BY_NAME["L11"]] = -SITE.patience_us
    round_about = plan(blocked, 14, "B4", "S1")
    assert "L8" in entities(round_about) and "L11" not in entities(round_about)
    assert alone.end < round_about.end
    crowded = mirror()
    stay = ActionStep(Action.GOTO, BY_NAME["C1"], 300 * SECOND, 301 * SECOND)
    crowded.take_up(ActionPlan(11, 1, 0, (ActionStep(Action.GOTO, BY_NAME["A2"], SECOND, SECOND), stay), ()), 0)
    assert "L8" in entities(plan(crowded, 14, "B4", "S1"))


def test_m21_a_plan_in_the_gaps_delays_nobody() -> None:
    picture = mirror()
    ends = {}
    for owner, name, target in ((14, "B4", "S10"), (13, "B7", "S10"), (11, "B14", "S1"), (12, "B3", "S4")):
        found = plan(picture, owner, name, target)
        ends[owner] = found.end
        assert {one: picture.traffic.end_of(one, 0) for one in ends} == ends


def test_m23_only_a_box_with_nothing_above_it_is_called_for() -> None:
    picture, orders = mirror(1), MissionBook(SITE, 1)
    wanted = [box("B3"), box("B4")]
    for one in wanted:
        assert orders.key(MissionKey(1, 1, Verb.TRANSHIP, one, 0, 0, BY_NAME["S1"], 0, urgent=False)) is None
    assert orders.key(MissionKey(1, 1, Verb.END, 0, 0, 0, BY_NAME["S1"], 0, urgent=False)) is not None
    first = orders.next(picture, set())
    assert first is not None and first.box == box("B4"), "B4 stands on B3"
    assert orders.next(picture, {first.box}) is None
    plan(picture, 14, "B4", "S1")
    second = orders.next(picture, {first.box})
    assert second is not None and second.box == box("B3"), "B4 is in a plan"


def stack_list(picture: TerminalMirror, name: str) -> list[int]:
    return [visit.owner for visit in picture.traffic.lists[BY_NAME[name]]]


def test_a_plan_does_not_fetch_what_it_buries_itself() -> None:
    """B4 is put on B7, which this vehicle was to fetch next and waited for for ever (stranger, seed 1)."""
    picture = mirror(14)
    plan(picture, 14, "B4", "S3")
    generation = VehicleGeneration(SITE, SITE.machines[14], picture)
    assert generation.plan(BoxTransport(box("B7"), Reference(1, 9), BY_NAME["S3"], BY_NAME["S1"]), 0, version=2) is None


@pytest.mark.parametrize("first", ["fetches", "puts"])
def test_a_box_is_put_on_a_stack_after_all_that_are_fetched_from_it(first: str) -> None:
    """Whoever plans first: who fetches is far away, and who puts comes from next door."""
    picture = mirror()
    wanted = [(11, "B7", "S1"), (14, "B4", "S3")]
    for owner, name, target in wanted if first == "fetches" else reversed(wanted):
        plan(picture, owner, name, target)
    assert stack_list(picture, "S3") == [11, 14]


@pytest.mark.parametrize("begun", [0, 300 * SECOND])
@pytest.mark.parametrize("over", [5, 6], ids=["to dock", "docked"])
def test_who_stands_at_a_stack_for_a_box_under_one_that_another_fetches_leaves_it_and_comes_back(
    begun: int, over: int
) -> None:
    """Power was cut while both came near, and the wrong one came first (campaign terminal, outages, seed 46)."""
    picture = mirror(11)
    plan(picture, 11, "B3", "S1")
    traffic = picture.traffic
    for step in range(over):
        traffic.report(11, 1, step, (step + 1) * SECOND)
    now = 400 * SECOND
    upper = traffic.plans[11].plan
    steps = tuple(step._replace(after=NOBODY_BEFORE) for step in upper.steps)
    load = upper.loads[0]._replace(box=box("B4"), task=Reference(1, 4))
    traffic.take_up(replace(upper, owner=12, begin=begun, steps=steps, loads=(load,)), now)
    assert [(one.owner, one.why) for one in traffic.violations(now)] == [(11, AnewFor.CIRCLE)]
    found = VehicleGeneration(SITE, SITE.machines[11], picture).again(now, version=2)
    assert found is not None
    assert [step.action.name for step in found.steps][:5] == ["UNDOCK", "GOTO", "DOCK", "PICK_UP", "UNDOCK"]
    assert entities(found)[:3] == ["S2", "A4", "S2"]
    assert [one.pick for one in found.loads] == [3]
    picture.take_up(found, now)
    assert not traffic.violations(now)
    assert stack_list(picture, "S2") == [11, 12, 11]


def test_nobody_bids_for_a_box_that_is_in_a_plan() -> None:
    """Two desks called for one box at once; one vehicle won both, and one mission got a box too few (liar, seed 5)."""
    picture = mirror(14)
    generation = VehicleGeneration(SITE, SITE.machines[14], picture)
    assert generation.lower_bound(call("B4", "S1"), 0) is not None
    plan(picture, 13, "B4", "S10")
    assert generation.lower_bound(call("B4", "S1"), 0) is None
    assert generation.lower_bound(call("B14", "S1"), 0) is not None


def test_a_box_that_was_wanted_by_its_type_is_so_again_when_it_is_given_back() -> None:
    """It was wanted by name then, and another desk's mission took it where a stack grew on it (stranger, seed 4)."""
    picture, orders = mirror(1), MissionBook(SITE, 1)
    area, kind = SITE.entities[BY_NAME["S3"]].area, types_of(SITE).index(SITE.boxes[box("B7") - 1].type)
    taken = {box(name) for name in ("B1", "B2", "B3", "B4")}
    assert orders.key(MissionKey(1, 1, Verb.LOAD, kind, 1, area, BY_NAME["S10"], 0, urgent=False))
    first = orders.next(picture, taken)
    assert first is not None and first.box == box("B7")
    restarted = MissionBook(SITE, 1)
    restarted.replay([orders.record().entry])
    plan(picture, 14, "B7", "S1")
    for one in (orders, restarted):
        one.give_back(first.task, OrderEvent.NOT_WON)
        again = one.next(picture, taken)
        assert again is not None and again.box == box("B6")


def _typed(verb: Verb, what: int, count: int = 0, to: str = "S1", source: str = "") -> MissionKey:
    return MissionKey(1, 7, verb, what, count, BY_NAME[source] if source else 0, BY_NAME[to], 0, urgent=False)


def test_m05_a_mission_that_comes_in_part_or_twice_is_carried_out_once_and_whole() -> None:
    orders = MissionBook(SITE, 1)
    one, other, end = _typed(Verb.TRANSHIP, box("B3")), _typed(Verb.TRANSHIP, box("B4")), _typed(Verb.END, 0, 2)
    assert (orders.key(one), orders.answer(one)) == (None, None)
    assert (orders.key(end), orders.answer(end)) == (None, None), "one of two boxes was not heard"
    assert [orders.key(key) is None for key in (one, other, end)] == [True, True, False]
    assert orders.answer(end) is True
    again = MissionBook(SITE, 1)
    again.replay([orders.record().entry])
    for known in (orders, again):
        assert [known.key(key) for key in (one, other, end)] == [None] * 3
        assert known.answer(end) is True
        assert [mission.named for mission in known.missions.values()] == [[box("B3"), box("B4")]]


@pytest.mark.parametrize(
    "key",
    [
        _typed(Verb.LOAD, 99, 1, source="A4"),
        _typed(Verb.LOAD, 0, 0, source="A4"),
        _typed(Verb.LOAD, 0, 1, source="L11"),
        _typed(Verb.LOAD, 0, 1, to="L11", source="A4"),
        _typed(Verb.END, 0),
    ],
)
def test_what_nobody_can_carry_out_is_refused_at_the_desk(key: MissionKey) -> None:
    orders = MissionBook(SITE, 1)
    assert orders.key(key) is None and orders.answer(key) is False
    assert orders.missions == {} and orders.next(mirror(1), set()) is None


def test_m02_in_a_stacker_every_box_can_be_had() -> None:
    picture = mirror()
    assert picture.above(box("B1")) == [box("B2"), box("B3"), box("B4")]
    assert picture.above(box("B11")) == []
    assert [SITE.by_name[name].station for name in ("S2", "S5")] == [StationKind.STACK, StationKind.STACKER]


def test_m24_only_robots_that_are_free_before_the_horizon_bid() -> None:
    picture = mirror(14)
    generation = VehicleGeneration(SITE, SITE.machines[14], picture)
    asked = call("B14", "S1")
    assert generation.lower_bound(asked, 0) is not None and generation.estimate(asked, 0) is not None
    found = plan(picture, 14, "B4", "S10")
    assert generation.lower_bound(asked, 0) is None, "its plan ends after T + delta T"
    for number in range(8):
        picture.traffic.report(14, 1, number, found.steps[number].end)
    assert generation.lower_bound(asked, found.end - SITE.horizon_us) is not None


def test_m24_the_bid_is_the_end_of_a_plan_behind_the_one_in_hand() -> None:
    picture = mirror(14)
    generation = VehicleGeneration(SITE, SITE.machines[14], picture)
    before = plan(picture, 14, "B4", "S1")
    now = before.end - 20 * SECOND
    for number in range(len(before.steps) - 3):
        picture.traffic.report(14, 1, number, before.steps[number].end)
    bid = generation.estimate(call("B14", "S1"), now)
    assert bid is not None and bid.cost * 1000 > before.end


def test_m26_one_box_after_the_other_is_near_the_best_order_of_all() -> None:
    """Not optimal on purpose: two robots, four boxes, each to the robot that is done first.

    The best of all orders and assignments, planned by the same search, is an eighth shorter.
    """
    boxes, owners = [("B4", "S1"), ("B7", "S4"), ("B14", "S1"), ("B13", "S10")], (13, 14)

    def last_end(order: tuple[int, ...], who: tuple[int, ...] | None) -> int:
        picture = mirror()
        for position, number in enumerate(order):
            name, target = boxes[number]
            job = BoxTransport(box(name), Reference(1, number + 1), picture.station_of(box(name)), BY_NAME[target])
            found = []
            for owner in owners if who is None else (who[position],):
                vehicle = VehicleGeneration(SITE, SITE.machines[owner], replace_node(picture, owner))
                one = vehicle.plan(job, 0, version=position + 1)
                if one is not None:
                    found.append(one.plan)
            best = min(found, key=lambda one: one.end, default=None)
            if best is None:
                return 1 << 60
            picture.take_up(best, 0)
        return max(picture.traffic.end_of(owner, 0) for owner in owners)

    greedy = last_end((0, 1, 2, 3), None)
    best = min(last_end(order, who) for order in permutations(range(4)) for who in product(owners, repeat=4))
    assert (greedy, best) == (207 * SECOND, 184 * SECOND)


def replace_node(picture: TerminalMirror, node: int) -> TerminalMirror:
    """The same picture in another machine's hands."""
    other = mirror(node)
    other.traffic, other.where, other.standing = picture.traffic, picture.where, picture.standing
    return other


def test_a_plan_is_read_as_it_was_told_and_inert_while_a_frame_is_missing() -> None:
    picture = mirror()
    told = plan(picture, 14, "B4", "S1", now=5 * SECOND)
    frames = to_frames(told)
    for missing in range(1, len(frames)):
        reader = PlanReader(SITE)
        assert not [one for n, one in enumerate(frames) if n != missing and reader.feed(one, 0) is not None]  # type: ignore[arg-type]  # frames of a plan
    reader = PlanReader(SITE)
    read = [reader.feed(one, 0) for one in frames][-1]  # type: ignore[arg-type]  # frames of a plan
    assert read is not None
    assert read == replace(told, steps=read.steps)
    assert [(one.action, one.entity, one.end, one.after) for one in read.steps] == [
        (one.action, one.entity, one.end, one.after) for one in told.steps
    ]


@pytest.mark.parametrize("by_h", [38, -38, 29_089])
def test_a_plan_is_told_whatever_bus_time_was_set_to_amid_it(by_h: int) -> None:
    """A vehicle whose clock, and the bus's, had jumped halted for a time that no frame tells (terminals 732, 737)."""
    told = plan(mirror(), 14, "B4", "S1", now=200_000_000 * SECOND)
    over = [step._replace(end=step.end - by_h * 3_600 * SECOND) for step in told.steps[:2]]
    told = replace(told, begin=told.begin - by_h * 3_600 * SECOND, steps=(*over, *told.steps[2:]))
    codec, reader, read = codecs_for(SITE).fleet, PlanReader(SITE), None
    for frame in to_frames(told):
        codec.encode(frame)
        read = reader.feed(frame, told.end)  # type: ignore[arg-type]  # frames of a plan
    assert read is not None
    assert [one.end for one in read.steps[2:]] == [one.end for one in told.steps[2:]]
