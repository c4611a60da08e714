"""The Debian package for a system of one's own: program, service and the kernel's queue length.

The format is deb(5): an ``ar`` archive of three members. Same sources, same bytes.
"""

import gzip
import io
import tarfile
from pathlib import Path

import onboard
from deploy.archive import build_archive

FILES = Path(__file__).with_name("files")
#: Where each file goes, and its mode.
_PLACES = {
    "onboard": ("usr/bin/onboard", 0o755),
    "onboard.service": ("usr/lib/systemd/system/onboard.service", 0o644),
    "70-can.link": ("usr/lib/systemd/network/70-can.link", 0o644),
    **{
        f"onboard-{name}.service": (f"usr/lib/systemd/system/onboard-{name}.service", 0o644)
        for name in ("gateway", "web", "recorder", "clock")
    },
    "record": ("usr/lib/onboard/record", 0o755),
    "clock": ("usr/lib/onboard/clock", 0o755),
    "network": ("usr/lib/onboard/network", 0o755),
}
_CONTROL = """\
Package: onboard-fleet
Version: {version}
Architecture: all
Maintainer: the project's maintainers <maintainers@localhost>
Depends: python3 (>= 3.11), iproute2
Recommends: can-utils
Section: net
Priority: optional
Description: on-board controller of one machine of a fleet, over a CAN bus
 Runs the controller that /boot/onboard/machine.toml describes, under systemd's
 watchdog. The service is not enabled by installing: systemctl enable onboard
"""
_TIME_S = 315_532_800  # 1980-01-01, as in the archive


def build_package(to: Path) -> Path:
    """Write the package. Raises ``DeployError``, ``OSError``."""
    archive = build_archive(to.with_suffix(".pyz"))
    data = {place: ((FILES / name).read_bytes(), mode) for name, (place, mode) in _PLACES.items()}
    data["usr/lib/onboard/onboard.pyz"] = (archive.read_bytes(), 0o644)
    archive.unlink()
    control = {"control": (_CONTROL.format(version=onboard.__version__).encode(), 0o644)}
    members = {"debian-binary": b"2.0\n", "control.tar.gz": _tar(control), "data.tar.gz": _tar(data)}
    to.write_bytes(b"!<arch>\n" + b"".join(_member(name, content) for name, content in members.items()))
    return to


def _tar(files: dict[str, tuple[bytes, int]]) -> bytes:
    """A packed archive with every folder above a file, owned by root."""
    raw = io.BytesIO()
    with tarfile.open(fileobj=raw, mode="w", format=tarfile.GNU_FORMAT) as archive:
        folders = {parent.as_posix() for name in files for parent in Path(name).parents}
        for name in sorted(folders | set(files)):
            entry = tarfile.TarInfo("./" if name == "." else f"./{name}")
            entry.mtime = _TIME_S
            entry.uname = entry.gname = "root"
            content, entry.mode = files.get(name, (b"", 0o755))
            entry.size = len(content)
            entry.type = tarfile.REGTYPE if name in files else tarfile.DIRTYPE
            archive.addfile(entry, io.BytesIO(content))
    return gzip.compress(raw.getvalue(), mtime=0)


def _member(name: str, content: bytes) -> bytes:
    """A member of an ``ar`` archive: a header of 60 bytes, content padded to two."""
    header = f"{name:<16}{_TIME_S:<12}{0:<6}{0:<6}{'100644':<8}{len(content):<10}`\n"
    return header.encode("ascii") + content + b"\n" * (len(content) % 2)
