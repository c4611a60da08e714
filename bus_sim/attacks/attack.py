"""What an attacker has and can do: a node on the fleet bus, the site's public file, the contract, and chance.

It hears every frame and says what it likes under node-IDs of its choice. It knows nothing else: no journal, no plan,
no plant.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass

from onboard.contract.constants import NOBODY
from onboard.contract.messages import Message, TokenGrant, TokenHeld, TokenRefusal, TokenRequest
from onboard.core.authority import TokenKey
from onboard.core.frame import Frame
from onboard.core.site import Site

#: An attack is called this often, us.
TICK_US = 100_000


@dataclass
class AttackerNode:
    """The attacker's node. ``say`` takes a message under any sender, ``put`` any frame; both go out in order."""

    site: Site
    node_id: int
    chance: random.Random
    say: Callable[[Message], None]
    put: Callable[[Frame], None]
    #: Frames that wait to be sent.
    waiting: Callable[[], int]


class Attack:
    """One attack at work. It listens from power-up on, and nobody hears it before it begins. Times: loop time, us."""

    def __init__(self, node: AttackerNode) -> None:
        self.node = node

    def begin(self, now_us: int) -> None:
        """The attack begins at ``now_us``; from now on ``tick`` is called."""

    def hear(self, message: Message, now_us: int) -> None:
        """A message of somebody else."""

    def hear_frame(self, frame: Frame, now_us: int) -> None:
        """A frame of somebody else."""

    def tick(self, now_us: int) -> None:
        """Called every ``TICK_US`` while the attack is on."""


class Tokens:
    """What the bus tells of tokens: the newest version of each, and who held it then."""

    def __init__(self) -> None:
        self.versions: dict[TokenKey, int] = {}
        self.holders: dict[TokenKey, int] = {}

    def hear(self, message: Message) -> None:
        """Take up what a message tells."""
        match message:
            case TokenGrant():
                self._note(TokenKey(message.token_kind, message.token), message.version, message.holder)
            case TokenHeld():
                self._note(TokenKey(message.token_kind, message.token), message.version, message.sender)
            case TokenRefusal():
                key = TokenKey(message.token_kind, message.token)
                self._note(key, max(message.version, self.versions.get(key, 0)), message.sender)
            case TokenRequest():
                key = TokenKey(message.token_kind, message.token)
                self._note(key, max(message.version_seen, self.versions.get(key, 0)), self.holders.get(key, NOBODY))

    def _note(self, key: TokenKey, version: int, holder: int) -> None:
        if version >= self.versions.get(key, 0):
            self.versions[key], self.holders[key] = version, holder
