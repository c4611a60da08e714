"""One image on every machine, nobody above another (row P01), each by itself on the bus (row P19).

What a task costs is each kind's own (row P21).
"""

import dataclasses
import gc
import itertools
from collections.abc import Sequence
from enum import Enum
from types import BuiltinFunctionType, CodeType, FunctionType, GetSetDescriptorType, MemberDescriptorType, ModuleType

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, Criterion, Grade, KindCode, LegAction, Operation, TaskPhase
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Award, CallForProposals, Heartbeat, Message, Reference, Stamp, TaskReport
from onboard.controller.shell import Controller
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment, Site
from onboard.holon.holon import Holon
from onboard.systems.car_park.bay_generation import BayGeneration
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import CarStep, Program, to_itinerary
from onboard.systems.car_park.site import car_park
from onboard.systems.registry import factory_for
from onboard.ways.mirror import WayMirror
from tests.cut import Timed, first_of, shown_at
from tests.sites import one_floor
from tests.system.scene import Scene, play, stays

SITE = car_park(find_site("small"))
#: All have found each other by then, and no customer has come, s.
KILLED_S = 9.0


def without(name: str | None) -> Scene:
    """A car comes to the small site; one machine's controller, if any, loses its power before."""

    def cut(simulation: Simulation) -> None:
        if name is None:
            return
        node_id = SITE.machine(name).node_id
        for medium in (simulation.fleet, simulation.devices[node_id]):
            node = next(one for one in medium._nodes if one.name == name)
            simulation.loop.call_at(KILLED_S, node.power_off)
        # Somebody acknowledges what the devices say: a lone sensor would repeat its frame for ever.
        simulation.devices[node_id].attach("listener")

    return play(SITE, stays((0, None)), before=cut, limit_s=600, extra_s=200)


@pytest.fixture(scope="module")
def whole() -> Scene:
    return without(None)


def test_p01_every_machine_runs_the_same_code_and_says_so(whole: Scene) -> None:
    """The same classes drive all; they differ by what the registry has for the kind in the machine file."""
    controllers = whole.simulation.controllers
    assert {type(one) for one in controllers.values()} == {Controller}
    assert {type(one.holon) for one in controllers.values()} == {Holon}
    assert {one.holon.site.digest for one in controllers.values()} == {SITE.digest}
    beats = [beat for _, beat in whole.all(Heartbeat)]
    assert {beat.sender for beat in beats} == set(SITE.machines)
    assert len({(beat.contract, beat.site_digest) for beat in beats}) == 1


@pytest.mark.parametrize("name", ["MR1", "MR2", "ER1", "ER2"])
def test_p01_a_machine_dies_and_the_others_park_the_car(name: str) -> None:
    scene = without(name)
    assert scene.simulation.plant.oracle.finish() == []
    dead = SITE.machine(name).node_id
    last_word_us = max(time_us for time_us, beat in scene.all(Heartbeat) if beat.sender == dead)
    assert last_word_us < KILLED_S * 1e6
    _, award = scene.first(Award, lambda m: m.result is CallResult.AWARDED)
    assert award.winner != dead and SITE.machines[award.winner].kind is KindCode.ROBOT
    scene.first(TaskReport, lambda m: m.task == award.task and m.phase is TaskPhase.DONE)
    summary = scene.simulation.plant.street.summary()
    assert (summary.parked, summary.inside) == (1, 1)


def test_p01_who_comes_back_is_told_by_each_of_the_others_at_once() -> None:
    """No role does it for all: each says by itself that it lives, whenever its next word would have been due."""
    crash = parse_injection(f"crash:target=MR2,at_s={KILLED_S},restart_s=10.3")
    scene = play(SITE, stays(), plant=lambda simulation: arm(simulation, [crash]), limit_s=1, extra_s=30)
    back = SITE.machine("MR2").node_id

    def check(heard: Sequence[Timed]) -> None:
        since_us, _ = first_of(heard, Heartbeat, lambda one: one.sender == back, after_us=15_000_000)
        others = {one.sender for at_us, one in heard if isinstance(one, Heartbeat) and 0 < at_us - since_us < 300_000}
        assert others - {back} == set(SITE.machines) - {back}

    shown_at(check, [(one.time_us, one.message) for one in scene.said if one.bus == "fleet"], Heartbeat)


# --- row P19 ---------------------------------------------------------------------------------------------------------

#: What never changes once the program runs; a site is frozen.
_FIXED = (Enum, str, bytes, int, float, property, Site, type, ModuleType, CodeType, FunctionType, BuiltinFunctionType)
_SLOTS = (GetSetDescriptorType, MemberDescriptorType)


def changeable(root: object) -> dict[int, object]:
    """Everything that can be reached from an object and could be changed, by identity."""
    seen: dict[int, object] = {}
    ahead = [root]
    while ahead:
        one = ahead.pop()
        if id(one) not in seen and one is not None and not isinstance(one, (*_FIXED, *_SLOTS)):
            seen[id(one)] = one
            ahead += gc.get_referents(one)
    # CPython gives an object a dict of its own only once somebody asked for it: what is frozen keeps it so.
    namespaces = {id(vars(one)) for one in seen.values() if is_frozen(one) and hasattr(one, "__dict__")}
    return {number: one for number, one in seen.items() if number not in namespaces and not is_frozen(one)}


def is_frozen(one: object) -> bool:
    """Whether an object itself cannot change, whatever it holds."""
    if isinstance(one, Message):
        # mypy lets nobody assign to one; at run time the guard would cost most of making it.
        return True
    if dataclasses.is_dataclass(one):
        return bool(getattr(type(one), "__dataclass_params__").frozen)  # noqa: B009  # not in the stubs
    # A bare object has nothing in it: it is a mark.
    return isinstance(one, tuple | frozenset) or type(one) is object or type(one).__name__ in ("method", "cell")


def test_p19_machines_have_nothing_in_common_but_the_bus(whole: Scene) -> None:
    """In one process they could pass each other notes: no two controllers reach one thing that can change."""
    for one in whole.simulation.controllers.values():
        changeable(one.holon)  # asks for the dicts, as any test before this one may have done
    reached = {node: changeable(one.holon) for node, one in whole.simulation.controllers.items()}
    assert len(reached) == len(SITE.machines)
    for first, second in itertools.combinations(reached, 2):
        common = [type(reached[first][number]).__name__ for number in reached[first].keys() & reached[second].keys()]
        assert not common, f"nodes {first} and {second} share {common}"
        assert {"WayMirror", "Negotiation", "TokenBook"} <= {type(one).__name__ for one in reached[first].values()}


# --- row P21 ---------------------------------------------------------------------------------------------------------


def foreseen(mirror: Mirror) -> None:
    """Robot 12 is going to stand before the compartment for two minutes from now on."""
    program = Program(one_floor(robots=2), Segment(1, 6))
    steps = [
        CarStep(LegAction.TRAVEL, 1, 6, 4, 0, 5_000_000),
        CarStep(LegAction.STAND, 1, 4, 4, 5_000_000, 120_000_000),
        CarStep(LegAction.TRAVEL, 1, 4, 12, 120_000_000, 140_000_000),
    ]
    program.replace(steps, Stamp(0, 1, 2))
    mirror.on_itinerary(to_itinerary(12, 7, Grade.FIRM, Stamp(0, 1, 2), steps), 0)


def a_call(operation: Operation, kind: KindCode) -> CallForProposals:
    task = Reference(1, 1)
    return CallForProposals(
        1, 1, task, operation, kind, Criterion.FINISH_TIME, 1, 0, to_bus_ms(2_000_000),
        one_floor().compartments[1].number, ANY_STATION, task, 2700,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("node", "operation", "depends"), [(11, Operation.PARK, True), (1, Operation.RECEIVE, False)], ids=["robot", "bay"]
)
def test_p21_one_interface_two_kinds_of_cost_with_and_without_the_others_plans(
    node: int, operation: Operation, depends: bool
) -> None:
    """The negotiation asks both by the same three questions; only the vehicle's answer depends on what others plan."""
    site = one_floor(robots=2)
    machine = site.machines[node]
    costs = []
    for others in (False, True):
        mirror = WayMirror(site, node)
        if others:
            foreseen(mirror)
        estimator: Estimator = factory_for(site, machine.kind).estimator(site, machine, mirror)
        if isinstance(estimator, CarParkGeneration):
            estimator.program.standing = Segment(1, 2)
        proposal = estimator.estimate(a_call(operation, machine.kind), 1_000_000)
        assert proposal is not None
        costs.append(proposal.cost)
        assert isinstance(estimator, CarParkGeneration if depends else BayGeneration)
    assert (costs[1] > costs[0] + 60_000) is depends
    assert (costs[1] == costs[0]) is not depends
