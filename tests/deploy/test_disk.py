"""The image's partition table and how its parts are put together; no tool, no board."""

import struct
from pathlib import Path

import pytest

from deploy.image.disk import FAT32_LBA, LINUX, DiskPartition, boot_record, copy_disk, starts, write_disk
from deploy.update.board import SIGNATURE
from deploy.wheels import DeployError


def table(record: bytes) -> list[tuple[int, int, int]]:
    """Type, first sector and length of each partition, as any reader of an MBR finds them."""
    entries = [record[446 + 16 * number :][:16] for number in range(4)]
    return [(entry[4], *struct.unpack("<II", entry[8:])) for entry in entries if entry[4]]


def test_the_partitions_follow_each_other_on_whole_megabytes() -> None:
    parts = [DiskPartition(FAT32_LBA, 3), DiskPartition(LINUX, 2), DiskPartition(LINUX, 2), DiskPartition(LINUX, 1)]
    record = boot_record(parts)
    assert len(record) == 512 and record[-2:] == b"\x55\xaa" and record[440:444] == SIGNATURE == b"ONBD"
    assert table(record) == [(12, 2048, 6144), (131, 8192, 4096), (131, 12288, 4096), (131, 16384, 2048)]
    assert starts(parts) == [first for _, first, _ in table(record)]


def test_a_fifth_partition_does_not_fit() -> None:
    with pytest.raises(ValueError, match="four partitions, not 5"):
        boot_record([DiskPartition(LINUX, 1)] * 5)


def test_contents_lie_where_the_table_says(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"a" * (1 << 20))
    (tmp_path / "b").write_bytes(b"b" * 1000)
    disk = tmp_path / "disk"
    write_disk(
        [DiskPartition(FAT32_LBA, 1, tmp_path / "a"), DiskPartition(LINUX, 1), DiskPartition(LINUX, 2, tmp_path / "b")],
        disk,
    )
    mb = 1 << 20
    whole = disk.read_bytes()
    assert len(whole) == 5 * mb
    assert whole[mb : 2 * mb] == b"a" * mb and not any(whole[2 * mb : 3 * mb])
    assert whole[3 * mb :].rstrip(b"\0") == b"b" * 1000


def test_what_does_not_fit_into_its_partition_is_told(tmp_path: Path) -> None:
    (tmp_path / "root.squashfs").write_bytes(bytes((1 << 20) + 1))
    with pytest.raises(DeployError, match=r"root\.squashfs has 1048577 bytes; its partition takes 1 MiB"):
        write_disk([DiskPartition(LINUX, 1, tmp_path / "root.squashfs")], tmp_path / "disk")


def test_a_copy_is_the_same_and_its_holes_take_no_room(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"a" * (1 << 20))
    disk = tmp_path / "disk"
    write_disk([DiskPartition(FAT32_LBA, 1, tmp_path / "a"), DiskPartition(LINUX, 64)], disk)
    copy = copy_disk(disk, tmp_path / "copy")
    assert copy.read_bytes() == disk.read_bytes()
    assert copy.stat().st_blocks * 512 < 4 << 20
