"""What the machines of a polishing shop know beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from onboard.core.site import MotionNeeds, Site


@dataclass(frozen=True, kw_only=True)
class Shop(Site):
    """How long each polisher takes for a part, us by node-ID; a run of the site brings parts, ms after its begin."""

    system: ClassVar[str] = "polishing"
    called: ClassVar[str] = "polishing shop"
    #: What a run asks of the site: no machine knows it, and the digest does not depend on it.
    demand: ClassVar[frozenset[str]] = frozenset({"parts_ms"})
    #: The order by which something moves, and what it needs: a polisher moves within itself only.
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {"Polish": MotionNeeds.ALONE}

    desk: int
    polishing_us: dict[int, int]
    parts_ms: tuple[int, ...] = ()
