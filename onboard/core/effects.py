"""What the core asks of its shell. Effects are carried out in order; a ``Record`` must be durable before the next."""

from dataclasses import dataclass, field

from onboard.contract.codes import Reason
from onboard.contract.messages import Message
from onboard.core.journal_records import Entry, JournalRecord


@dataclass(frozen=True, slots=True)
class Send:
    """Say this on the fleet bus."""

    message: Message


@dataclass(frozen=True, slots=True)
class Actuate:
    """Order a device of this machine to move. Made by the answer of ``authorised`` only (core/motion_authority.py)."""

    message: Message
    #: That answer: the holon looks whose it is, and of when.
    permit: object = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Tell:
    """Say this on the machine's device bus: something by which nothing moves, such as an answer to a person."""

    message: Message


@dataclass(frozen=True, slots=True)
class Record:
    """Write this to the journal, durably before anything that follows."""

    what: JournalRecord

    @property
    def entry(self) -> Entry:
        """As it stands in the journal."""
        return self.what.entry


@dataclass(frozen=True, slots=True)
class Renew:
    """Begin the journal anew with these entries, durably before anything that follows; what was there is kept aside.

    For rights that were regenerated: the only write that a journal which is short or foreign takes.
    """

    entries: tuple[Entry, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """Tell people: one line of text, never needed by a machine."""

    text: str


@dataclass(frozen=True, slots=True)
class Halt:
    """Stop the machine safely and say why; ``reason`` decides who brings it back (onboard/io/endings.py)."""

    why: str
    reason: Reason = Reason.INVARIANT_BROKEN


Effect = Send | Actuate | Tell | Record | Renew | Report | Halt
