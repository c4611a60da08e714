"""The guest's first file system: a shell, the kernel's modules and one script that leads into the host's own root."""

from collections.abc import Iterable
from pathlib import Path

from hil.guest.kernel import Kernel

#: Debian's package busybox-static; it must not need a loader, for there is none yet.
BUSYBOX = Path("/bin/busybox")
#: Where the guest finds the folder that it shares with the host, for its script and its results.
SHARE = "/run/share"
#: The guest's own memory and its home: what a script leaves here ends with the guest.
WORK = "/run/guest"

#: Virtual file systems are mounted below the new root; the host's own files are the lower, read-only layer.
_INIT = """\
#!/bin/busybox sh
b=/bin/busybox
$b mkdir -p /proc /sys /dev /host /over /new
$b mount -t proc proc /proc
$b mount -t sysfs sysfs /sys
$b mount -t devtmpfs dev /dev
while read module; do $b insmod /modules/$module || echo "guest: $module: not loaded"; done < /modules/order
options=trans=virtio,version=9p2000.L,msize=262144
$b mount -t 9p -o $options,ro,cache=loose root /host || echo "guest: no root"
$b mount -t tmpfs over /over
$b mkdir /over/upper /over/work
$b mount -t overlay -o lowerdir=/host,upperdir=/over/upper,workdir=/over/work root /new || echo "guest: no overlay"
$b mount -t proc proc /new/proc
$b mount -t sysfs sysfs /new/sys
$b mount -t devtmpfs dev /new/dev
$b mkdir -p /new/dev/pts /new/dev/shm
$b mount -t devpts devpts /new/dev/pts
$b mount -t tmpfs shm /new/dev/shm
$b mount -t tmpfs run /new/run
$b mkdir -p @SHARE@ /new@SHARE@ /new/run/netns /new@WORK@
$b mount -t 9p -o $options share /new@SHARE@ || echo "guest: no share"
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=@WORK@ LANG=C.UTF-8
in_time="$b timeout -k 5 @LIMIT_S@"
$in_time $b chroot /new /bin/sh -c 'cd @WORK@ && exec /bin/sh @SHARE@/script' > /new@SHARE@/output 2>&1 < /dev/null
$b echo $? > /new@SHARE@/status
$b sync
$b reboot -f
"""


def build_initrd(kernel: Kernel, to: Path, limit_s: float) -> Path:
    """Write the archive for ``-initrd`` (format "newc", Linux Documentation/driver-api/early-userspace).

    The guest ends its script after ``limit_s`` of its own time; all else in it ends with the guest.
    """
    init = _INIT.replace("@SHARE@", SHARE).replace("@WORK@", WORK).replace("@LIMIT_S@", f"{limit_s:.0f}")
    order = kernel.load_order()
    files: list[tuple[str, int, bytes]] = [
        ("bin", 0o040755, b""),
        ("modules", 0o040755, b""),
        ("bin/busybox", 0o100755, BUSYBOX.read_bytes()),
        ("init", 0o100755, init.encode()),
        ("modules/order", 0o100644, "".join(f"{file.name}\n" for file in order).encode()),
        *((f"modules/{file.name}", 0o100644, file.read_bytes()) for file in order),
    ]
    to.write_bytes(newc(files))
    return to


def newc(files: Iterable[tuple[str, int, bytes]]) -> bytes:
    """A cpio archive of (name, mode, content), in this order; headers are 8-digit hex, all is padded to four bytes."""
    archive = bytearray()
    for number, (name, mode, content) in enumerate([*files, ("TRAILER!!!", 0, b"")], start=1):
        fields = (number, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name) + 1, 0)
        archive += b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
        archive += bytes(-len(archive) % 4) + content
        archive += bytes(-len(archive) % 4)
    return bytes(archive)
