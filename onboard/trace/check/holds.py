"""Machines that a person holds: how long they may stand is the person's business, but nobody is forgotten."""

from collections.abc import Callable

from onboard.contract.codes import ManualMode
from onboard.contract.constants import MOBILE_KINDS, STILL
from onboard.contract.messages import ManualOrder, ManualState
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule

#: A machine that is held for longer than this has been forgotten, us: an hour is longer than anybody stays beside it.
FORGOTTEN_US = 3_600_000_000
#: So many words without an answer in so long, us, are no accident: an order is repeated every second for ten.
MOST_WORDS, ANSWERS_US = 8, 6_000_000


class LetGoAgain(Rule):
    """While a machine is held no rule of liveness counts the time; so a hold that is never ended is told of itself."""

    name = "let-go-again"
    liveness = True
    title = "a machine that is held is let go within the hour"
    source = "row M38; VDA 5050 2.1, startPause"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._held: dict[int, LogEvent[ManualState]] = {}
        self._told: set[int] = set()

    def handlers(self) -> Handlers:
        """Machines' words on who has a hand in."""
        return {ManualState: self._on_state}

    def _on_state(self, event: LogEvent[ManualState]) -> None:
        if event.message.manual_mode is ManualMode.AUTOMATIC:
            self._held.pop(event.message.sender, None)
            self._told.discard(event.message.sender)
        else:
            self._held.setdefault(event.message.sender, event)

    def tick(self, now_us: int) -> None:
        """Who is held for too long; told once."""
        for node, event in list(self._held.items()):
            held_us = now_us - event.time_us
            if held_us > FORGOTTEN_US and node not in self._told:
                self._told.add(node)
                self.find(event, (node,), f"is held for {held_us // 10**6} s and was not let go")


class HoldAnswered(Rule):
    """A person who is not answered stands before a machine that may move at any moment."""

    name = "hold-answered"
    liveness = True
    title = "a machine that moves and lives answers an order by hand"
    source = "row M38; dbc/fleet.dbc, ManualOrder: repeated every second until ManualState has its number"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        #: The order that each machine has not answered, since when, us, and how often it was said.
        self._open: dict[int, tuple[ManualOrder, int, int]] = {}

    def handlers(self) -> Handlers:
        """Orders by hand, and answers."""
        return {ManualOrder: self._on_order, ManualState: self._on_state}

    def _on_order(self, event: LogEvent[ManualOrder]) -> None:
        order, now_us = event.message, event.time_us
        before, since_us, words = self._open.get(order.machine, (order, now_us, 0))
        if before != order or not self._must_answer(order.machine):
            since_us, words = now_us, 0
        self._open[order.machine] = order, since_us, words + 1
        if words + 1 == MOST_WORDS and self.picture.waited_us(since_us, now_us) >= ANSWERS_US:
            self.find(event, (order.machine,), f"was ordered {MOST_WORDS} times by hand, and has not answered")

    def _must_answer(self, node: int) -> bool:
        """Whether it is heard, takes part, and is of a kind that a person can hold on this site."""
        picture, beat = self.picture, self.picture.beats.get(node)
        if beat is None or beat.kind not in MOBILE_KINDS or (picture.has_site and picture.site.no_hold):
            return False
        return beat.state not in STILL and node not in picture.announcing and picture.is_alive(node, beat.boot)

    def _on_state(self, event: LogEvent[ManualState]) -> None:
        order, _, _ = self._open.get(event.message.sender, (None, 0, 0))
        if order is not None and order.number == event.message.number:
            del self._open[event.message.sender]
