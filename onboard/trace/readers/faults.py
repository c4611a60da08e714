"""What was wrong with a log, counted: nothing in it stops the reading and nothing is passed over in silence."""

from collections import Counter
from collections.abc import Iterable, Iterator
from enum import StrEnum

from onboard.trace.raw import RawFrame


class LogFault(StrEnum):
    """What can be wrong with a line or block of a log. All but BACKWARDS gave no frame."""

    NOT_A_LINE = "not a frame of this format"
    IDENTIFIER = "identifier out of range"
    DATA = "data that are not whole bytes, or more than a frame holds"
    CUT = "cut off at the end"
    BACKWARDS = "time running backwards"


class LogFaults:
    """Counts of faults, and where each came first: a line number, or a block number of a binary log."""

    def __init__(self) -> None:
        self.counts: Counter[LogFault] = Counter()
        self.first: dict[LogFault, int] = {}
        self.frames = 0
        #: Time of the last frame of each channel, us of the log.
        self.latest_us: dict[str, int] = {}

    def add(self, fault: LogFault, where: int) -> None:
        """Count one fault of the log, and keep where the first of its kind is."""
        self.counts[fault] += 1
        self.first.setdefault(fault, where)

    def lines(self) -> list[str]:
        """One line for each fault that was seen, in words."""
        return [
            f"{fault}: {count} time{'s' if count > 1 else ''}, first at {self.first[fault]}"
            for fault, count in sorted(self.counts.items())
        ]

    @property
    def is_no_log(self) -> bool:
        """Whether nothing was of the format: no frame, and no line that was meant for one."""
        meant = self.counts[LogFault.IDENTIFIER] + self.counts[LogFault.DATA]
        return not self.frames and not meant and self.counts.total() > 0

    def watch(self, frames: Iterable[tuple[int, RawFrame]]) -> Iterator[RawFrame]:
        """Passes frames on and counts times that go back on their own channel; ``frames`` come with their place.

        Two buses that were logged in turn may each be in order while the log is not.
        """
        latest = self.latest_us
        for where, frame in frames:
            self.frames += 1
            if frame.time_us < latest.get(frame.channel, frame.time_us):
                self.add(LogFault.BACKWARDS, where)
            latest[frame.channel] = frame.time_us
            yield frame
