"""Rows G05, G06: what only those who are near can hear is enough; what others say to a robot counts for nothing."""

from collections.abc import Sequence
from typing import Any

from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from onboard.config.site import parse_site
from onboard.contract.codes import OrderResult
from onboard.contract.graph import EdgeNotice, NodeAnswer, NodeVerdict, RobotAt, TurnSignal
from onboard.contract.messages import Message
from onboard.controller.shell import Controller
from onboard.core.effects import Effect
from onboard.systems.graph.network import ring
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph
from tests.cut import shown
from tests.graph.sites import hall, made, site_text

#: A host for each node, three robots, and more to do than they can.
ORDERS = [(0, "any", (2, 6)), (1, "any", (5, 1)), (2, "any", (7, 3)), (30, "R1", (4, 0)), (40, "any", (6, 2))]


def is_heard(site: FactoryGraph, node: int, message: Message) -> bool:
    """Whether machine ``node`` is near enough: at a robot's node, the robot itself, at the far end of an edge."""
    match message:
        case TurnSignal():
            return site.hosts[message.node] == node
        case NodeAnswer():
            return message.robot == node
        case EdgeNotice():
            return site.hosts[message.other] == node
    return True


def test_g05_g06_what_only_the_nearest_hear_is_enough() -> None:
    site = parse_site(site_text(ring(8, 6000), (0, 3, 5), ORDERS, Rules.EDGE_AND_NODE, hosts=8), "near.toml")
    assert isinstance(site, FactoryGraph)
    missed = 0

    def deafen(controller: Controller) -> None:
        holon, node = controller.holon, controller.holon.node_id
        hear = holon.receive

        def near(message: Message, local_us: int) -> list[Effect]:
            nonlocal missed
            if is_heard(site, node, message):
                return hear(message, local_us)
            missed += 1
            return []

        holon.receive = near  # type: ignore[method-assign]  # its ears, as the distance makes them

    played = play(site, RunOptions(quiet=True, limit_s=600), prepare=lambda run: run.before_start.append(deafen))
    assert played.plant.violations == [] and played.halted == [] and missed > 0
    assert all(entry.result is OrderResult.DONE for entry in played.plant.entries)

    def check(messages: Sequence[Message]) -> None:
        """Each robot leaves a node by the edge that the node's own agent has let it have after its signal."""
        signalled, let_go, noticed, moves = set(), set(), set(), 0
        place: dict[int, int] = {}
        for one in messages:
            match one:
                case TurnSignal():
                    signalled.add((one.sender, one.node))
                case EdgeNotice() if one.sender == site.hosts[one.node]:
                    noticed.add((one.node, one.other, one.robot))
                case NodeAnswer() if one.sender == site.hosts[one.node] and one.node_verdict is not NodeVerdict.STOP:
                    assert (one.robot, one.node) in signalled
                    let_go.add((one.robot, one.node, one.after))
                case RobotAt() if place.get(one.sender, one.node) != one.node:
                    way = (place[one.sender], one.node)
                    assert (one.sender, *way) in let_go and (*way, one.sender) in noticed
                    moves += 1
            if isinstance(one, RobotAt):
                place[one.sender] = one.node
        assert moves > 10

    shown(check, [one for _, one in played.messages], TurnSignal, NodeAnswer, EdgeNotice, RobotAt)


def test_g05_what_the_agent_of_another_node_answers_counts_for_nothing() -> None:
    """H1 and H2 have nodes in turn; whoever is not asked sends the robot elsewhere, and it goes its own way."""
    site = made(hall(), (0,), [(0, "R1", (8,))])
    forged = 0

    def ways(*, forge: bool) -> list[int]:
        def before(run: BusRun[Any]) -> None:
            def answer(message: Message, now_us: int) -> None:
                nonlocal forged
                if not forge or not isinstance(message, TurnSignal):
                    return
                other = next(
                    (one for one in site.graph.neighbours[message.node] if one not in (message.after, message.behind)),
                    None,
                )
                if other is not None:
                    stranger = 3 - site.hosts[message.node]
                    word = NodeAnswer(stranger, message.sender, message.node, NodeVerdict.ANOTHER, other, 1)
                    forged += 1
                    run.controllers[message.sender].holon.receive(word, run.loop.now_us())

            run.observers.append(answer)

        played = play(site, RunOptions(quiet=True, limit_s=600), prepare=before)
        assert played.plant.entries[0].result is OrderResult.DONE
        return [one.node for _, one in played.messages if isinstance(one, RobotAt)]

    usual = ways(forge=False)
    assert ways(forge=True) == usual and forged > 0
