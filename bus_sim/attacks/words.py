"""Forged words of people, of other sites, and about time, starts and stops."""

from abc import ABC, abstractmethod
from collections.abc import Iterator

from bus_sim.attacks.attack import TICK_US, Attack, AttackerNode
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, ManualMode, Reason
from onboard.contract.constants import MAX_NODE_ID
from onboard.contract.messages import Blocked, BusTime, EmergencyStop, Heartbeat, ManualOrder, Message, SyncRequest
from onboard.core.bus_time import BUS_TIME_MODULUS

_SECOND_US = 1_000_000
#: Machines of another site that one node makes up.
_GHOSTS = 6


class Repeated(Attack, ABC):
    """Says its words at the begin and again after every ``every_us``."""

    every_us = 5 * _SECOND_US

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._due_us = 0

    @abstractmethod
    def words(self, now_us: int) -> Iterator[Message]:
        """The messages that are said at each turn; ``now_us`` is loop time."""

    def tick(self, now_us: int) -> None:
        """Says its words once in ``every_us``, from the first call on."""
        if now_us >= self._due_us:
            self._due_us = now_us + self.every_us
            for word in self.words(now_us):
                self.node.say(word)


class ForgedStop(Repeated):
    """An emergency stop that nobody of the site said."""

    every_us = 10 * _SECOND_US

    def words(self, now_us: int) -> Iterator[Message]:
        """One emergency stop under the attacker's number."""
        yield EmergencyStop(self.node.node_id, Reason.OPERATOR)


class OtherSite(Repeated):
    """Several machines of another site, all of them made up."""

    def words(self, now_us: int) -> Iterator[Message]:
        """One heartbeat for each made-up machine, all with a digest that is not this site's."""
        digest = self.node.site.digest % 0xFFFF + 1
        for ghost in self._ghosts():
            yield Heartbeat(ghost, CONTRACT_VERSION, digest, 0, 1, KindCode.ROBOT, MachineState.IDLE)

    def _ghosts(self) -> list[int]:
        """The attacker's number and the next that are nobody's, going round: under a machine's own it is believed."""
        me, machines = self.node.node_id, self.node.site.machines
        others = (*range(me + 1, MAX_NODE_ID + 1), *range(1, min(me, MAX_NODE_ID + 1)))
        return [me, *[other for other in others if other not in machines][: _GHOSTS - 1]]


class NewerBoot(Repeated):
    """Tells each machine that it was known under a newer boot counter: as if its journal were old."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._boots: dict[int, int] = {}

    def hear(self, message: Message, now_us: int) -> None:
        """Note each machine's boot counter."""
        if isinstance(message, Heartbeat):
            self._boots[message.sender] = message.boot

    def words(self, now_us: int) -> Iterator[Message]:
        """One request a machine that names a boot counter newer than its own."""
        for node in self.node.site.machines:
            yield SyncRequest(self.node.node_id, node, self._boots.get(node, 1) % 255 + 1)


class BlockAll(Repeated):
    """Says of every slot that nobody can pass it."""

    def words(self, now_us: int) -> Iterator[Message]:
        """``Blocked`` for every segment of every track; nothing on sites without tracks."""
        tracks = getattr(self.node.site, "tracks", {})
        for number, track in tracks.items():
            for index in range(1, min(track.length, 255) + 1):
                yield Blocked(self.node.node_id, number, index, Reason.OPERATOR)


class HoldAll(Repeated):
    """Holds every machine, as a person would."""

    def words(self, now_us: int) -> Iterator[Message]:
        """One order a machine to hold, all under one number."""
        number = self.node.chance.randint(1, 255)
        for node in self.node.site.machines:
            yield ManualOrder(self.node.node_id, node, number, ManualMode.HELD)


class WrongTime(Repeated):
    """Bus time that is an hour ahead."""

    every_us = _SECOND_US

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._ahead_us: int | None = None

    def hear(self, message: Message, now_us: int) -> None:
        """Follow the true bus time, by how many us it is ahead of loop time."""
        if isinstance(message, BusTime):
            self._ahead_us = message.bus_time_us - now_us

    def words(self, now_us: int) -> Iterator[Message]:
        """Bus time an hour ahead of the true one, once that was heard."""
        if self._ahead_us is not None:
            yield BusTime(self.node.node_id, (now_us + self._ahead_us + 3_600 * _SECOND_US) % BUS_TIME_MODULUS)


class ForgedOrders(Repeated):
    """What only an operator's station may order, in the words of the site's system."""

    every_us = 10 * TICK_US

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self.number = node.chance.randint(1, 10_000)

    def words(self, now_us: int) -> Iterator[Message]:
        """An order for a box or a robot where the site has such, and every known car at every compartment."""
        self.number += 1
        yield from self.orders()

    def orders(self) -> Iterator[Message]:
        """Those under the present number; a system without a station of the kind has none."""
        yield from ()


class WrongAnswers(Attack):
    """Whoever asks whether it may go on is told by the attacker that it may, where a system's machines ask so."""
