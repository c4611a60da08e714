"""The journal: what it accepted survives, and what it cannot vouch for it refuses."""

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.io.journal import FILE_NAME, FileJournal, JournalDamagedError, _parse
from onboard.ports.journal import Entry

ENTRIES: list[Entry] = [
    {"record": "boot", "boot": 1},
    {"record": "grant", "text": 'a "quoted" \n line', "version": -1},
    {"record": "custody", "car": "Zoë"},
]


async def write(directory: Path, entries: list[Entry]) -> bytes:
    journal = FileJournal(directory)
    journal.replay()
    for entry in entries:
        await journal.append(entry)
    await journal.close()
    return (directory / FILE_NAME).read_bytes()


async def read(directory: Path) -> tuple[list[Entry], int]:
    journal = FileJournal(directory)
    try:
        return journal.replay(), journal.torn
    finally:
        await journal.close()


async def test_entries_survive_and_more_follow(tmp_path: Path) -> None:
    await write(tmp_path, ENTRIES[:2])
    await write(tmp_path, ENTRIES[2:])
    assert await read(tmp_path) == (ENTRIES, 0)


async def test_a_write_torn_at_any_byte_costs_only_itself(tmp_path: Path) -> None:
    """Power is cut after each byte of the last record; the journal goes on after it."""
    whole = await write(tmp_path, ENTRIES)
    path = tmp_path / FILE_NAME
    before = len(whole) - len(whole.splitlines(keepends=True)[-1])
    for length in range(before, len(whole)):
        path.write_bytes(whole[:length])
        assert await read(tmp_path) == (ENTRIES[:2], int(length > before))
        path.write_bytes(whole[:length])
        await write(tmp_path, ENTRIES[2:])
        assert await read(tmp_path) == (ENTRIES, 0)


async def test_a_tail_of_zeros_is_a_torn_write(tmp_path: Path) -> None:
    whole = await write(tmp_path, ENTRIES)
    (tmp_path / FILE_NAME).write_bytes(whole + bytes(4096))
    assert await read(tmp_path) == (ENTRIES, 1)


@pytest.mark.parametrize("change", ["flipped", "missing", "doubled"])
async def test_damage_in_the_middle_is_refused(tmp_path: Path, change: str) -> None:
    lines = (await write(tmp_path, ENTRIES)).splitlines(keepends=True)
    middle = {"flipped": lines[1].replace(b"grant", b"grand"), "missing": b"", "doubled": lines[1] + lines[1]}[change]
    (tmp_path / FILE_NAME).write_bytes(lines[0] + middle + lines[2])
    with pytest.raises(JournalDamagedError, match=r"journal\.log: record \d is damaged"):
        await read(tmp_path)


async def test_one_controller_a_directory(tmp_path: Path) -> None:
    journal = FileJournal(tmp_path)
    with pytest.raises(OSError, match="another controller uses this journal"):
        FileJournal(tmp_path)
    await journal.close()
    await read(tmp_path)


async def test_a_full_disk_is_told_and_leaves_no_half_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = FileJournal(tmp_path)
    journal.replay()
    await journal.append(ENTRIES[0])
    real_write = os.write

    def half(descriptor: int, data: bytes) -> int:
        monkeypatch.setattr(os, "write", full)
        return real_write(descriptor, data[: len(data) // 2])

    def full(descriptor: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", half)
    with pytest.raises(OSError, match="No space left"):
        await journal.append(ENTRIES[1])
    monkeypatch.setattr(os, "write", real_write)
    await journal.append(ENTRIES[2])
    await journal.close()
    assert await read(tmp_path) == ([ENTRIES[0], ENTRIES[2]], 0)


async def test_a_failed_sync_ends_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a failed fsync Linux may report success for data that it has dropped."""
    journal = FileJournal(tmp_path)
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
    journal = FileJournal(tmp_path)
    journal.replay()
    for _ in range(50):
        await journal.append(ENTRIES[1])
    long = journal.size_bytes
    await journal.compact(ENTRIES[:2])
    assert journal.size_bytes < long / 10
    await journal.append(ENTRIES[2])
    await journal.close()
    assert await read(tmp_path) == (ENTRIES, 0)


async def test_a_compaction_cut_short_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = FileJournal(tmp_path)
    journal.replay()
    await journal.append(ENTRIES[0])

    def fail(path: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", fail)
        with pytest.raises(OSError, match="No space left"):
            await journal.compact([])
    await journal.append(ENTRIES[1])
    await journal.close()
    assert await read(tmp_path) == (ENTRIES[:2], 0)


@given(st.binary(max_size=200))
async def test_no_file_content_is_read_as_an_entry(content: bytes) -> None:
    assert _parse(content)[0] == []
