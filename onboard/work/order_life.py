"""The life of an order at a desk: one table of (state, event), the same for every system."""

from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.constants import NOBODY
from onboard.contract.messages import Reference


class OrderState(Enum):
    """How an order stands; each is journalled."""

    HEARD = "not called for yet"
    CALLED = "bids may come"
    IN_HAND = "somebody has it"
    DONE = "done"
    REFUSED = "nobody can do it"


class OrderEvent(Enum):
    """What happens to an order."""

    CALL = "it is called for"
    WON = "its call is over, and somebody has won it"
    NOT_WON = "its call is over, and nobody has"
    CLAIMED = "whoever may have it says that it has"
    CARRIED_OUT = "whoever may have it says that it is done"
    GIVEN_BACK = "its winner gives it back"
    TAKEN_BACK = "its winner is lost"
    HOPELESS = "nobody can do it, or the one who was named will not"


#: States that nothing follows.
OVER = (OrderState.DONE, OrderState.REFUSED)

#: What follows; an event that has no line here changes nothing, and nothing is journalled or said of it.
NEXT: dict[tuple[OrderState, OrderEvent], OrderState] = {
    (OrderState.HEARD, OrderEvent.CALL): OrderState.CALLED,
    (OrderState.HEARD, OrderEvent.CLAIMED): OrderState.IN_HAND,
    (OrderState.HEARD, OrderEvent.CARRIED_OUT): OrderState.DONE,
    (OrderState.HEARD, OrderEvent.HOPELESS): OrderState.REFUSED,
    (OrderState.CALLED, OrderEvent.WON): OrderState.IN_HAND,
    (OrderState.CALLED, OrderEvent.NOT_WON): OrderState.HEARD,
    (OrderState.CALLED, OrderEvent.CLAIMED): OrderState.IN_HAND,
    (OrderState.CALLED, OrderEvent.CARRIED_OUT): OrderState.DONE,
    # An option that was confirmed and not heard: its call is not over yet.
    (OrderState.CALLED, OrderEvent.TAKEN_BACK): OrderState.HEARD,
    (OrderState.CALLED, OrderEvent.HOPELESS): OrderState.REFUSED,
    (OrderState.IN_HAND, OrderEvent.CARRIED_OUT): OrderState.DONE,
    (OrderState.IN_HAND, OrderEvent.GIVEN_BACK): OrderState.HEARD,
    (OrderState.IN_HAND, OrderEvent.TAKEN_BACK): OrderState.HEARD,
    (OrderState.IN_HAND, OrderEvent.HOPELESS): OrderState.REFUSED,
}


@dataclass
class WorkOrder:
    """One order under its task's name. ``winner`` is a node-ID, 0 for nobody yet; ``calls`` were made so far.

    ``due_us``: when it is to be called for, or its winner asked; ``answer_at_us``: when the counter is told how it
    stands. Both in us of bus time, None for never.
    """

    task: Reference
    state: OrderState = field(default=OrderState.HEARD, kw_only=True)
    winner: int = field(default=NOBODY, kw_only=True)
    #: Whether a person named who is to do it: the winner, from the first.
    named: bool = field(default=False, kw_only=True)
    calls: int = field(default=0, kw_only=True)
    answer_at_us: int | None = field(default=None, kw_only=True)
    due_us: int | None = field(default=None, kw_only=True)
    #: Whether a call of an earlier life of the desk may have found a winner that the desk has forgotten.
    may_be_won: bool = field(default=False, kw_only=True)
    #: Whether its winner has told that it has begun.
    is_begun: bool = field(default=False, kw_only=True)

    def meet(self, event: OrderEvent) -> bool:
        """Whether an event changes how it stands; it does then."""
        following = NEXT.get((self.state, event))
        if following is not None:
            self.state = following
        return following is not None

    @property
    def is_over(self) -> bool:
        """Whether the order is done or refused, and nothing follows."""
        return self.state in OVER

    @property
    def result_name(self) -> str:
        """How it stands in the words of a counter: RECEIVED, IN_HAND, DONE or REFUSED."""
        return "RECEIVED" if self.state in (OrderState.HEARD, OrderState.CALLED) else self.state.name
