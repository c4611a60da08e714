"""What a gateway writes into its journal: orders from outside, and reports until the broker has them."""

from dataclasses import dataclass
from enum import StrEnum

from onboard.contract.messages import Reference
from onboard.core.journal_records import JournalRecord


class OrderPhase(StrEnum):
    """Where an order is (docs/mqtt.md). ACCEPTED is durable; CALLED and what follows is heard on the bus."""

    ACCEPTED = "accepted"
    CALLED = "called"
    AWARDED = "awarded"
    MOVING = "moving"
    DONE = "done"
    REFUSED = "refused"

    @property
    def is_over(self) -> bool:
        """Whether the order is done or refused, and nothing follows."""
        return self in (OrderPhase.DONE, OrderPhase.REFUSED)


@dataclass(frozen=True, slots=True)
class WishRecord(JournalRecord):
    """A whole order as it stands now; the newest of a ``name`` counts.

    ``before_us`` and ``fetch_us`` in wall time since 1970; ``ahead`` are further lists of stops with commas between;
    ``update`` counts the giver's updates, ``sequence`` is that of the last node released, ``content`` a checksum of
    what was asked.
    """

    NAME = "order"

    name: str
    what: str
    node: int
    stops: tuple[int, ...]
    number: int
    urgent: bool
    content: int
    update: int
    life: OrderPhase
    reason: str
    why: str
    owner: int
    said: bool
    ahead: str = ""
    base: str = ""
    sequence: int = 0
    open: bool = False
    cancelled: bool = False
    car: Reference | None = None
    task: Reference | None = None
    before_us: int | None = None
    charging: bool = False
    giver: str = ""
    fetch_us: int | None = None


@dataclass(frozen=True, slots=True)
class ReportRecord(JournalRecord):
    """A report to be published; ``payload`` in base64."""

    NAME = "report"

    name: str
    topic: str
    payload: str
    retain: bool


@dataclass(frozen=True, slots=True)
class DeliveredRecord(JournalRecord):
    """The broker has the report of this name."""

    NAME = "delivered"

    name: str
