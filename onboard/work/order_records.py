"""What a desk at which orders come in writes of them; a desk's order adds its own fields to both records."""

from dataclasses import dataclass

from onboard.core.journal_records import MOST_OVER, JournalRecord, Keep, RecordEnd
from onboard.work.order_life import OVER, OrderState

_NUMBER = ("number",)


@dataclass(frozen=True, slots=True)
class OrderRecord(JournalRecord):
    """An order came in under ``number``, 16 bits."""

    NAME = "order"
    RULES = (Keep("order", _NUMBER),)

    number: int


@dataclass(frozen=True, slots=True)
class OrderStateRecord(JournalRecord):
    """How an order stands, and who has it: a node-ID, 0 for nobody."""

    NAME = "order_state"
    RULES = (
        Keep("order_state", _NUMBER),
        RecordEnd(("order", "order_state"), _NUMBER, ("state", OVER), MOST_OVER),
    )

    number: int
    state: OrderState
    winner: int
