"""What must never happen in a polishing shop, from the frames alone."""

from collections.abc import Callable

from onboard.contract.codes import TaskPhase
from onboard.contract.messages import Reference, TaskReport
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.trace.check.systems import COMMON


class PolishedOnce(Rule):
    """No part is polished twice: too much would be taken off."""

    name = "polished-once"
    title = "no part is polished twice"
    source = "the shop's drawings"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._done: dict[Reference, int] = {}

    def handlers(self) -> Handlers:
        """Ends of tasks."""
        return {TaskReport: self._on_report}

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        word = event.message
        if word.phase is TaskPhase.DONE and self._done.setdefault(word.task, word.sender) != word.sender:
            self.find(event, (word.sender, self._done[word.task]), f"part {word.task.number} was polished twice")


RULES = (*COMMON, PolishedOnce)
