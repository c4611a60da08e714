"""What the machines of a polishing shop know beforehand."""

from dataclasses import dataclass
from typing import ClassVar

from onboard.core.site import Site


@dataclass(frozen=True, kw_only=True)
class Shop(Site):
    """How long each polisher takes for a part, us by node-ID; a run of the site brings parts, ms after its begin."""

    system: ClassVar[str] = "polishing"
    #: What a run asks of the site: no machine knows it, and the digest does not depend on it.
    demand: ClassVar[frozenset[str]] = frozenset({"parts_ms"})

    desk: int
    polishing_us: dict[int, int]
    parts_ms: tuple[int, ...] = ()
