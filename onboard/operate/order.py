"""One command under way, as a value: what every command has."""

from collections.abc import Iterable

from onboard.contract.messages import Message
from onboard.operate.park import Park

#: What is not answered is said again after this, us (dbc/fleet.dbc, ManualOrder): longer than an answer's way over a
#: busy bus.
AGAIN_US = 1_000_000

#: Exit status: done and confirmed; not confirmed; a mistake of the person.
DONE, NOT_CONFIRMED, MISTAKE = 0, 1, 2


class OperatorCommand:
    """A command. ``begin`` once, then ``feed`` and ``wake`` until ``status`` is set; no method ever raises.

    ``node`` is the station's own node-ID. All times are loop time in us.
    """

    #: Whether it waits for no look at the bus and no question: what only takes motion away may not wait.
    is_urgent = False
    #: Whether it never says a word on the bus.
    is_silent = False

    def __init__(self, park: Park, node: int) -> None:
        self.park, self.node = park, node
        self.status: int | None = None
        self.began_us = 0
        self._lines: list[str] = []
        self._wake_us: int | None = None

    def preview(self, now_us: int) -> list[str]:
        """What a person is to know before the question, one line each."""
        return []

    @property
    def question(self) -> str:
        """What is asked before anything is said; empty for nothing. Answered by yes or ``answer``."""
        return ""

    @property
    def answer(self) -> str:
        """The word that must be typed instead of yes; empty for yes."""
        return ""

    @property
    def has_question(self) -> bool:
        """Whether ``question`` is to be asked now, while it goes on speaking; ``answered`` tells it the answer."""
        return False

    def answered(self, now_us: int, *, agrees: bool) -> None:
        """The person's answer to a question that came up while it spoke."""

    def begin(self, now_us: int) -> None:
        """From now on it speaks."""
        self.began_us = self._wake_us = now_us

    def feed(self, message: Message, now_us: int) -> None:
        """A message of the bus, which the park has taken up already."""

    def wake(self, now_us: int) -> list[Message]:
        """What is to be said now."""
        return []

    def next_wake(self) -> int | None:
        """When ``wake`` is to be called, None for never."""
        return self._wake_us if self.status is None else None

    def interrupt(self, now_us: int) -> list[Message]:
        """A person ends it before it is over: what is to be said at last."""
        self.status = NOT_CONFIRMED if self.status is None else self.status
        return []

    def news(self) -> list[str]:
        """Lines for the person since this was last asked."""
        lines, self._lines = self._lines, []
        return lines

    def tell(self, line: str) -> None:
        """A line for the person."""
        self._lines.append(line)

    def end(self, unconfirmed: Iterable[str]) -> None:
        """It is over; ``unconfirmed`` names who did not confirm."""
        names = list(unconfirmed)
        if names:
            self.tell(f"not confirmed by {', '.join(names)}")
        self.status = NOT_CONFIRMED if names else DONE

    def confirm_us(self) -> int:
        """How long machines have to answer, us: three heartbeat periods, and as long as two repeats."""
        return 3 * self.park.site.timing.heartbeat_us + 2 * AGAIN_US
