"""What the core writes into a machine's journal, and what of it outlives compaction."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.codes import ManualMode, Reason, TokenKind
from onboard.contract.messages import Reference
from onboard.core.journal_records import Entry, JournalRecord, Keep, RecordEnd, RecordTypes, Which, records_in
from onboard.core.serial import successor

_TOKEN = ("kind", "number")
_SEGMENT = ("track", "index")


@dataclass(frozen=True, slots=True)
class BootRecord(JournalRecord):
    """A life begins, under this boot counter, 1 to 255."""

    NAME = "boot"
    RULES = (Keep("boot"),)

    boot: int


@dataclass(frozen=True, slots=True)
class TokenRecord(JournalRecord):
    """What happened to a token under ``version``; ``holder`` is a node-ID."""

    kind: TokenKind
    number: int
    version: int
    holder: int

    def load_number(self) -> int | None:
        """The load that its token is about, where it is neither a segment's nor a station's."""
        return None if self.kind in (TokenKind.SEGMENT, TokenKind.STATION) else self.number


@dataclass(frozen=True, slots=True)
class TokenHeldRecord(TokenRecord):
    """From this version on the node itself holds the token."""

    NAME = "token_held"
    RULES = (Keep("token", _TOKEN),)


# The last give of a token, and that it has come, are kept beside what came after: "I gave it to X under v" outlives
# everything (docs/protocol.md).
@dataclass(frozen=True, slots=True)
class TokenGivenRecord(TokenRecord):
    """This node gives it to ``holder``; whether it has come is not known."""

    NAME = "token_given"
    RULES = (Keep("token", _TOKEN), Keep("given", _TOKEN))


@dataclass(frozen=True, slots=True)
class TokenGoneRecord(TokenRecord):
    """``holder`` has it, by its own word."""

    NAME = "token_gone"
    RULES = (Keep("token", _TOKEN), Keep("gone", _TOKEN))


@dataclass(frozen=True, slots=True)
class RetiredRecord(JournalRecord):
    """What a token is about ended long ago: what the journal has of it may go, in all families of such a load."""

    NAME = "retired"
    RULES = (RecordEnd(("token", "given", "gone"), _TOKEN), RecordEnd(("stands", "winner", "ticket"), ("load",)))

    kind: TokenKind
    number: int
    load: Reference


@dataclass(frozen=True, slots=True)
class WayRecord(JournalRecord):
    """Whether a segment can be passed, by its steward's word. ``blocked`` and ``clear`` are both told again."""

    track: int
    index: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class BlockedRecord(WayRecord):
    """A person or a sensor said that a segment cannot be passed."""

    NAME = "blocked"
    RULES = (Keep("blocked", _SEGMENT),)


@dataclass(frozen=True, slots=True)
class ClearRecord(WayRecord):
    """A segment that was blocked can be passed again."""

    NAME = "clear"
    RULES = (Keep("clear", _SEGMENT),)


@dataclass(frozen=True, slots=True)
class ManualRecord(JournalRecord):
    """A person's order, ``number`` of node ``by``."""

    NAME = "manual"
    RULES = (Keep("manual"),)

    mode: ManualMode
    by: int
    number: int


@dataclass(frozen=True, slots=True)
class AssignedRecord(JournalRecord):
    """One line of a list of rights that is read back under ``epoch``."""

    NAME = "assigned"
    RULES = (Keep("assigned", _TOKEN),)

    epoch: int
    kind: TokenKind
    number: int
    version: int
    holder: int


@dataclass(frozen=True, slots=True)
class ReadBackRecord(JournalRecord):
    """The list of ``epoch`` is in the journal; ``lost`` is the machine whose rights are made anew."""

    NAME = "read_back"
    RULES = (Keep("read_back"),)

    epoch: int
    lost: int


@dataclass(frozen=True, slots=True)
class EpochRecord(JournalRecord):
    """The epoch that counts; what was read back is over."""

    NAME = "epoch"
    RULES = (Keep("epoch"),)

    epoch: int


@dataclass(frozen=True, slots=True)
class HeldRecord(JournalRecord):
    """The machine holds for a person; the first such hold stands until it is released."""

    NAME = "held"
    RULES = (Keep("held", which=Which.FIRST_AND_NEWEST),)

    reason: Reason
    cause: int


@dataclass(frozen=True, slots=True)
class ReleasedRecord(JournalRecord):
    """A person let it go on."""

    NAME = "released"
    RULES = (RecordEnd(("held",)),)


CORE_RECORDS: RecordTypes = (
    BootRecord,
    TokenHeldRecord,
    TokenGivenRecord,
    TokenGoneRecord,
    RetiredRecord,
    BlockedRecord,
    ClearRecord,
    ManualRecord,
    AssignedRecord,
    ReadBackRecord,
    EpochRecord,
    HeldRecord,
    ReleasedRecord,
)


def last_boot(entries: Iterable[Entry]) -> int:
    """The boot counter last journalled, 1 to 255; 0 where there is none."""
    last = 0
    for record in records_in(entries, BootRecord):
        last = record.boot
    return last


def next_boot(entries: Iterable[Entry]) -> int:
    """The boot counter after the last one journalled, 1 to 255, going round."""
    return successor(last_boot(entries), 8)
