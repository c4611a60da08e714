"""Customers' acts at a desk: each once, one with a ticket only with its whole code, and only a right one."""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.announce_device import DeskFetch
from onboard.contract.codes import DeskInput, DeskText, Reason
from onboard.contract.messages import DeskEvent, Reference, TicketRead
from onboard.core.effects import Effect, Report
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.tickets import Ticket, TicketHalves

#: So many wrong tickets, and the desk takes none for ``LOCKED_US``. A person with the right ticket needs fewer; at
#: one minute each, 10^6 tries at one desk take 139 days.
MOST_WRONG = 5
LOCKED_US = 60_000_000
#: A wrong ticket counts for this long, us: of an honest day's slips no five come together.
COUNTED_US = 600_000_000
#: What comes with a ticket.
_WITH_TICKET = (DeskInput.TICKET, DeskInput.CANCEL)


@dataclass
class TicketSlot:
    """The slot of one desk.

    ``drops`` counts wrong tickets as UNKNOWN_TICKET, a lock and what a locked desk is offered as NOT_AUTHORISED; the
    machine tells both on the bus (``Diagnostic``). A lock is forgotten with the power: whoever can cut that needs no
    ticket.
    """

    outputs: BayOutputs
    drops: Counter[Reason]
    #: What is made of a right ticket whose driver says in how many seconds the car will be fetched; bus us.
    announced: Callable[[Reference, int, int], list[Effect]]
    _halves: TicketHalves = field(default_factory=TicketHalves)
    _waiting: DeskEvent | DeskFetch | None = None
    _last: int | None = None
    _wrong_us: deque[int] = field(default_factory=lambda: deque(maxlen=MOST_WRONG))
    _locked_until_us: int | None = None

    def take(
        self, word: DeskEvent | DeskFetch | TicketRead, now_us: int, act: Callable[[DeskInput, Reference], list[Effect]]
    ) -> list[Effect]:
        """What ``act`` makes of a key or a car, where this word completes an act that counts; else what is shown.

        Time in bus us.
        """
        found = self._whole(word)
        if found is None:
            return []
        done, ticket = found
        refusal = self._refusal(ticket, now_us) if _has_ticket(done) else []
        if refusal:
            return refusal
        if isinstance(done, DeskFetch):
            return self.announced(ticket.car, done.in_s, now_us)
        return act(done.event, ticket.car)

    def _whole(self, word: DeskEvent | DeskFetch | TicketRead) -> tuple[DeskEvent | DeskFetch, Ticket] | None:
        if isinstance(word, TicketRead):
            self._halves.take(word)
        elif word.sequence != self._last:
            self._waiting = word
        act = self._waiting
        if act is None:
            return None
        code = self._halves.code(act.sequence) if _has_ticket(act) else 0
        if code is None:
            return None
        self._waiting, self._last = None, act.sequence
        return act, Ticket(act.car, code)

    def _refusal(self, ticket: Ticket, now_us: int) -> list[Effect]:
        """Empty for a right ticket at an open slot. Whether a car of this number is here is not told."""
        if self._locked_until_us is not None and now_us < self._locked_until_us:
            self.drops[Reason.NOT_AUTHORISED] += 1
            return [self.outputs.show(DeskText.TOO_MANY_TRIES, ticket.car)]
        if self.outputs.codes.is_right(ticket):
            # It does not clear the count: one's own ticket between guesses would make them free.
            return []
        self.drops[Reason.UNKNOWN_TICKET] += 1
        self._wrong_us.append(now_us)
        if len(self._wrong_us) < MOST_WRONG or self._wrong_us[0] < now_us - COUNTED_US:
            return [self.outputs.show(DeskText.UNKNOWN_TICKET, ticket.car)]
        self._wrong_us.clear()
        self._locked_until_us = now_us + LOCKED_US
        self.drops[Reason.NOT_AUTHORISED] += 1
        said = f"{MOST_WRONG} wrong tickets: this desk takes none for {LOCKED_US // 1_000_000} s"
        return [Report(said), self.outputs.show(DeskText.TOO_MANY_TRIES, ticket.car)]


def _has_ticket(act: DeskEvent | DeskFetch) -> bool:
    return isinstance(act, DeskFetch) or act.event in _WITH_TICKET
