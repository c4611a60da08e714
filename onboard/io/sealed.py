"""The bytes of a sealed journal: two slots that say how much there must be, then one chained line a record.

::

    slot, slot        4,096 bytes each; an append writes one of them, in turn, so the other stays whole
    LINK 0 HEAD       whose journal this is, and which
    LINK 1 ENTRY      JSON with sorted keys; LINK is 64 bits of BLAKE2s over the link before and the rest of the line

A slot is ``LINK SEAL``, copies of the last records as they fit, and spaces; its LINK is over all of them. SEAL names
owner and identity, how many records there are, and the link of the last. So

* fewer records than a slot names are SHORT, whatever took them, unless the slot's copies bring them back (MENDED);
* a record or a slot of another machine, or of another life of this one, breaks the chain (FOREIGN);
* a record that no slot names was never confirmed: whole it counts, else it is cut off (TORN).

Line and slot are written together and made durable by ONE sync: where the power fails between, either the line is
there and the slot is not (the record counts), or the slot is there with its copy of the record (it counts too), or
neither (it does not). Only a record too long for a slot takes two syncs, line first. All here is a function of bytes.
"""

import json
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from hashlib import blake2s
from itertools import chain, islice
from typing import NamedTuple

from onboard.core.journal_records import JournalRecord, records_in
from onboard.core.journal_state import JournalCondition, JournalState
from onboard.ports.journal import Entry

FORMAT = 2
#: One page of the medium, bytes: a write that fails spoils one slot, never both.
SLOT_BYTES = 4096
SLOTS_BYTES = 2 * SLOT_BYTES
#: Most records that are read, and the longest line of one, bytes: a journal that is written anew in time has some
#: thousands (journal.py), the longest record a tenth of that. What is beyond them is damage, however it is chained.
MOST_RECORDS, MOST_LINE = 200_000, 100_000
_LINK_BYTES = 8
_LINK_CHARS = 2 * _LINK_BYTES
_CRC_CHARS = 8
_FIELDS = 3
#: One for all records: to make one takes as long as to use it.
_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"))
_UNREADABLE = "its seal cannot be read"


class SealedLine(NamedTuple):
    """One checked line: its number (0 is the head), what it says, its link and its bytes."""

    number: int
    entry: Entry
    link: bytes
    text: bytes


@dataclass(frozen=True, slots=True)
class HeadRecord(JournalRecord):
    """The line before the first record: whose journal this is, and which."""

    NAME = "journal"

    owner: str
    identity: str


class Seal(NamedTuple):
    """What a slot says: whose journal, which, how many records, the last one's link, and the last records again."""

    owner: str
    identity: str
    records: int
    link: str
    copies: tuple[bytes, ...]


class Write(NamedTuple):
    """Bytes for a place of the file."""

    offset: int
    data: bytes


class Appending(NamedTuple):
    """An append: the line, then its slot; ``in_two`` where the line must be durable before the slot is written."""

    line: Write
    slot: Write
    in_two: bool
    #: The newest lines that the slot holds, this one among them.
    copies: tuple[bytes, ...]


@dataclass
class Tail:
    """Where the next record goes, and what its seal must say."""

    owner: str
    identity: str
    records: int
    link: bytes
    end: int
    #: The newest lines, as many as a slot holds.
    copies: tuple[bytes, ...] = ()

    def appending(self, entry: Entry) -> Appending:
        """What to write for one more record; nothing has changed here until ``take`` is called with it."""
        line = _line(self.link, self.records + 1, _json(entry))
        copies = _as_fit((*self.copies, line), _room(self.owner))
        slot = _slot(Seal(self.owner, self.identity, self.records + 1, line[:_LINK_CHARS].decode(), copies))
        place = (self.records + 1) % 2 * SLOT_BYTES
        return Appending(Write(self.end, line), Write(place, slot), not copies, copies)

    def take(self, appending: Appending) -> None:
        """The record that ``appending`` made is on the medium: the next one is chained to it."""
        line = appending.line.data
        self.records, self.end, self.link = self.records + 1, self.end + len(line), line[:_LINK_CHARS]
        self.copies = appending.copies


@dataclass(frozen=True)
class Reading:
    """What a journal's bytes say. ``tail`` is None where nothing may be appended.

    ``end``: what stands behind it is to be cut off; ``mending`` is to be written there then.
    """

    entries: list[Entry]
    condition: JournalCondition
    tail: Tail | None
    end: int = 0
    mending: bytes = b""
    #: Written before journals were sealed: to be written anew in this form.
    is_old_form: bool = False


def begin(owner: str, identity: str, entries: Iterable[Entry] = ()) -> tuple[bytes, Tail]:
    """A whole journal of ``entries`` and its tail. ``identity`` is another one each time: a word without spaces."""
    head = _head(owner, identity)
    link, lines = head.link, [head.text]
    for number, entry in enumerate(entries, 1):
        lines.append(_line(link, number, _json(entry)))
        link = lines[-1][:_LINK_CHARS]
    records = len(lines) - 1
    copies = _as_fit(tuple(lines[1:]), _room(owner))
    slot = _slot(Seal(owner, identity, records, link.decode(), copies))
    content = slot + slot + b"".join(lines)
    return content, Tail(owner, identity, records, link, len(content), copies)


def read(content: bytes, owner: str, name: str) -> Reading:
    """Judge a journal's bytes. ``name`` is how a person finds it; never raises, whatever the bytes are."""
    if _is_old_form(content):
        return _read_old_form(content, name)
    seals = [_seal(content[at : at + SLOT_BYTES]) for at in (0, SLOT_BYTES)]
    seal = max((one for one in seals if one is not None), key=lambda one: one.records, default=None)
    lines = list(_lines(content))
    entries = [line.entry for line in lines[1:]]
    if (found := _other_owner(seal, lines, owner)) is not None:
        return _refused([], JournalState.FOREIGN, 0, f"{name}: this is the journal of {found}, not of {owner}")
    if seal is None:
        return _refused(entries, JournalState.SHORT, None, f"{name}: {_UNREADABLE}: nobody knows what is missing")
    if lines and _said(lines[0]).identity != seal.identity:
        return _refused([], JournalState.FOREIGN, 0, f"{name}: seal and records are of two journals")
    return _compare(content, seal, lines, name)


def _compare(content: bytes, seal: Seal, lines: list[SealedLine], name: str) -> Reading:
    """Hold the lines that are good against what the seal says."""
    good, state = len(lines) - 1, JournalState.INTACT
    end = SLOTS_BYTES + sum(len(line.text) for line in lines)
    if good >= seal.records:
        if lines[seal.records].link.decode() != seal.link:
            return _refused([], JournalState.FOREIGN, 0, f"{name}: its records are not those that were sealed")
        state = JournalState.TORN if end < len(content) else state
        restored: list[SealedLine] = []
    else:
        restored = _restored(seal, lines)
        if not restored:
            missing = seal.records - max(good, 0)
            why = f"{name}: {missing} of {seal.records} records are damaged or missing: the medium has failed"
            return _refused([line.entry for line in lines[1:]], JournalState.SHORT, missing, why)
        state = JournalState.MENDED
    every = [*lines, *restored]
    mending = b"".join(line.text for line in restored)
    copies = _as_fit(tuple(line.text for line in every[1:]), _room(seal.owner))
    tail = Tail(seal.owner, seal.identity, len(every) - 1, every[-1].link, end + len(mending), copies)
    mended = sum(line.number > 0 for line in restored)
    why = f"{name}: {mended} records restored from their second copy" if restored else ""
    condition = JournalCondition(state, 0, mended, why)
    return Reading([line.entry for line in every[1:]], condition, tail, end, mending)


def _refused(entries: list[Entry], state: JournalState, missing: int | None, why: str) -> Reading:
    return Reading(entries, JournalCondition(state, missing, 0, why), None)


def _other_owner(seal: Seal | None, lines: list[SealedLine], owner: str) -> str | None:
    owners = [seal.owner] if seal is not None else []
    owners += [_said(line).owner for line in lines[:1]]
    return next((one for one in owners if one != owner), None)


def _restored(seal: Seal, lines: list[SealedLine]) -> list[SealedLine]:
    """The lines that are missing at the end, from the seal's copies; none where the copies do not reach back so far.

    The first line says nothing that the seal does not know.
    """
    found = [] if lines else [_head(seal.owner, seal.identity)]
    last = (lines or found)[-1]
    for text in seal.copies:
        line = _checked(text, last.number + 1, last.link)
        if line is not None:
            found.append(line)
            last = line
    return found if last.number == seal.records and last.link.decode() == seal.link else []


def _lines(content: bytes) -> Iterator[SealedLine]:
    """Good lines behind the slots from the first on, up to the first that is not."""
    link = b""
    for number, text in enumerate(islice(_split(content, SLOTS_BYTES), 1 + MOST_RECORDS)):
        line = _checked(text, number, link)
        if line is None:
            return
        yield line
        link = line.link


def _split(content: bytes, start: int) -> Iterator[bytes]:
    """Lines with their ends, one by one: a list of all would take a multiple of what they take."""
    while start < len(content):
        end = content.find(b"\n", start) + 1 or len(content)
        yield content[start:end]
        start = end


def _entry(text: bytes) -> Entry | None:
    """One flat record; None for anything else. A link is no proof of who made it: what it holds is looked at too."""
    if len(text) > MOST_LINE:
        return None
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    is_flat = isinstance(found, dict) and all(isinstance(value, str | int) for value in found.values())
    return found if is_flat else None


def _checked(text: bytes, number: int, before: bytes) -> SealedLine | None:
    fields = text.rstrip(b"\n").split(b" ", _FIELDS - 1)
    if len(fields) != _FIELDS or not text.endswith(b"\n") or fields[1] != b"%d" % number:
        return None
    body = b" ".join(fields[1:])
    if fields[0] != _link(before, body):
        return None
    entry = _entry(fields[2])
    return SealedLine(number, entry, fields[0], text) if entry is not None else None


def _said(head: SealedLine) -> HeadRecord:
    """What the first line says; of one that is no head, nobody's."""
    return next(records_in([head.entry], HeadRecord), HeadRecord("nobody", ""))


def _head(owner: str, identity: str) -> SealedLine:
    entry = HeadRecord(owner, identity).entry
    text = _line(b"", 0, _json(entry))
    return SealedLine(0, entry, text[:_LINK_CHARS], text)


def _line(before: bytes, number: int, entry: bytes) -> bytes:
    body = b"%d %s" % (number, entry)
    return b"%s %s\n" % (_link(before, body), body)


def _link(before: bytes, body: bytes) -> bytes:
    return blake2s(before + b" " + body, digest_size=_LINK_BYTES).hexdigest().encode()


def _json(entry: Entry) -> bytes:
    return _ENCODER.encode(dict(entry)).encode()


# --- slots -----------------------------------------------------------------------------------------------------


@cache
def _room(owner: str) -> int:
    """Bytes that a slot has for copies of records."""
    return SLOT_BYTES - 300 - 2 * len(json.dumps(owner))


def _as_fit(lines: tuple[bytes, ...], room: int) -> tuple[bytes, ...]:
    """The newest lines that fit into ``room`` bytes."""
    taken = 0
    for index in range(len(lines) - 1, -1, -1):
        taken += len(lines[index])
        if taken > room:
            return lines[index + 1 :]
    return lines


def _slot(seal: Seal) -> bytes:
    fields: Entry = {"owner": seal.owner, "identity": seal.identity, "records": seal.records, "link": seal.link}
    head = _json({**fields, "format": FORMAT, "copies": len(seal.copies)})
    body = (head + b"\n" + b"".join(seal.copies)).ljust(SLOT_BYTES - _LINK_CHARS - 2) + b"\n"
    slot = b"%s %s" % (_link(b"slot", body), body)
    assert len(slot) == SLOT_BYTES, "an owner's name that leaves no room: see _room"
    return slot


def _seal(slot: bytes) -> Seal | None:
    """What a slot says; None where it is not as it was written."""
    link, _, body = slot.partition(b" ")
    if len(slot) != SLOT_BYTES or link != _link(b"slot", body):
        return None
    head, *lines = body.split(b"\n")
    fields = _entry(head) or {}
    try:
        records, copies = int(fields["records"]), int(fields["copies"])
        owner, identity, last = (str(fields[name]) for name in ("owner", "identity", "link"))
    except (KeyError, ValueError):
        return None
    if min(records, copies) < 0:
        return None
    return Seal(owner, identity, records, last, tuple(line + b"\n" for line in lines[:copies]))


# --- the form before this one ----------------------------------------------------------------------------------


def _is_old_form(content: bytes) -> bool:
    """``CRC NUMBER ENTRY`` from the first byte on; it knew nothing of its own length."""
    return _old_entry(content.partition(b"\n")[0], 1) is not None


def _read_old_form(content: bytes, name: str) -> Reading:
    """Its entries. What is lost at its end cannot be seen; a damaged record before good ones can."""
    entries: list[Entry] = []
    state = JournalState.INTACT if content.endswith(b"\n") else JournalState.TORN
    lines = islice(_split(content, 0), MOST_RECORDS)
    for line in lines:
        entry = _old_entry(line, len(entries) + 1)
        if entry is None:
            if any(_old_entry(later, None) is not None for later in chain([line], lines)):
                why = f"{name}: record {len(entries) + 1} is damaged and later ones are not: the medium has failed"
                return _refused(entries, JournalState.SHORT, None, why)
            state = JournalState.TORN
            break
        entries.append(entry)
    return Reading(entries, JournalCondition(state), None, is_old_form=True)


def _old_entry(line: bytes, number: int | None) -> Entry | None:
    fields = line.removesuffix(b"\n").split(b" ", _FIELDS - 1)
    if len(fields) != _FIELDS or len(fields[0]) != _CRC_CHARS:
        return None
    if fields[0] != b"%08x" % zlib.crc32(b" ".join(fields[1:])):
        return None
    if number is not None and fields[1] != b"%d" % number:
        return None
    return _entry(fields[2])
