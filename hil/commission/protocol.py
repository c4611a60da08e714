"""What a commissioning leaves behind: a protocol of every step, to be printed and signed."""

import textwrap
from dataclasses import dataclass, field
from enum import Enum

_WIDTH = 100


class StepVerdict(Enum):
    """How one step ended; a protocol is passed only where every step is."""

    PASSED = "passed"
    FAILED = "FAILED"
    NOT_DONE = "not done"


@dataclass(frozen=True, slots=True)
class ProtocolLine:
    """One line of the protocol: the step, how it ended, and what was read or seen."""

    step: str
    verdict: StepVerdict
    detail: str


@dataclass
class Protocol:
    """The steps in the order in which they were done."""

    machine: str
    site: str
    begun: str
    person: str = ""
    entries: list[ProtocolLine] = field(default_factory=list)

    def note(self, step: str, verdict: StepVerdict, detail: str) -> None:
        """Add one step at the end; a step that is done again gets a further line."""
        self.entries.append(ProtocolLine(step, verdict, detail))

    @property
    def is_passed(self) -> bool:
        """Whether every step was done and none failed."""
        return bool(self.entries) and all(entry.verdict is StepVerdict.PASSED for entry in self.entries)

    def text(self) -> str:
        """The protocol as a text file."""
        lines = [
            "COMMISSIONING PROTOCOL",
            "",
            f"machine     {self.machine}",
            f"site        {self.site}",
            f"begun       {self.begun}",
            f"person      {self.person or '(no name given)'}",
            "",
        ]
        for number, entry in enumerate(self.entries, 1):
            head = f"{number:>2}  {entry.verdict.value:<9} {entry.step}: "
            lines += textwrap.wrap(head + entry.detail, _WIDTH, subsequent_indent=" " * 14)
        failed = sum(entry.verdict is StepVerdict.FAILED for entry in self.entries)
        open_steps = sum(entry.verdict is StepVerdict.NOT_DONE for entry in self.entries)
        verdict = "in order" if self.is_passed else f"NOT in order: {failed} failed, {open_steps} not done"
        lines += [
            "",
            f"The machine is {verdict}.",
            "The control system is no certified safety channel: the emergency stop must work without it.",
            "",
            "place, date ______________________________    signature ______________________________",
            "",
        ]
        return "\n".join(lines)
