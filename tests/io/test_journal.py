"""The journal: what it accepted survives, and what it cannot vouch for it refuses."""

import errno
import json
import os
import sys
import zlib
from hashlib import blake2s
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.core.journal_state import JournalState
from onboard.io.journal import FILE_NAME, FileJournal, JournalDamagedError
from onboard.io.sealed import SLOT_BYTES, SLOTS_BYTES, begin
from onboard.io.sealed import read as read_bytes
from onboard.ports.journal import Entry

ENTRIES: list[Entry] = [
    {"record": "boot", "boot": 1},
    {"record": "grant", "text": 'a "quoted" \n line', "version": -1},
    {"record": "custody", "car": "Zoë"},
]
#: About as long as the records of a car park.
MANY: list[Entry] = [
    {"record": "token_held", "kind": 1, "number": 65_536 + n, "version": n, "holder": 11} for n in range(80)
]
OWNER = "small node 11"


def opened(directory: Path, owner: str = OWNER) -> FileJournal:
    names = iter(f"{number:016x}" for number in range(1, 100))
    return FileJournal(directory, owner, lambda: next(names))


async def write(directory: Path, entries: list[Entry]) -> bytes:
    journal = opened(directory)
    journal.replay()
    for entry in entries:
        await journal.append(entry)
    await journal.close()
    return (directory / FILE_NAME).read_bytes()


async def read(directory: Path, owner: str = OWNER) -> tuple[list[Entry], JournalState]:
    journal = opened(directory, owner)
    try:
        return journal.replay(), journal.condition.state
    finally:
        await journal.close()


def lines_of(content: bytes) -> list[bytes]:
    return content[SLOTS_BYTES:].splitlines(keepends=True)


def slots_of(content: bytes) -> list[bytes]:
    return [content[:SLOT_BYTES], content[SLOT_BYTES:SLOTS_BYTES]]


async def test_the_first_life_is_told_and_entries_survive_and_more_follow(tmp_path: Path) -> None:
    assert await read(tmp_path) == ([], JournalState.NEW)
    await write(tmp_path, ENTRIES[:2])
    await write(tmp_path, ENTRIES[2:])
    assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)


async def test_whatever_of_an_append_reaches_the_medium_it_costs_only_itself(tmp_path: Path) -> None:
    """Power is cut during the one sync: the line is there up to any byte, its slot old, half written or new."""
    path = tmp_path / FILE_NAME
    before = await write(tmp_path, ENTRIES[:2])
    after = await write(tmp_path, ENTRIES[2:])
    changed = [number for number in (0, 1) if slots_of(before)[number] != slots_of(after)[number]]
    assert len(changed) == 1, "one slot is always left alone"
    new = slots_of(after)[changed[0]]
    old = slots_of(before)[changed[0]]
    for slot in (old, new[:2048] + old[2048:], old[:2048] + new[2048:], new):
        slots = slots_of(before)
        slots[changed[0]] = slot
        for length in range(len(before), len(after) + 1):
            path.write_bytes(b"".join(slots) + after[SLOTS_BYTES:length])
            entries, state = await read(tmp_path)
            counts = slot == new or length == len(after)
            assert entries == ENTRIES[: 3 if counts else 2]
            assert state in (JournalState.INTACT, JournalState.TORN, JournalState.MENDED)
            assert (await read(tmp_path)) == (entries, JournalState.INTACT), "once mended it is whole"


async def test_the_journal_goes_on_after_a_torn_write(tmp_path: Path) -> None:
    whole = await write(tmp_path, ENTRIES[:2])
    (tmp_path / FILE_NAME).write_bytes(whole + b"1234")
    await write(tmp_path, ENTRIES[2:])
    assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)


@pytest.mark.parametrize("lost", [1, 2, 20, 35, 45, 50, 80])
async def test_records_that_are_lost_at_the_end_come_back_or_are_missed(tmp_path: Path, lost: int) -> None:
    """However the file was shortened: it is never taken for a torn write."""
    whole = await write(tmp_path, MANY)
    lines = lines_of(whole)
    kept = b"".join(lines[: len(lines) - lost])
    tail = b"".join(lines[len(lines) - lost :])
    ends = [b"", bytes(len(tail)), tail[: len(tail) // 2] if lost == 1 else b"", tail.replace(b"token", b"tokem")]
    for end in ends:
        (tmp_path / FILE_NAME).write_bytes(whole[:SLOTS_BYTES] + kept + end)
        journal = opened(tmp_path)
        entries, found = journal.replay(), journal.condition
        if found.state is JournalState.MENDED:
            assert entries == MANY and found.mended == lost
        else:
            assert (found.state, found.missing, entries) == (JournalState.SHORT, lost, MANY[: 80 - lost])
            assert f"{lost} of 80 records are damaged or missing" in found.why
            with pytest.raises(JournalDamagedError):
                await journal.append(ENTRIES[0])
        assert (found.state is JournalState.MENDED) == (lost <= 35)
        await journal.close()


async def test_a_damaged_record_anywhere_is_found(tmp_path: Path) -> None:
    whole = await write(tmp_path, MANY)
    path = tmp_path / FILE_NAME
    for at in range(SLOTS_BYTES, len(whole), 97):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        entries, state = await read(tmp_path)
        assert (entries == MANY) == (state is JournalState.MENDED)
        assert state in (JournalState.MENDED, JournalState.SHORT, JournalState.FOREIGN)


async def test_one_damaged_slot_costs_nothing_and_both_are_told(tmp_path: Path) -> None:
    whole = await write(tmp_path, ENTRIES)
    for at in (0, SLOT_BYTES):
        (tmp_path / FILE_NAME).write_bytes(whole[:at] + bytes(SLOT_BYTES) + whole[at + SLOT_BYTES :])
        assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)
    (tmp_path / FILE_NAME).write_bytes(bytes(SLOTS_BYTES) + whole[SLOTS_BYTES:])
    assert await read(tmp_path) == (ENTRIES, JournalState.SHORT)
    (tmp_path / FILE_NAME).write_bytes(b"")
    assert await read(tmp_path) == ([], JournalState.SHORT)


async def test_another_machines_journal_is_foreign_and_left_as_it_is(tmp_path: Path) -> None:
    whole = await write(tmp_path, ENTRIES)
    journal = opened(tmp_path, "small node 12")
    assert journal.replay() == []
    assert journal.condition.state is JournalState.FOREIGN
    assert "the journal of small node 11, not of small node 12" in journal.condition.why
    await journal.close()
    assert (tmp_path / FILE_NAME).read_bytes() == whole


def test_records_of_another_life_under_my_seal_are_foreign() -> None:
    """The same machine's journals of two lives, one's records behind the other's seal; and one record between."""
    mine, _ = begin(OWNER, "1", ENTRIES)
    other, _ = begin(OWNER, "2", ENTRIES)
    assert read_bytes(mine[:SLOTS_BYTES] + other[SLOTS_BYTES:], OWNER, "x").condition.state is JournalState.FOREIGN
    lines = lines_of(mine)
    spliced = mine[:SLOTS_BYTES] + b"".join([lines[0], lines_of(other)[1], *lines[2:]])
    found = read_bytes(spliced, OWNER, "x")
    assert (found.condition.state, found.entries) == (JournalState.MENDED, ENTRIES), "the seal's copies are believed"


async def test_a_journal_of_the_form_before_is_taken_over(tmp_path: Path) -> None:
    old = b"".join(
        b"%08x %s\n" % (zlib.crc32(body), body)
        for number, entry in enumerate(ENTRIES, 1)
        for body in [f"{number} {json.dumps(dict(entry), sort_keys=True, separators=(',', ':'))}".encode()]
    )
    (tmp_path / FILE_NAME).write_bytes(old + b"0000")
    assert await read(tmp_path) == (ENTRIES, JournalState.TORN)
    assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)
    assert len((tmp_path / FILE_NAME).read_bytes()) > SLOTS_BYTES
    (tmp_path / FILE_NAME).write_bytes(old.replace(b"grant", b"grand"))
    assert await read(tmp_path) == (ENTRIES[:1], JournalState.SHORT)


async def test_a_record_that_no_slot_can_hold_is_durable_before_its_seal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = opened(tmp_path)
    journal.replay()
    order: list[str] = []
    write_at, sync = os.pwrite, os.fdatasync

    def noted_write(descriptor: int, data: bytes, offset: int) -> int:
        order.append("line" if offset >= SLOTS_BYTES else "slot")
        return write_at(descriptor, data, offset)

    def noted_sync(descriptor: int) -> None:
        order.append("sync")
        sync(descriptor)

    monkeypatch.setattr(os, "pwrite", noted_write)
    monkeypatch.setattr(os, "fdatasync", noted_sync)
    await journal.append({"record": "long", "text": "x" * 5000})
    await journal.append(ENTRIES[0])
    await journal.close()
    assert order == ["line", "sync", "slot", "sync", "line", "slot", "sync"]
    assert (await read(tmp_path))[1] is JournalState.INTACT


async def test_one_controller_a_directory(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    with pytest.raises(OSError, match="another controller uses this journal"):
        opened(tmp_path)
    await journal.close()
    await read(tmp_path)


async def test_a_full_disk_is_told_and_leaves_no_half_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = opened(tmp_path)
    journal.replay()
    await journal.append(ENTRIES[0])
    real_write = os.pwrite

    def half(descriptor: int, data: bytes, offset: int) -> int:
        monkeypatch.setattr(os, "pwrite", full)
        return real_write(descriptor, data[: len(data) // 2], offset)

    def full(descriptor: int, data: bytes, offset: int) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", half)
    with pytest.raises(OSError, match="No space left"):
        await journal.append(ENTRIES[1])
    monkeypatch.setattr(os, "pwrite", real_write)
    await journal.append(ENTRIES[2])
    await journal.close()
    assert await read(tmp_path) == ([ENTRIES[0], ENTRIES[2]], JournalState.INTACT)


async def test_a_failed_sync_ends_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a failed fsync Linux may report success for data that it has dropped."""
    journal = opened(tmp_path)
    journal.replay()

    def fail(descriptor: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fdatasync", fail)
        with pytest.raises(OSError, match="Input/output error"):
            await journal.append(ENTRIES[0])
    with pytest.raises(OSError, match="an earlier write failed"):
        await journal.append(ENTRIES[1])
    await journal.close()


async def test_compaction_replaces_everything(tmp_path: Path) -> None:
    journal = opened(tmp_path)
    journal.replay()
    for _ in range(50):
        await journal.append(ENTRIES[1])
    long = journal.size_bytes
    await journal.compact(lambda entries: [ENTRIES[0], *entries[:1]])
    assert journal.size_bytes - SLOTS_BYTES < (long - SLOTS_BYTES) / 10
    await journal.append(ENTRIES[2])
    await journal.close()
    assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)


#: What writing a journal anew asks of the system, in this order.
STEPS = ("open", "pwrite", "fsync", "replace", "sync_directory")


@pytest.mark.parametrize("renewed", [False, True])
@pytest.mark.parametrize("step", STEPS)
async def test_a_compaction_cut_at_any_step_leaves_the_old_or_the_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, renewed: bool
) -> None:
    """The machine dies at this step: what is on the medium then is one of the two, whole, and is read as such."""
    journal = opened(tmp_path)
    journal.replay()
    for entry in MANY:
        await journal.append(entry)

    class PowerCutError(Exception):
        pass

    def die(*_: object, **__: object) -> None:
        raise PowerCutError

    with monkeypatch.context() as patch:
        target = {"replace": Path, "sync_directory": sys.modules[FileJournal.__module__]}.get(step, os)
        if renewed and step == "sync_directory":
            patch.setattr(os, "link", die)
        patch.setattr(target, "_sync_directory" if step == "sync_directory" else step, die)
        with pytest.raises(PowerCutError):
            await (journal.renew(ENTRIES) if renewed else journal.compact(lambda _: ENTRIES))
    await journal.close()
    old = step != "sync_directory" or renewed
    assert await read(tmp_path) == (MANY if old else ENTRIES, JournalState.INTACT)
    await write(tmp_path, [])


async def test_a_short_journal_is_begun_anew_and_the_old_one_kept(tmp_path: Path) -> None:
    whole = await write(tmp_path, MANY)
    short = whole[:SLOTS_BYTES] + b"".join(lines_of(whole)[:5])
    (tmp_path / FILE_NAME).write_bytes(short)
    journal = opened(tmp_path)
    assert journal.replay() == MANY[:4]
    await journal.renew(ENTRIES[:2])
    assert journal.condition.is_reliable
    await journal.append(ENTRIES[2])
    await journal.close()
    assert (tmp_path / f"{FILE_NAME}.1").read_bytes() == short
    assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)


#: What a record is not, as text: nested beyond any parser, and of other types than a record has.
NO_RECORDS = [
    b"[" * 50_000,
    b'{"a":' * 20_000,
    b"[]",
    b"7",
    b'{"record":["boot"]}',
    b'{"record":null}',
    b"{" + b"9" * 9_000,
]


def chained(body: bytes, before: bytes = b"") -> bytes:
    """A line with a link that is right: whoever can write the file can make it."""
    return b"%s %s" % (blake2s(before + b" " + body, digest_size=8).hexdigest().encode(), body)


@pytest.mark.parametrize("said", NO_RECORDS, ids=lambda said: f"{said[:12]!r}")
def test_what_is_no_record_is_damage_though_its_seal_is_right(said: bytes) -> None:
    head = begin(OWNER, "1")[0]
    after = lines_of(head)[0][:16]
    body = b"1 " + said + b"\n"
    found = read_bytes(head + chained(body.rstrip(b"\n"), after) + b"\n", OWNER, "x")
    assert (found.entries, found.condition.state) == ([], JournalState.TORN)
    old = b"%08x 1 " % zlib.crc32(b"1 " + said) + said + b"\n"
    assert read_bytes(old, OWNER, "x").condition.state is JournalState.SHORT
    slot = (said + b"\n").ljust(SLOT_BYTES - 18)[: SLOT_BYTES - 18] + b"\n"
    assert read_bytes(chained(slot, b"slot") * 2, OWNER, "x").condition.state is JournalState.SHORT


async def test_a_journal_that_does_not_end_is_left_alone(tmp_path: Path) -> None:
    """A device, or a file of holes: neither is held in memory."""
    (tmp_path / FILE_NAME).symlink_to("/dev/zero")
    journal = opened(tmp_path)
    assert journal.replay() == [] and journal.condition.state is JournalState.SHORT
    assert "is longer than 32 MB" in journal.condition.line
    with pytest.raises(JournalDamagedError):
        await journal.append(ENTRIES[0])
    await journal.renew(ENTRIES)
    await journal.close()
    assert await read(tmp_path) == (ENTRIES, JournalState.INTACT)


async def test_what_could_not_be_read_again_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = await write(tmp_path, ENTRIES[:2])
    monkeypatch.setattr("onboard.io.journal.MOST_BYTES", len(whole) + 20)
    journal = opened(tmp_path)
    assert journal.replay() == ENTRIES[:2]
    with pytest.raises(OSError, match="a journal takes"):
        await journal.append(ENTRIES[2])
    await journal.close()
    assert await read(tmp_path) == (ENTRIES[:2], JournalState.INTACT)


@given(st.binary(max_size=200))
def test_no_file_content_is_read_as_an_entry(content: bytes) -> None:
    found = read_bytes(content, OWNER, "x")
    assert found.entries == [] and not found.condition.is_reliable


@given(st.data())
def test_no_damage_is_taken_for_what_was_written(data: st.DataObject) -> None:
    """Any bytes changed, cut or doubled: what is read is a prefix, and it is all of it where it counts as reliable."""
    content = bytearray(begin(OWNER, "1", MANY[:50])[0])
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1))
        to = data.draw(st.integers(at, min(len(content), at + 5_000)))
        content[at:to] = data.draw(st.sampled_from([b"", bytes(to - at), b"\xff" * (to - at), bytes(content[:50])]))
        if not content:
            break
    found = read_bytes(bytes(content), OWNER, "x")
    assert found.entries == MANY[: len(found.entries)]
    assert not found.condition.is_reliable or len(found.entries) == 50
