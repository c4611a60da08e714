"""The root file system: Debian's archive and our layer in one squashfs. Same inputs, same bytes, so one digest."""

import hashlib
import io
import re
import shutil
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from deploy.image.debian import EPOCH_S, STORE, Debian, fetch_debian
from deploy.image.layer import build_layer
from deploy.image.needs import check_room
from deploy.image.release import Release
from deploy.image.squash import make_squashfs
from deploy.update.board import SIGNATURE
from hil.guest.initrd import newc
from hil.guest.kernel import Kernel

#: Who the controller is; the number is the image's own.
USER, USER_ID = "onboard", 900
#: Modules that lead to the root file system on emulated machines and on SD cards.
_FIRST_MODULES = ("virtio_pci", "virtio_blk", "sdhci_iproc", "bcm2835", "squashfs", "ext4")
#: What came with the making of the archive and says nothing.
_LEFT_OUT = re.compile(
    r"\./(var/cache/apt/|var/lib/apt/lists/|var/log/|dev/|etc/\.pwd\.lock$|var/cache/ldconfig/|etc/apt/(sources\.list|apt\.conf\.d/99mmdebstrap)).*"
)
_INIT = """\
#!/bin/busybox sh
b=/bin/busybox
$b mkdir -p /proc /sys /dev /new
$b mount -t proc proc /proc
$b mount -t sysfs sysfs /sys
$b mount -t devtmpfs dev /dev
while read module; do $b insmod /modules/$module; done < /modules/order
root=
number=
for word in $($b cat /proc/cmdline); do
    case $word in
    onboard.root=*) root=${word#onboard.root=} ;;
    onboard.slot=a) number=2 ;;
    onboard.slot=b) number=3 ;;
    esac
done
# Our disk has our signature, whatever the board calls it.
look() {
    for file in /sys/class/block/*/partition; do
        [ -e $file ] && [ "$($b cat $file)" = "$number" ] || continue
        part=${file%/partition}
        disk=$($b readlink -f $part/..)
        [ "$($b dd if=/dev/${disk##*/} bs=4 skip=110 count=1 2>/dev/null)" = @SIGNATURE@ ] && root=/dev/${part##*/}
    done
}
tries=0
while [ ! -b "$root" ] && [ $tries -lt 100 ]; do
    [ -z "$number" ] || look
    $b sleep 0.1
    tries=$((tries + 1))
done
if ! $b mount -t squashfs -o ro "$root" /new; then
    echo "onboard: no root file system in ${root:-slot with partition number $number}"
    $b sleep 3
    $b reboot -f
fi
$b mount --move /dev /new/dev
$b umount /sys
$b umount /proc
exec $b switch_root /new /sbin/init
"""


@dataclass(frozen=True, slots=True)
class Root:
    """What a machine boots: kernel, first file system, root file system with its SHA-256."""

    kernel: Path
    initrd: Path
    squashfs: Path
    digest: str


def build_root(to: Path, release: Release, store: Path = STORE) -> Root:
    """Write ``vmlinuz``, ``initrd`` and ``root.squashfs`` into a folder. Raises ``DeployError``, ``OSError``."""
    debian = fetch_debian(store)
    check_room(to)
    to.mkdir(parents=True, exist_ok=True)
    layer = build_layer(debian, release, to / "layer")
    merged, squashfs = to / "root.tar", to / "root.squashfs"
    with tarfile.open(merged, "w", format=tarfile.GNU_FORMAT) as archive:
        for entry, content in _merged(debian.base, layer):
            archive.addfile(entry, content)
    shutil.rmtree(layer)
    make_squashfs(merged, squashfs)
    merged.unlink()
    kernel = _kernel(debian)
    shutil.copyfile(kernel.image, to / "vmlinuz")
    (to / "initrd").write_bytes(_initrd(debian, kernel))
    digest = hashlib.sha256(squashfs.read_bytes()).hexdigest()
    return Root(to / "vmlinuz", to / "initrd", squashfs, digest)


def _merged(base: Path, layer: Path) -> Iterator[tuple[tarfile.TarInfo, IO[bytes] | None]]:
    """Debian's entries in their order, but those that the layer replaces; then the layer's, by name."""
    ours = {f"./{file.relative_to(layer).as_posix()}": file for file in sorted(layer.rglob("*"))}
    seen: set[str] = set()
    with tarfile.open(base) as archive:
        for entry in archive:
            name = entry.name if entry.name.startswith("./") else f"./{entry.name}"
            seen.add(name)
            replaced = name in ours and (ours[name].is_symlink() or not ours[name].is_dir())
            if replaced or _LEFT_OUT.match(name):
                continue
            content = archive.extractfile(entry) if entry.isfile() else None
            edited = _edited(name, content.read()) if content is not None and name in _EDITED else None
            if edited is not None:
                entry.size, content = len(edited), io.BytesIO(edited)
            entry.mtime = min(int(entry.mtime), EPOCH_S)
            yield entry, content
    with tarfile.open(fileobj=io.BytesIO(), mode="w") as maker:
        for name, file in ours.items():
            if name in seen and file.is_dir() and not file.is_symlink():
                continue
            entry = maker.gettarinfo(file, name)
            entry.uid = entry.gid = 0
            entry.uname = entry.gname = "root"
            entry.mtime = EPOCH_S
            entry.mode = 0o755 if entry.isdir() or entry.mode & 0o100 else 0o644
            yield entry, io.BytesIO(file.read_bytes()) if entry.isreg() else None


_EDITED = ("./etc/passwd", "./etc/group", "./etc/shadow", "./etc/machine-id")


def _edited(name: str, text: bytes) -> bytes:
    """The controller's user, no password for anybody, and a machine number that the first boot draws."""
    match name:
        case "./etc/passwd":
            return text + f"{USER}:x:{USER_ID}:{USER_ID}:controller:/:/usr/sbin/nologin\n".encode()
        case "./etc/group":
            return text + f"{USER}:x:{USER_ID}:\n".encode()
        case "./etc/shadow":
            return re.sub(rb"(?m)^([^:]+):[^:]*:[0-9]*", rb"\1:!*:19000", text) + f"{USER}:!*:19000::::::\n".encode()
        case _:
            return b""


def _kernel(debian: Debian) -> Kernel:
    modules = {file.stem.replace("-", "_"): file for file in sorted(debian.kernel.rglob("*.ko"))}
    return Kernel(next(debian.kernel.glob("boot/vmlinuz-*")), modules)


def _initrd(debian: Debian, kernel: Kernel) -> bytes:
    order = kernel.load_order(_FIRST_MODULES)
    busybox = (debian.busybox / "bin" / "busybox").read_bytes()
    return newc(
        [
            ("bin", 0o040755, b""),
            ("modules", 0o040755, b""),
            ("bin/busybox", 0o100755, busybox),
            ("init", 0o100755, _INIT.replace("@SIGNATURE@", SIGNATURE.decode()).encode()),
            ("modules/order", 0o100644, "".join(f"{file.name}\n" for file in order).encode()),
            *((f"modules/{file.name}", 0o100644, file.read_bytes()) for file in order),
        ]
    )
