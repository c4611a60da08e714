"""The guest's kernel: Debian's own, fetched as a package and only unpacked, so that nothing of the host changes.

``python -m hil.guest.kernel`` fetches it into ``build/guest`` by the host's own apt, which knows its mirrors; it needs
no root. The cloud kernel is no use: it has no CAN.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

#: Where fetched kernels lie; ``make clean`` takes them away.
STORE = Path(__file__).parents[2] / "build" / "guest"
#: The package that names Debian's newest kernel of this architecture.
META_PACKAGE = "linux-image-amd64"
#: What the guest needs: its file systems, and everything of CAN that a test uses.
MODULES = (
    *("virtio_pci", "9pnet_virtio", "9p", "overlay"),
    *("can-raw", "can-bcm", "can-gw", "vcan", "vxcan", "kvaser_pci"),
)
#: Folders of the package that hold them and what they depend on.
_KEPT = (
    *("drivers/net/can", "drivers/virtio", "fs/9p", "fs/fscache", "fs/netfs", "fs/overlayfs", "net/9p", "net/can"),
)
_FETCH_S = 300


class KernelError(Exception):
    """The kernel cannot be fetched; ``str`` is one line for a person."""


@dataclass(frozen=True, slots=True)
class Kernel:
    """An unpacked kernel: the image that QEMU boots, and its modules by name."""

    image: Path
    modules: dict[str, Path]

    def load_order(self, wanted: Iterable[str] = MODULES) -> list[Path]:
        """The modules and all that they depend on, each after what it needs. Raises ``KeyError`` for one not there."""
        order: list[Path] = []

        def add(name: str) -> None:
            file = self.modules[_plain(name)]
            if file not in order:
                for needed in depends_of(file.read_bytes()):
                    add(needed)
                order.append(file)

        for name in wanted:
            add(name)
        return order


def depends_of(module: bytes) -> list[str]:
    """What a kernel module says that it needs: ``depends=`` in its ``.modinfo`` section (linux/module.h)."""
    found = re.search(rb"\0depends=([^\0]*)\0", module)
    return [name.decode() for name in found[1].split(b",") if name] if found else []


def find_kernel(store: Path = STORE) -> Kernel | None:
    """The newest kernel in the store, or None."""
    folders = sorted(store.glob("*/vmlinuz"), key=lambda file: file.stat().st_mtime)
    if not folders:
        return None
    files = sorted(folders[-1].parent.rglob("*.ko"))
    return Kernel(folders[-1], {_plain(file.stem): file for file in files})


def fetch_kernel(store: Path = STORE) -> Kernel:
    """Fetch and unpack Debian's kernel unless the store has one. Raises ``KernelError``."""
    kernel = find_kernel(store)
    if kernel is not None:
        return kernel
    missing = [tool for tool in ("apt-get", "apt-cache", "dpkg-deb") if shutil.which(tool) is None]
    if missing:
        raise KernelError(f"{missing[0]} is missing: the guest's kernel is a Debian package; use a Debian host")
    package = _package_of(_said(["apt-cache", "depends", META_PACKAGE]))
    store.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=store) as name:
        work = Path(name)
        _said(["apt-get", "download", "-q", package], work)
        deb = next(work.glob("*.deb"), None)
        if deb is None:
            raise KernelError(f"apt-get download {package}: brought no package; run apt-get update and try again")
        _unpack(deb, work / "kernel")
        (work / "kernel").rename(store / deb.stem)
    kernel = find_kernel(store)
    assert kernel is not None
    return kernel


def _package_of(depends: str) -> str:
    found = re.search(r"Depends: (linux-image-\S+)", depends)
    if found is None:
        raise KernelError(f"{META_PACKAGE}: apt does not know it; run apt-get update, or use Debian on x86-64")
    return found[1]


def _said(command: Sequence[str], folder: Path | None = None) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_FETCH_S, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise KernelError(f"{' '.join(command)}: {last}; is apt's list of packages there, and the network?")
    return done.stdout


def _unpack(deb: Path, to: Path) -> None:
    """The image as ``vmlinuz`` and the kept modules, flat."""
    raw = to / "raw"
    raw.mkdir(parents=True)
    globs = ["./boot/vmlinuz-*", *(f"./lib/modules/*/kernel/{folder}/*" for folder in _KEPT)]
    with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", str(deb)], stdout=subprocess.PIPE) as reading:
        done = subprocess.run(
            ["tar", "-x", "-C", str(raw), "--wildcards", *globs],
            stdin=reading.stdout, capture_output=True, text=True, check=False,
        )  # fmt: skip
    images = list(raw.glob("boot/vmlinuz-*"))
    if not images:
        raise KernelError(f"{deb.name}: holds no kernel image ({done.stderr.strip()[-120:]})")
    for file in raw.rglob("*.ko"):
        file.rename(to / file.name)
    images[0].rename(to / "vmlinuz")
    shutil.rmtree(raw)


def _plain(name: str) -> str:
    """The kernel takes ``-`` and ``_`` in a module's name for the same."""
    return name.replace("-", "_")


def main() -> int:
    """Fetch the kernel and say where it is; 2 where that failed."""
    try:
        print(fetch_kernel().image)
    except KernelError as error:
        print(f"hil: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
