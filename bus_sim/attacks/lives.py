"""Forged signs of life: who is there, who stands, who speaks under whose number, and what time it is."""

from collections.abc import Iterator

from bus_sim.attacks.attack import AttackerNode
from bus_sim.attacks.words import Repeated, WrongTime
from onboard.contract.codes import CONTRACT_VERSION, MachineState, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import BusTime, EmergencyStop, Go, Halted, Heartbeat, Message, SyncDone

_SECOND_US = 1_000_000


class ForgedBeats(Repeated):
    """Signs of life of every machine that are false in one thing: its state, boot, kind, site, contract or epoch."""

    every_us = _SECOND_US

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._beats: dict[int, Heartbeat] = {}

    def hear(self, message: Message, now_us: int) -> None:
        """Note each machine's last sign of life."""
        if isinstance(message, Heartbeat):
            self._beats[message.sender] = message

    def words(self, now_us: int) -> Iterator[Message]:
        """One heartbeat in the place of each machine's own."""
        for node, beat in sorted(self._beats.items()):
            if node in self.node.site.machines:
                yield self._falsified(beat)

    def sender(self, beat: Heartbeat) -> int:
        """Node-ID under which the false sign of life is said."""
        return self.node.node_id

    def _falsified(self, beat: Heartbeat) -> Heartbeat:
        chance = self.node.chance
        what = chance.choice(("state", "boot", "site", "contract", "epoch", "digest"))
        return Heartbeat(
            self.sender(beat),
            CONTRACT_VERSION ^ 1 if what == "contract" else beat.contract,
            beat.site_digest % 0xFFFF + 1 if what == "site" else beat.site_digest,
            beat.mirror_digest ^ 1 if what == "digest" else beat.mirror_digest,
            beat.boot % 255 + 1 if what == "boot" else beat.boot,
            beat.kind,
            chance.choice((MachineState.OBSTACLE, MachineState.STOPPED)) if what == "state" else beat.state,
            (beat.epoch + 1) % 256 if what == "epoch" else beat.epoch,
        )


class BeatsAsAll(ForgedBeats):
    """The same, each under the number of the machine that it is about."""

    def sender(self, beat: Heartbeat) -> int:
        """Node-ID of the machine that the sign of life is about."""
        return beat.sender


class OwnNumbers(Repeated):
    """One harmless frame under each machine's own number."""

    def words(self, now_us: int) -> Iterator[Message]:
        """That it has answered whoever asked."""
        for node in self.node.site.machines:
            yield SyncDone(node, NOBODY, 1, 0)


class StopsAsAll(Repeated):
    """An emergency stop under each machine's own number."""

    every_us = 10 * _SECOND_US

    def words(self, now_us: int) -> Iterator[Message]:
        """One stop under the number of each machine of the site."""
        for node in self.node.site.machines:
            yield EmergencyStop(node, Reason.OPERATOR)


class StopAndGo(Repeated):
    """An emergency stop, and at once the word that ends it, which only people may say."""

    def words(self, now_us: int) -> Iterator[Message]:
        """A stop under the attacker's number, and at once that it is over."""
        yield EmergencyStop(self.node.node_id, Reason.OPERATOR)
        yield Go(self.node.node_id, NOBODY)


class ForgedHalts(Repeated):
    """Says of every machine that it stands for good and that only a person can help."""

    def words(self, now_us: int) -> Iterator[Message]:
        """One word a machine, each for another reason."""
        reasons = (Reason.NODE_SILENT, Reason.JOURNAL_LOST, Reason.DUPLICATE_NODE_ID, Reason.FALSE_STATEMENT)
        for node in self.node.site.machines:
            yield Halted(self.node.node_id, node, self.node.chance.choice(reasons), NOBODY, True, 0)


class TimeAsSource(WrongTime):
    """Bus time that is an hour ahead, under the number of whoever tells it."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._source = NOBODY

    def hear(self, message: Message, now_us: int) -> None:
        """Follow the true bus time, and who tells it."""
        super().hear(message, now_us)
        if isinstance(message, BusTime):
            self._source = message.sender

    def words(self, now_us: int) -> Iterator[Message]:
        """As any wrong time, in the source's name."""
        for word in super().words(now_us):
            assert isinstance(word, BusTime)
            yield BusTime(self._source, word.bus_time_us)
