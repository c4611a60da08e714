"""What a journal's medium may have suffered when the power comes back: bytes change, as they do on an SD card."""

from collections.abc import Callable, Mapping
from typing import Final

from bus_sim.journal import SimulatedJournal
from onboard.io.sealed import SLOT_BYTES, SLOTS_BYTES, begin, read

#: A card writes and loses pages of this size, bytes.
PAGE_BYTES = 4_096


def hurt(journal: SimulatedJournal, how: str, entries: int) -> None:
    """Damage the medium as one word of ``HARMS`` says; ``entries`` counts from the end."""
    if journal.medium is not None:
        HARMS[how](journal, entries)
    journal.pending = None


def _keep(journal: SimulatedJournal, _: int) -> None:
    """Nothing happens to it."""


def _lose(journal: SimulatedJournal, _: int) -> None:
    """A new card: there is no file."""
    journal.medium = None


def _tear(journal: SimulatedJournal, _: int) -> None:
    """The write under way gets half-way, line and slot; where none is, the last line is spoilt from its middle on."""
    medium, pending = _medium(journal), journal.pending
    if pending is None:
        last = _lines_at(journal, 1)
        del medium[(last + len(medium)) // 2 :]
        return
    for offset, data in (pending.line, pending.slot):
        half = data[: len(data) // 2]
        medium[offset : offset + len(half)] = half


def _cut(journal: SimulatedJournal, entries: int) -> None:
    """The file ends before the last ``entries`` records."""
    del _medium(journal)[_lines_at(journal, entries) :]


def _zero(journal: SimulatedJournal, _: int) -> None:
    """The last page of records reads as zeros."""
    medium = _medium(journal)
    begin_at = max(SLOTS_BYTES, len(medium) - PAGE_BYTES)
    medium[begin_at:] = bytes(len(medium) - begin_at)


def _flip(journal: SimulatedJournal, entries: int) -> None:
    """One bit of one record is another."""
    medium, begin_at = _medium(journal), _lines_at(journal, entries)
    end = medium.index(b"\n", begin_at)
    medium[(begin_at + end) // 2] ^= 1


def _unseal(journal: SimulatedJournal, _: int) -> None:
    """Both slots read as zeros."""
    _medium(journal)[:SLOTS_BYTES] = bytes(2 * SLOT_BYTES)


def _exchange(journal: SimulatedJournal, _: int) -> None:
    """The card of another machine."""
    content, _tail = begin("another machine", f"{1:016x}", journal.entries)
    journal.medium = bytearray(content)


def _roll_back(journal: SimulatedJournal, entries: int) -> None:
    """A consistent copy from ``entries`` records ago: no medium can know of itself that it is old."""
    found = read(bytes(_medium(journal)), journal.owner, journal.name)
    identity = found.tail.identity if found.tail is not None else f"{0:016x}"
    content, _tail = begin(journal.owner, identity, found.entries[: max(0, len(found.entries) - entries)])
    journal.medium = bytearray(content)


def _medium(journal: SimulatedJournal) -> bytearray:
    assert journal.medium is not None
    return journal.medium


def _lines_at(journal: SimulatedJournal, entries: int) -> int:
    """Where the last ``entries`` records begin, or the first where there are fewer; the head is never touched."""
    medium = _medium(journal)
    begin_at, first = len(medium) - 1, medium.index(b"\n", SLOTS_BYTES) + 1
    for _ in range(entries):
        begin_at = medium.rfind(b"\n", SLOTS_BYTES, begin_at)
        if begin_at < first:
            return min(first, len(medium) - 1)
    return begin_at + 1


#: By name; the first is the default of a crash.
HARMS: Final[Mapping[str, Callable[[SimulatedJournal, int], None]]] = {
    "kept": _keep,
    "torn": _tear,
    "cut": _cut,
    "zeroed": _zero,
    "flipped": _flip,
    "unsealed": _unseal,
    "foreign": _exchange,
    "lost": _lose,
    "rolled_back": _roll_back,
}
