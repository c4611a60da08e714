"""Attacks in a factory graph's own words."""

from collections.abc import Iterator

from bus_sim.attacks import words
from onboard.contract.codes import KindCode
from onboard.contract.graph import NodeAnswer, NodeVerdict, TurnSignal, VisitList
from onboard.contract.messages import Message
from onboard.systems.graph.fields import five
from onboard.systems.graph.site import FactoryGraph


class ForgedVisits(words.ForgedOrders):
    """Visits of two nodes by a robot, said by somebody who is no desk."""

    def orders(self) -> Iterator[Message]:
        """One list of two nodes drawn by chance, for a robot drawn by chance."""
        me, site, chance = self.node.node_id, self.node.site, self.node.chance
        assert isinstance(site, FactoryGraph)
        robots = [node for node, one in site.machines.items() if one.kind is KindCode.VEHICLE]
        stops = tuple(chance.sample(sorted(site.graph.neighbours), 2))
        yield VisitList(me, self.number, chance.choice(robots), *five(stops))


class ForgedGoAheads(words.WrongAnswers):
    """Every robot that comes near a node is told by the attacker that it may go on."""

    def hear(self, message: Message, now_us: int) -> None:
        """Answers each request for a node with GO in the agent's place, and no right behind it."""
        if isinstance(message, TurnSignal):
            go = NodeAnswer(self.node.node_id, message.sender, message.node, NodeVerdict.GO, message.after, 0)
            self.node.say(go)
