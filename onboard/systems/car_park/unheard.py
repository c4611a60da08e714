"""Orders that a device has not taken up: its states go on showing what was before (issue 4, point 3)."""

from collections.abc import Hashable
from dataclasses import dataclass, field

#: A state within this time of the first one that contradicts an order may have crossed it on the bus, us: a
#: device bus with everything queued is empty in a tenth of it.
CROSSED_US = 1_000_000


@dataclass
class Unheard:
    """Tells for each order of one machine, by any name, whether it is to be said again; all times in us."""

    _since_us: dict[Hashable, int] = field(default_factory=dict)

    def ordered(self, name: Hashable) -> None:
        """A new order under this name: what contradicted the last one counts no more."""
        self._since_us.pop(name, None)

    def is_due(self, name: Hashable, now_us: int, *, heard: bool) -> bool:
        """Whether a state of now shows that the order was lost: it contradicts the order, as one a while ago did."""
        if heard:
            self._since_us.pop(name, None)
            return False
        return now_us - self._since_us.setdefault(name, now_us) >= CROSSED_US
