"""Whose word about a car counts: that of its custodian, whoever holds its token (design, section 5).

My own word stands for what I hold: who says otherwise claims a right of mine. Of others' cars a word of somebody else
than the last custodian waits until a grant or a statement of the token proves it: both are said when one changes hands.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CarAt, Reference
from onboard.core.authority import TokenBook
from onboard.core.serial import is_newer
from onboard.core.token_keys import TokenKey
from onboard.ways.tokens import car_token

#: Words that wait to be proven, one a car; beyond it the oldest is dropped: some of each machine's at a restart.
MAX_UNPROVEN = 64
#: Bits of ``CarAt.version``, a serial number.
VERSION_BITS = 16
_MASK = (1 << VERSION_BITS) - 1


@dataclass(frozen=True, slots=True)
class KnownCar:
    """Where a car stands, who vouches for it, under which version of its token, and its wheelbase in mm."""

    station: int
    custodian: int
    version: int
    wheelbase_mm: int


@dataclass
class CarWords:
    """One machine's filter before its mirror, which knows ``cars``. ``drops`` counts what came to nothing."""

    node_id: int
    tokens: TokenBook
    drops: Counter[Reason]
    cars: Mapping[Reference, KnownCar]
    take_up: Callable[[CarAt], object]
    _unproven: dict[Reference, CarAt] = field(default_factory=dict)

    def hear(self, statement: CarAt) -> None:
        """Take up a word, keep it until it is proven, or drop it: RIGHT_CLAIMED, NOT_THE_HOLDER."""
        key = car_token(*statement.car)
        held = self.tokens.held.get(key)
        if held is not None and statement.sender != self.node_id:
            # The giver says again where the car stood, under the version before mine, until it has heard me: news where
            # my journal has lost what was said of it before it became mine, or words came in another order.
            if statement.version == (held - 1) & _MASK and self._is_unplaced(statement):
                self.take_up(statement)
            self.drops[Reason.RIGHT_CLAIMED] += not is_newer(held & _MASK, statement.version, VERSION_BITS)
            return
        if self._is_proven(key, statement):
            self._unproven.pop(statement.car, None)
            self.take_up(statement)
            return
        self.drops[Reason.NOT_THE_HOLDER] += 1
        self._unproven.pop(statement.car, None)
        self._unproven[statement.car] = statement
        if len(self._unproven) > MAX_UNPROVEN:
            del self._unproven[next(iter(self._unproven))]

    def _is_unplaced(self, statement: CarAt) -> bool:
        """Whether I know of no place of a car, or have it from the same machine under the same version as aboard it."""
        known = self.cars.get(statement.car)
        aboard = statement.sender, statement.version, ANY_STATION
        return known is None or (known.custodian, known.version, known.station) == aboard

    def settle(self, key: TokenKey) -> CarAt | None:
        """A word about a car that what was just heard of its token has proven."""
        if key.kind is not TokenKind.CAR or not self._unproven:
            return None
        waiting = self._unproven.get(Reference(key.number >> 16, key.number & 0xFFFF))
        if waiting is None or key in self.tokens.held or not self._is_proven(key, waiting):
            return None
        del self._unproven[waiting.car]
        self.take_up(waiting)
        return waiting

    def _is_proven(self, key: TokenKey, statement: CarAt) -> bool:
        known = self.cars.get(statement.car)
        if known is None or statement.sender == known.custodian:
            return True
        # What is older changes nothing and need not be proven.
        is_old = not is_newer(statement.version, known.version, VERSION_BITS)
        return is_old or self.tokens.holder_of(key) == statement.sender
