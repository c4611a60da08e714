"""A person in the loop (row M38): a machine that moves is held, and let go again, by an order on the bus.

Held, it begins nothing, asks for no more rights and bids for nothing; what must not be left half done it ends. Its
rights, its load and its tasks stay its own. The order is in the journal: a machine that was held is held when it is
started again, since whoever held it may stand before it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import ManualMode
from onboard.contract.messages import Halted, ManualOrder, ManualState, Message
from onboard.core.effects import Effect, Record, Send
from onboard.core.journal_records import Entry, records_in
from onboard.core.records import ManualRecord

#: What a machine that does not go on has not begun, and others could do, it gives back after so long, us. Ours: a
#: person who only lets somebody pass takes less, and it is twice what a vehicle waits before it looks for another way
#: around such a one (``patience_s``, 30), so that whoever finds one keeps its work.
GIVE_BACK_US = 60_000_000


def says_held(message: Message) -> bool:
    """Whether a machine says that it is held, by a person or by a stop."""
    if isinstance(message, ManualState):
        return message.manual_mode is not ManualMode.AUTOMATIC
    return isinstance(message, Halted) and message.machine == message.sender


@dataclass
class Manual:
    """One machine's mode. ``by`` and ``number`` are the last order's sender and number."""

    node_id: int
    mode: ManualMode = ManualMode.AUTOMATIC
    number: int = 0
    by: int = 0
    #: Held, it has come to rest, as it last said.
    at_rest: bool = field(default=False, init=False)

    @property
    def is_automatic(self) -> bool:
        """Whether nobody has a hand in."""
        return self.mode is ManualMode.AUTOMATIC

    def replay(self, entries: Iterable[Entry]) -> None:
        """After a restart the machine is held if it was; a step by hand is not begun anew."""
        for record in records_in(entries, ManualRecord):
            self.mode, self.number, self.by = record.mode, record.number, record.by
        if self.mode is ManualMode.STEP:
            self.mode = ManualMode.HELD

    def ordered(self, order: ManualOrder) -> list[Effect]:
        """A person's order; said again it is only answered again. A single step is not known here: all stays."""
        if order.manual_mode is ManualMode.STEP:
            self.by, self.number = order.sender, order.number
            return [self.report()]
        return self.take(order) or [self.report()]

    def take(self, order: ManualOrder) -> list[Effect]:
        """Take an order up: what is journalled and said; nothing where it is the last one, said again."""
        if (order.sender, order.number) == (self.by, self.number):
            return []
        self.mode, self.by, self.number = order.manual_mode, order.sender, order.number
        self.at_rest = False
        return [Record(ManualRecord(self.mode, self.by, self.number)), self.report()]

    def rests(self, at_rest: bool) -> list[Effect]:
        """Note whether the machine stands and does nothing; it says so where that is news."""
        if self.is_automatic or at_rest is self.at_rest:
            return []
        self.at_rest = at_rest
        return [self.report()]

    def report(self) -> Effect:
        """What the machine says of it."""
        return Send(ManualState(self.node_id, self.number, self.mode, self.at_rest))

    def statement(self) -> list[Effect]:
        """What it says to whoever asks: nothing while nobody has a hand in."""
        return [] if self.is_automatic else [self.report()]
