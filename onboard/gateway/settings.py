"""What a person chooses about a gateway's topics and rates."""

import re
from dataclasses import dataclass, field

from onboard.contract.constants import MAX_NODE_ID
from onboard.gateway.dialect import DIALECTS, Dialect
from onboard.gateway.roles import Roles

#: Characters of a topic level: those of a serial number in VDA 5050 2.1, section 6.4.
_LEVEL = re.compile(r"[A-Za-z0-9_.:-]+")


class GatewayError(ValueError):
    """A mistake in an option of the gateway; ``str`` is one line: option, value and remedy."""


@dataclass(frozen=True, slots=True)
class GatewaySettings:
    """Topics, version and rates of a gateway; times in microseconds. The rates are ours where no source is named.

    ``epoch_us`` is the wall time (us since 1970) at loop time 0, for the time stamps. ``serials`` names the machines
    that are told of; empty for all of the site. ``node_id`` is the gateway's own on the bus, 251 to 255 (core/codes),
    where it takes orders; None where it only listens. ``roles`` are those who may have something fetched.
    """

    version: str = "2.1"
    manufacturer: str = "onboard"
    prefix: str = "onboard"
    epoch_us: int = 0
    serials: frozenset[str] = frozenset()
    node_id: int | None = None
    roles: Roles = field(default_factory=dict)
    #: A state at least so often (VDA 5050 2.1, section 6.10: 30 s).
    state_us: int = 30_000_000
    #: Two states of one machine are so far apart at least; changes between them are told together.
    least_state_us: int = 200_000
    visualization_us: int = 1_000_000
    indicators_us: int = 60_000_000

    def __post_init__(self) -> None:
        """Raise ``GatewayError`` for a version that is not known or a name that cannot be a level of a topic."""
        if self.version not in DIALECTS:
            raise GatewayError(f"--vda5050 {self.version}: not known; one of {', '.join(DIALECTS)}")
        if self.node_id is not None and not MAX_NODE_ID < self.node_id <= 255:
            raise GatewayError(f"--orders {self.node_id}: no node-ID of a gateway; from {MAX_NODE_ID + 1} to 255")
        for option, value in (("--manufacturer", self.manufacturer), ("--prefix", self.prefix)):
            if not _LEVEL.fullmatch(value):
                raise GatewayError(f"{option} {value!r}: not a level of a topic; letters, digits and _ . : - only")

    @property
    def dialect(self) -> Dialect:
        """The words of the VDA 5050 version that was chosen."""
        return DIALECTS[self.version]

    def tells_of(self, serial: str) -> bool:
        """Whether a machine is one of those told of."""
        return not self.serials or serial in self.serials


def level(name: str) -> str:
    """A machine's or site's name as a level of a topic: what is not allowed there becomes ``_``."""
    return re.sub(r"[^A-Za-z0-9_.:-]", "_", name) or "_"
