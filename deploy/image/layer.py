"""What the image has over Debian: the program, its service, the kernel's modules, and what is switched off."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

from deploy.archive import build_archive
from deploy.image.debian import Debian
from deploy.image.release import Release
from deploy.wheels import DeployError

FILES = Path(__file__).with_name("files")
SHARED = Path(__file__).parents[1] / "files"
#: Where Debian's Python looks for libraries that the distribution brings.
LIBRARIES = "usr/lib/python3/dist-packages"
#: Debian 12's.
PYTHON = (3, 11)
_UNITS = "usr/lib/systemd/system"
_PLACES = {
    SHARED / "onboard.service": f"{_UNITS}/onboard.service",
    SHARED / "70-can.link": "usr/lib/systemd/network/70-can.link",
    FILES / "image.conf": f"{_UNITS}/onboard.service.d/image.conf",
    FILES / "onboard-emulated.service": f"{_UNITS}/onboard-emulated.service",
    FILES / "50-onboard.conf": "usr/lib/systemd/system.conf.d/50-onboard.conf",
    FILES / "fstab": "etc/fstab",
}
_ENABLED = ("onboard.service", "onboard-emulated.service", "systemd-networkd.service")
#: Nobody logs in, nothing updates itself, no clock of the net is asked.
_MASKED = (
    *("getty@.service", "serial-getty@.service", "console-getty.service", "systemd-logind.service"),
    *("systemd-timesyncd.service", "systemd-firstboot.service", "e2scrub_reap.service"),
    *("apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer", "e2scrub_all.timer", "fstrim.timer"),
)
_PROGRAM = "#!/usr/bin/python3 -I\nimport sys\n\nfrom onboard.cli import main\n\nsys.exit(main())\n"


def build_layer(debian: Debian, release: Release, to: Path) -> Path:
    """Write the layer as a folder. Raises ``DeployError`` where a wheel cannot be had, ``OSError``."""
    shutil.rmtree(to, ignore_errors=True)
    for source, place in _PLACES.items():
        target = to / place
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    program = to / "usr/bin/onboard"
    program.parent.mkdir(parents=True)
    program.write_text(_PROGRAM, encoding="utf-8")
    program.chmod(0o755)
    for name, content in release.files().items():
        file = to / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    (to / "etc/hostname").write_text("onboard\n", encoding="utf-8")
    for folder in ("boot/onboard", "var/lib/onboard"):
        (to / folder).mkdir(parents=True)
    for name in _ENABLED:
        _link(to / "etc/systemd/system/multi-user.target.wants" / name, f"/{_UNITS}/{name}")
    for name in _MASKED:
        _link(to / "etc/systemd/system" / name, "/dev/null")
    shutil.copytree(debian.kernel / "lib" / "modules", to / "usr/lib/modules")
    _add_libraries(to)
    return to


def _link(link: Path, target: str) -> None:
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(target)


def _add_libraries(to: Path) -> None:
    """The single file's content, compiled: the root cannot be written, and a board would compile at every start."""
    archive = build_archive(to.parent / "onboard.pyz")
    libraries = to / LIBRARIES
    with zipfile.ZipFile(archive) as packed:
        for name in packed.namelist():
            if (name.endswith(".py") and name != "__main__.py") or name.startswith(("dbc/", "onboard/")):
                packed.extract(name, libraries)
    archive.unlink()
    if sys.version_info[:2] != PYTHON:
        raise DeployError(f"the boards' Python is {PYTHON[0]}.{PYTHON[1]}; build with that version")
    # The order within a compiled set follows the hash seed.
    words = ["-q", "-j", "1", "--invalidation-mode", "unchecked-hash", "-s", str(to), "-p", "/", str(libraries)]
    subprocess.run([sys.executable, "-m", "compileall", *words], env={**os.environ, "PYTHONHASHSEED": "0"}, check=True)
