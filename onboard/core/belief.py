"""Whom one node believes to hold each token: what a grant to it is judged by (docs/protocol.md).

A belief moves only along a chain: by a grant or an answer of the node that was believed until then, or by what a
machine vouches for when it is asked. All else that is overheard is a hint: good for a picture, never a reason to refuse
or to take a grant (rule 6 of the protocol's review: a bystander that learned an unverified grant refuses the real one).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import TokenKind
from onboard.contract.constants import NOBODY

#: A token, as in ``authority.TokenKey``.
Key = tuple[TokenKind, int]


class Belief(NamedTuple):
    """``holder`` has had the token since version ``version``, 0 for ever; ``confirmed`` where it said so itself.

    ``giver`` is whose grant told of it, 0 where none did.
    """

    version: int
    holder: int
    confirmed: bool = False
    giver: int = NOBODY


@dataclass
class Beliefs:
    """Beliefs and hints of one node; ``first_holder`` tells who holds a token before it first moves."""

    first_holder: Callable[[Key], int]
    verified: dict[Key, Belief] = field(default_factory=dict)
    hints: dict[Key, Belief] = field(default_factory=dict)
    #: Grows with every change of the tables above.
    changes: int = 0

    def of(self, key: Key) -> Belief:
        """The newest belief that was verified; before the token first moves, version 0 and its first holder."""
        return self.verified.get(key) or Belief(0, self.first_holder(key))

    def latest(self, key: Key) -> Belief:
        """The newest that was heard, verified or not."""
        return self.hints.get(key) or self.of(key)

    def take_up(self, key: Key, version: int, holder: int, *, confirmed: bool = False, giver: int = NOBODY) -> None:
        """What counts from now on, last of all; hints that are no newer end."""
        self.changes += 1
        self.verified.pop(key, None)
        self.verified[key] = tuple.__new__(Belief, (version, holder, confirmed, giver))
        if (hint := self.hints.get(key)) is not None and hint.version <= version:
            del self.hints[key]

    def hint(self, key: Key, version: int, holder: int) -> None:
        """What somebody said who is not believed to know."""
        if version > self.latest(key).version:
            self.changes += 1
            self.hints[key] = Belief(version, holder)

    def forget(self, key: Key) -> None:
        """Nothing is known of the token any more."""
        self.changes += 1
        self.verified.pop(key, None)
        self.hints.pop(key, None)
