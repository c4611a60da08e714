"""Machines that a person holds: how long they may stand is the person's business, but nobody is forgotten."""

from collections.abc import Callable

from onboard.contract.codes import ManualMode
from onboard.contract.messages import ManualState
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule

#: A machine that is held for longer than this has been forgotten, us: an hour is longer than anybody stays beside it.
FORGOTTEN_US = 3_600_000_000


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
