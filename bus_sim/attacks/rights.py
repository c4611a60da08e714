"""Forged words about rights and about cars: who may be where, and what stands where."""

from bus_sim.attacks.attack import Attack, AttackerNode, Tokens
from onboard.contract.codes import TokenKind
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Message, Reference, TokenGrant, TokenHeld, TokenRefusal, TokenRequest
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

    def grant(self, key: TokenKey, to: int, ahead: int = 1) -> None:
        """Give away what the attacker does not hold."""
        version = self.tokens.versions.get(key, 0) + ahead
        self.node.say(TokenGrant(self.node.node_id, key.kind, key.number, version, to))


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
