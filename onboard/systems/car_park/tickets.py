"""A ticket: the number of a car, which everybody may know, and a code, which only paper and desk do.

The code is drawn from the desks' secret and the number, so that any desk of a site knows a right one without a word
on the bus, after a lost journal too, and none is kept anywhere.
"""

from dataclasses import dataclass, field
from hashlib import blake2s
from hmac import compare_digest
from typing import NamedTuple

from onboard.contract.messages import Reference, TicketPrint, TicketRead

#: Bits of a code: nobody tries so many, at a desk or beside a log. Parking tickets elsewhere carry 40 and more.
CODE_BITS = 80
HALVES = 2
HALF_BITS = CODE_BITS // HALVES
_PERSON = b"ticket"


class Ticket(NamedTuple):
    """What is on the paper: the car's number, and ``code``, 80 bits."""

    car: Reference
    code: int


@dataclass(frozen=True, slots=True)
class TicketCodes:
    """Codes under ``secrets``: tickets are printed under the first and read under all, so that a secret can be renewed.

    Without any secret every code is 0: so a log tells it, and so it is replayed. A board always has one.
    """

    secrets: tuple[bytes, ...] = ()

    def code(self, car: Reference) -> int:
        """What is printed on the ticket of a car."""
        return _code(self.secrets[0], car) if self.secrets else 0

    def is_right(self, ticket: Ticket) -> bool:
        """Whether a desk of this site has printed it, in a time that does not tell how much of it is right."""
        given = ticket.code.to_bytes(CODE_BITS // 8, "little")
        right = [_code(secret, ticket.car) for secret in self.secrets] or [0]
        return any(compare_digest(given, one.to_bytes(CODE_BITS // 8, "little")) for one in right)

    def halves(self, sender: int, sequence: int, car: Reference) -> list[TicketPrint]:
        """What the printer is told beside the order of this sequence."""
        return [TicketPrint(sender, sequence, half, code) for half, code in enumerate(split(self.code(car)))]


def _code(secret: bytes, car: Reference) -> int:
    name = car.origin.to_bytes(1, "little") + car.number.to_bytes(2, "little")
    return int.from_bytes(blake2s(name, key=secret, digest_size=CODE_BITS // 8, person=_PERSON).digest(), "little")


def split(code: int) -> tuple[int, int]:
    """The halves of a code as frames carry them: the low bits first."""
    return code & (1 << HALF_BITS) - 1, code >> HALF_BITS


@dataclass
class TicketHalves:
    """Puts codes together that come in two frames of one sequence."""

    _sequence: int | None = None
    _halves: dict[int, int] = field(default_factory=dict)

    def take(self, word: TicketPrint | TicketRead) -> None:
        """One half; those of another sequence are forgotten."""
        if word.sequence != self._sequence:
            self._sequence, self._halves = word.sequence, {}
        self._halves[word.half] = word.code

    def code(self, sequence: int) -> int | None:
        """The code of a sequence; None while a half is missing."""
        if sequence != self._sequence or len(self._halves) < HALVES:
            return None
        return self._halves[1] << HALF_BITS | self._halves[0]
