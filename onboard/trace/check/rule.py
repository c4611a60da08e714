"""The base of all rules: what they are called, where they come from, which messages they want to see."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from onboard.contract.messages import Message
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture

#: Each handler takes events of exactly the message class that it is listed under; Any is what a dispatch table costs.
Handlers = Mapping[type[Message], Callable[[Any], None]]


class Rule(ABC):
    """One rule over one run. ``handlers`` says which messages it sees; ``tick`` lets it see time pass.

    ``needs_site``: it cannot be judged without the site file. ``undisturbed``: it holds only where no frame was lost or
    doubled on purpose. ``on_devices``: it judges device buses, so a log of the fleet bus alone tells it nothing.
    ``liveness``: it says that something must happen in time; time in which machines were broken on purpose
    (``BusPicture.excused_us``) does not count. All other rules hold at any time.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    source: ClassVar[str]
    needs_site: ClassVar[bool] = False
    undisturbed: ClassVar[bool] = False
    on_devices: ClassVar[bool] = False
    liveness: ClassVar[bool] = False

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        self.picture = picture
        self._report = report
        #: Of a rule that bounds waiting: the longest wait of each machine, and the bound; 0 for none.
        self.longest_us: dict[int, int] = {}
        self.limit_us = 0

    @abstractmethod
    def handlers(self) -> Handlers:
        """Message class to handler. A handler sees the picture as it was before the event."""

    def tick(self, now_us: int) -> None:
        """About once a second of the log's time: what should have happened by now; for most rules nothing."""
        return

    def finish(self, now_us: int) -> None:
        """The log ends, or another run begins; most rules have said all by then."""
        return

    def find(self, event: LogEvent[Any], machines: tuple[int, ...], what: str) -> None:
        """Report what an event shows."""
        self._report(Finding(event.time_us, self.name, machines, what, event.evidence))

    def miss(self, time_us: int, machines: tuple[int, ...], what: str) -> None:
        """Report what should have been in the log and is not."""
        self._report(Finding(time_us, self.name, machines, what, ""))
