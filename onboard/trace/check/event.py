"""What a rule is shown, and what it says: one message of a log, and one finding."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.trace.candump import format_frame

M_co = TypeVar("M_co", bound=Message, covariant=True)


class LogEvent(NamedTuple, Generic[M_co]):
    """One message of a log: time in us of the log, the channel's name in the log, and the frame that completed it."""

    time_us: int
    message: M_co
    channel: str = ""
    frame: Frame | None = None

    @property
    def evidence(self) -> str:
        """The frame as ``candump -L`` writes it; the message itself where a test made it without one."""
        return str(self.message) if self.frame is None else f"{self.channel} {format_frame(self.frame)}"


@dataclass(frozen=True, slots=True)
class Finding:
    """A broken rule: when (us of the log), whom it concerns (node-IDs), what happened, and the frame that shows it."""

    time_us: int
    rule: str
    machines: tuple[int, ...]
    what: str
    evidence: str

    def line(self, name: Callable[[int], str] = str) -> str:
        """One line for people; ``name`` turns a node-ID into a machine's name."""
        whom = ", ".join(name(node) for node in self.machines)
        shown = f"  [{self.evidence}]" if self.evidence else ""
        seconds, microseconds = divmod(self.time_us, 1_000_000)
        return f"{seconds}.{microseconds:06d} {self.rule}: {whom}: {self.what}{shown}"
