"""Forged words about rights and about cars: who may be where, and what stands where."""

from bus_sim.attacks.attack import Attack, AttackerNode, Tokens
from onboard.contract.codes import RegenerationPhase, TokenKind
from onboard.contract.constants import ANY_STATION, NOBODY, OUTSIDE
from onboard.contract.messages import (
    CarAt,
    Message,
    Reference,
    Regeneration,
    TokenAssigned,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    TokenSeen,
)
from onboard.core.authority import TokenKey
from onboard.core.serial import successor

#: Between two words about the same car, us.
_AGAIN_US = 2_000_000


class _AboutTokens(Attack):
    """Follows what the bus tells of tokens."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self.tokens = Tokens()

    def hear(self, message: Message, now_us: int) -> None:
        """Note the newest version and holder of each token that a message names."""
        self.tokens.hear(message)

    def grant(self, key: TokenKey, to: int, ahead: int = 1, sender: int = NOBODY) -> None:
        """Give away what the attacker does not hold, under its own number where no other is named."""
        version = self.tokens.versions.get(key, 0) + ahead
        self.node.say(TokenGrant(sender or self.node.node_id, key.kind, key.number, version, to))


class GrantRefused(_AboutTokens):
    """Whoever was just refused a right is granted it."""

    def hear(self, message: Message, now_us: int) -> None:
        """A refusal is followed by a forged grant under the next version."""
        super().hear(message, now_us)
        if isinstance(message, TokenRefusal):
            self.grant(TokenKey(message.token_kind, message.token), message.requester)


class GrantAsked(_AboutTokens):
    """Whoever asks for a right is granted it at once."""

    def hear(self, message: Message, now_us: int) -> None:
        """A request is answered by a forged grant one to three versions ahead."""
        super().hear(message, now_us)
        if isinstance(message, TokenRequest):
            self.grant(
                TokenKey(message.token_kind, message.token), message.sender, ahead=self.node.chance.randint(1, 3)
            )


class GrantAway(_AboutTokens):
    """Rights that somebody asks for go to a holder who does not exist."""

    def hear(self, message: Message, now_us: int) -> None:
        """A request is answered by a forged grant to the attacker itself, a thousand versions ahead."""
        super().hear(message, now_us)
        if isinstance(message, TokenRequest):
            self.grant(TokenKey(message.token_kind, message.token), self.node.node_id, ahead=1_000)


class FalseClaim(_AboutTokens):
    """Whatever is granted, the attacker says at once that it holds it, under a newer version."""

    def hear(self, message: Message, now_us: int) -> None:
        """A grant or a holder's word is answered by the attacker's own claim, one to three versions ahead."""
        super().hear(message, now_us)
        if isinstance(message, TokenGrant | TokenHeld):
            key = TokenKey(message.token_kind, message.token)
            version = self.tokens.versions[key] + self.node.chance.randint(1, 3)
            self.node.say(TokenHeld(self.node.node_id, key.kind, key.number, version))


class GrantAsHolder(_AboutTokens):
    """Whoever asks for a right, or is refused it, is granted it under the number of whoever holds it."""

    def hear(self, message: Message, now_us: int) -> None:
        """A request or a refusal is answered by a forged grant under the next version, in the holder's name."""
        super().hear(message, now_us)
        if isinstance(message, TokenRequest | TokenRefusal):
            key = TokenKey(message.token_kind, message.token)
            taker = message.sender if isinstance(message, TokenRequest) else message.requester
            holder = self.tokens.holders.get(key, NOBODY)
            if holder not in (NOBODY, taker):
                self.grant(key, taker, sender=holder)


class ClaimAsTaker(_AboutTokens):
    """Whatever is granted, its taker seems to hold at once, and so does its giver again under a newer version."""

    def hear(self, message: Message, now_us: int) -> None:
        """A grant is answered by two claims, one in the name of each of the two."""
        super().hear(message, now_us)
        if isinstance(message, TokenGrant) and message.holder != NOBODY:
            for ahead, who in enumerate((message.holder, message.sender)):
                self.node.say(TokenHeld(who, message.token_kind, message.token, message.version + ahead))


class Statements(_AboutTokens):
    """Tells whoever asks for a right that it was given elsewhere, seen elsewhere, and assigned and disputed."""

    def hear(self, message: Message, now_us: int) -> None:
        """A request is answered by one word of each kind that tells of others' rights, under the next version."""
        super().hear(message, now_us)
        if isinstance(message, TokenRequest):
            me, holder = self.node.node_id, self.node.chance.choice(sorted(self.node.site.machines))
            key = TokenKey(message.token_kind, message.token)
            version = self.tokens.versions.get(key, 0) + 1
            for word in (TokenGiven, TokenSeen, TokenAssigned):
                self.node.say(word(me, key.kind, key.number, version, holder))
            self.node.say(TokenDispute(me, key.kind, key.number, version, holder))


class ForgedRegeneration(Attack):
    """Begins to make a machine's rights anew, as only a person may, and ends it with an empty list."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._due_us = 0

    def tick(self, now_us: int) -> None:
        """Every two seconds each phase once, of the next epoch, about a machine drawn by chance."""
        if now_us < self._due_us:
            return
        self._due_us = now_us + _AGAIN_US
        lost = self.node.chance.choice(sorted(self.node.site.machines))
        for phase in (RegenerationPhase.FREEZE, RegenerationPhase.READ_BACK, RegenerationPhase.COMMIT):
            self.node.say(Regeneration(self.node.node_id, phase, 1, lost, NOBODY, 0, 0))


class SwapCars(Attack):
    """Says of two cars that each stands where the other does; and gives their tokens away after it."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._cars: dict[Reference, CarAt] = {}
        self._due_us = 0

    def hear(self, message: Message, now_us: int) -> None:
        """Note where each car was said to stand last."""
        if isinstance(message, CarAt):
            self._cars[message.car] = message

    def tick(self, now_us: int) -> None:
        """Every two seconds exchange the places of two cars by chance, under the present version and the next."""
        standing = [one for one in self._cars.values() if one.station not in (ANY_STATION, OUTSIDE)]
        if now_us < self._due_us or len(standing) < 2:
            return
        self._due_us = now_us + _AGAIN_US
        one, other = self.node.chance.sample(standing, 2)
        for car, station in ((one, other.station), (other, one.station)):
            for version in (car.version, successor(car.version, 16)):
                self.node.say(CarAt(self.node.node_id, car.car, station, version, car.wheelbase_mm))
            number, newer = car.car.origin << 16 | car.car.number, successor(car.version, 16)
            self.node.say(TokenGrant(self.node.node_id, TokenKind.CAR, number, newer, car.sender))
