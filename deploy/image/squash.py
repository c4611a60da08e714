"""A squashfs from an archive, always the same from the same archive, and read back before it is believed.

mksquashfs 4.5.1 once in about thirty runs, on a busy machine with two processors, wrote a file system with blocks that
could not be unpacked, and reported success.
"""

import shutil
import tarfile
from pathlib import Path

from deploy.image.apt import run_tool
from deploy.image.debian import EPOCH_S
from deploy.wheels import DeployError

#: A fifth larger than at the highest level, and made in a tenth of the time.
LEVEL = "3"
_ATTEMPTS = 3


def make_squashfs(archive: Path, to: Path) -> None:
    """Write what a tar archive holds as a squashfs. Raises ``DeployError``."""
    for _ in range(_ATTEMPTS):
        _write(archive, to)
        if reads_back(to, archive):
            return
    raise DeployError(f"mksquashfs: {to} cannot be read back, {_ATTEMPTS} times; is the memory of this computer sound?")


def _write(archive: Path, to: Path) -> None:
    to.unlink(missing_ok=True)
    settings = ["-tar", "-quiet", "-no-progress", "-root-mode", "755", "-comp", "zstd", "-Xcompression-level", LEVEL]
    times = ["-mkfs-time", str(EPOCH_S), "-all-time", str(EPOCH_S), "-reproducible"]
    run_tool(["mksquashfs", "-", str(to), *settings, *times], source=archive)


def reads_back(squashfs: Path, archive: Path) -> bool:
    """Whether every file in a squashfs is that of the archive."""
    folder = squashfs.with_suffix(".check")
    shutil.rmtree(folder, ignore_errors=True)
    try:
        run_tool(["unsquashfs", "-quiet", "-no-progress", "-no-xattrs", "-dest", str(folder), str(squashfs)])
        with tarfile.open(archive) as wanted:
            return all(_is_same(wanted, entry, folder) for entry in wanted if entry.isreg())
    except DeployError:
        # It could not be unpacked.
        return False
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _is_same(wanted: tarfile.TarFile, entry: tarfile.TarInfo, folder: Path) -> bool:
    content = wanted.extractfile(entry)
    assert content is not None
    return (folder / entry.name).read_bytes() == content.read()
