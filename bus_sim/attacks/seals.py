"""Attacks on seals themselves: seals alone, guessed, split from their frames, asked for, and false alarms."""

from collections.abc import Iterator

from bus_sim.attacks.attack import Attack, AttackerNode
from bus_sim.attacks.words import Repeated
from onboard.contract.codes import TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Message, SyncDone, TokenGrant, TokenRequest
from onboard.contract.seal import Seal, SealAnswer, SealChallenge, SealFault, SealTo, SealWord

_SECOND_US = 1_000_000
#: Said in a tick: 50 a second.
_MANY = 5


class _Guessing(Attack):
    """Follows the numbers of all, so that a guess is the next that would count."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._counters: dict[int, int] = {}

    def hear(self, message: Message, now_us: int) -> None:
        """Note each node's last number."""
        if isinstance(message, Seal | SealTo):
            self._counters[message.sender] = message.counter

    def guess(self, sender: int, ahead: int = 1) -> tuple[int, int]:
        """The next number of ``sender`` and a tag by chance."""
        return (self._counters.get(sender, 0) + ahead) % 0x10000, self.node.chance.getrandbits(48)


class BareSeals(_Guessing):
    """Fifty seals a second with nothing before them."""

    def tick(self, now_us: int) -> None:
        """Under the attacker's number, by turns for all and for one."""
        for turn in range(_MANY):
            kind = SealTo if turn % 2 else Seal
            self.node.say(kind(self.node.node_id, *self.guess(self.node.node_id)))


class GuessedSeals(_Guessing):
    """Whoever asks for a right is granted it, with guessed seals behind it."""

    def hear(self, message: Message, now_us: int) -> None:
        """A request is answered by a grant under a newer version, a seal to its taker and one to all."""
        super().hear(message, now_us)
        if isinstance(message, TokenRequest):
            me = self.node.node_id
            version = message.version_seen + 1
            self.node.say(TokenGrant(me, message.token_kind, message.token, version, message.sender))
            self.node.say(SealTo(me, *self.guess(me)))
            self.node.say(Seal(me, *self.guess(me, 2)))


class SplitSeals(Attack):
    """Puts frames of its own between the frames of a machine and their seal, under that machine's number."""

    def hear(self, message: Message, now_us: int) -> None:
        """Each word of a right is followed at once by one in the same name."""
        if isinstance(message, TokenGrant | TokenRequest):
            self.node.say(SyncDone(message.sender, NOBODY, 1, 0))


class ManyChallenges(Repeated):
    """Asks all for their numbers, ten times a second, each time with another nonce."""

    every_us = _SECOND_US // 10

    def words(self, now_us: int) -> Iterator[Message]:
        """One challenge to all nodes, with a nonce that was drawn for it."""
        yield SealChallenge(self.node.node_id, NOBODY, self.node.chance.getrandbits(48))


class FalseAnswers(_Guessing):
    """Whoever is challenged seems to answer at once, in a life far ahead."""

    def hear(self, message: Message, now_us: int) -> None:
        """A challenge is answered in the attacker's name, with a guessed seal."""
        super().hear(message, now_us)
        if isinstance(message, SealChallenge):
            self._answer()

    def tick(self, now_us: int) -> None:
        """And without a challenge now and then."""
        if self.node.chance.random() < 0.2:
            self._answer()

    def _answer(self) -> None:
        me = self.node.node_id
        self.node.say(SealAnswer(me, 1, 1 << 31))
        self.node.say(SealTo(me, *self.guess(me)))


class FalseAlarms(Repeated):
    """Says of every machine that its seals are false."""

    every_us = _SECOND_US

    def words(self, now_us: int) -> Iterator[Message]:
        """One word a machine; and a grant of nothing, so that the attacker is heard at all."""
        me = self.node.node_id
        for node in self.node.site.machines:
            yield SealFault(me, node, SealWord.FALSE_SEAL, 1)
        yield TokenGrant(me, TokenKind.TASK, 1, 1, me)
