"""A robot's way through a node and its loading: every state meets every event, and does what its table says."""

from itertools import product

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import ManualMode
from onboard.contract.graph import BodyPlace, NodeAnswer, NodeVerdict, RobotAt, RobotMode, TurnSignal, VisitList
from onboard.contract.graph_device import ApproachSensor, BodyState
from onboard.contract.messages import ManualOrder, Reference
from onboard.core.effects import Effect, Record, Send
from onboard.core.motion_authority import acts
from onboard.holon.holon import Holon
from onboard.systems.graph.fields import NO_NODE
from onboard.systems.graph.records import ErrandRecord
from onboard.systems.graph.robot import REDEEM_US, SIGNAL_AGAIN_US, GraphRobot
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.graph.steps import LOAD_TABLE, NODE_TABLE, Approach, NodeDeed, NodeEvent, Stay, StayDeed
from onboard.systems.registry import factory_for

#: It comes from node 4 to node 0, whose agent is on host 1, and goes on to node 1.
ROBOT, HOST, DESK, BEHIND, NODE, AFTER = 11, 1, 9, 4, 0, 1
TASK = Reference(DESK, 40)
NOW_US = 10_000_000
#: The first stop is behind it.
LOADED = [ErrandRecord(TASK, (6,))]


def robot(*stops: int) -> GraphRobot:
    """One with this errand, or with none."""
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    machine = site.machines[ROBOT]
    entries = [ErrandRecord(TASK, stops).entry] if stops else []
    behaviour = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(behaviour, GraphRobot)
    behaviour.fleet.motion.why_still = acts
    return behaviour


def order(one: GraphRobot, *stops: int) -> None:
    """An order by name; without a stop it is taken back."""
    one.hear(VisitList(DESK, TASK.number, ROBOT, *(*stops, *[NO_NODE] * 5)[:5]), NOW_US)


def answer(one: GraphRobot, verdict: NodeVerdict) -> None:
    one.hear(NodeAnswer(HOST, ROBOT, NODE, verdict, AFTER, 1), NOW_US)


def brought_to(approach: Approach) -> GraphRobot:
    one = robot()
    one.sense(BodyState(ROBOT, 0, BEHIND, NODE, BodyPlace.ON_EDGE), NOW_US)
    if approach is not Approach.AWAY:
        one.sense(ApproachSensor(ROBOT, BEHIND, NODE), NOW_US)
    if approach not in (Approach.AWAY, Approach.NEAR):
        order(one, AFTER)
        one.advance(NOW_US)
    if approach is Approach.STOPPED:
        answer(one, NodeVerdict.STOP)
        # The question under way is answered late: another follows after the pause that is for it.
        one.advance(NOW_US + SIGNAL_AGAIN_US)
    if approach is Approach.GRANTED:
        answer(one, NodeVerdict.GO)
    assert one.approach is approach
    return one


def happens(one: GraphRobot, event: NodeEvent) -> list[Effect]:
    match event:
        case NodeEvent.MET:
            return one.sense(ApproachSensor(ROBOT, BEHIND, NODE), NOW_US)
        case NodeEvent.PASSED:
            return one.sense(BodyState(ROBOT, 0, NODE, AFTER, BodyPlace.ON_EDGE), NOW_US)
        case NodeEvent.ONWARD:
            order(one, AFTER)
            return one.advance(NOW_US + 2 * SIGNAL_AGAIN_US if one.approach is Approach.STOPPED else NOW_US + 1_000_000)
        case NodeEvent.STOP:
            answer(one, NodeVerdict.STOP)
        case NodeEvent.GO:
            answer(one, NodeVerdict.GO)
        case NodeEvent.STAYS:
            order(one)
            return one.advance(NOW_US)
        case NodeEvent.LAPSED:
            order(one)
            return one.advance(NOW_US + REDEEM_US)
    return []


@pytest.mark.parametrize(("approach", "event"), list(product(Approach, NodeEvent)))
def test_every_approach_meets_every_event(approach: Approach, event: NodeEvent) -> None:
    if event is NodeEvent.LAPSED and approach is not Approach.GRANTED:
        assert (approach, event) not in NODE_TABLE, "only what was granted can lapse"
        return
    one = brought_to(approach)
    effects = happens(one, event)
    following, deed = NODE_TABLE.get((approach, event), (approach, NodeDeed.NOTHING))
    assert one.approach is following
    signals = [effect.message for effect in effects if isinstance(effect, Send)]
    told = [signal for signal in signals if isinstance(signal, TurnSignal)]
    assert told == ([TurnSignal(ROBOT, NODE, BEHIND, AFTER)] if deed is NodeDeed.SIGNAL else [])
    if deed is NodeDeed.FORGET:
        answer(one, NodeVerdict.GO)
        assert one.approach is following, "an answer to what was forgotten"


def stay(which: Stay, *, is_held: bool) -> GraphRobot:
    """A robot in node 4, with what makes this of its errand, its place and the clock."""
    stops = {Stay.NO_ERRAND: (), Stay.UNDER_WAY: (6,)}.get(which, (BEHIND, 6))
    one = robot(*(stops if which is not Stay.UNDER_WAY or not is_held else (BEHIND, 6)))
    one.sense(BodyState(ROBOT, 0, NO_NODE, BEHIND, BodyPlace.IN_NODE), NOW_US)
    if which in (Stay.LOADING, Stay.LOADED):
        one.advance(NOW_US)
    if is_held:
        one.hear(ManualOrder(251, ROBOT, 1, ManualMode.HELD), NOW_US)
    return one


def meant(which: Stay, *, is_held: bool) -> Stay:
    """Held, it begins no loading, and ends one that it has begun."""
    return Stay.UNDER_WAY if is_held and which is Stay.AT_STOP else which


@pytest.mark.parametrize(("mode", "which", "is_held"), list(product(RobotMode, Stay, (False, True))))
def test_every_mode_meets_every_stay(mode: RobotMode, which: Stay, is_held: bool) -> None:
    one = stay(which, is_held=is_held)
    if which in (Stay.LOADING, Stay.LOADED):
        assert one.mode is RobotMode.LOADING
        if mode is not RobotMode.LOADING:
            assert (mode, which) not in LOAD_TABLE, "whoever loads is in that mode"
            return
    one.mode = mode
    load_us = one.site.load_ms * 1000
    effects = one.advance(NOW_US + load_us if which is Stay.LOADED else NOW_US + load_us - 1)
    following, deed = LOAD_TABLE[mode, meant(which, is_held=is_held)]
    assert one.mode is following
    told = {
        effect.message.robot_mode
        for effect in effects
        if isinstance(effect, Send) and isinstance(effect.message, RobotAt)
    }
    assert told <= {following}
    assert [effect.what for effect in effects if isinstance(effect, Record)] == (
        LOADED if deed is StayDeed.GO_ON else []
    )
    later = [effect.what for effect in one.advance(NOW_US + 2 * load_us - 1) if isinstance(effect, Record)]
    assert later == (LOADED if deed in (StayDeed.BEGIN, StayDeed.WAIT) else []), "its time is over then"
