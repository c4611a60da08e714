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
DEPLOY = Path(__file__).parents[1]
SHARED = DEPLOY / "files"
#: Where Debian's Python looks for libraries that the distribution brings.
LIBRARIES = "usr/lib/python3/dist-packages"
#: Debian 12's.
PYTHON = (3, 11)
_UNITS = "usr/lib/systemd/system"
_OWN_UNITS = (
    "onboard-emulated.service",
    *("onboard-judge.service", "onboard-trial.service", "onboard-deadline.service", "onboard-stick.service"),
)
_PLACES = {
    SHARED / "onboard.service": f"{_UNITS}/onboard.service",
    SHARED / "onboard-clock.service": f"{_UNITS}/onboard-clock.service",
    SHARED / "clock": "usr/lib/onboard/clock",
    SHARED / "network": "usr/lib/onboard/network",
    FILES / "take-over": "usr/lib/onboard/take-over",
    SHARED / "70-can.link": "usr/lib/systemd/network/70-can.link",
    FILES / "image.conf": f"{_UNITS}/onboard.service.d/image.conf",
    **{FILES / name: f"{_UNITS}/{name}" for name in _OWN_UNITS},
    FILES / "50-onboard.conf": "usr/lib/systemd/system.conf.d/50-onboard.conf",
    FILES / "fstab": "etc/fstab",
    FILES / "90-onboard-stick.rules": "usr/lib/udev/rules.d/90-onboard-stick.rules",
}
#: Units that are started with the board, and by which target.
_ENABLED = {
    **dict.fromkeys(("onboard.service", "onboard-emulated.service", "systemd-networkd.service"), "multi-user"),
    **dict.fromkeys(("onboard-judge.service", "onboard-trial.service", "onboard-clock.service"), "multi-user"),
    "onboard-deadline.service": "sysinit",
}
#: Nobody logs in, nothing updates itself, no clock of the net is asked.
_MASKED = (
    *("getty@.service", "serial-getty@.service", "console-getty.service", "systemd-logind.service"),
    *("systemd-timesyncd.service", "systemd-firstboot.service", "e2scrub_reap.service"),
    *("apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer", "e2scrub_all.timer", "fstrim.timer"),
)
_PROGRAM = "#!/usr/bin/python3 -I\nimport sys\n\nfrom {module} import main\n\nsys.exit(main())\n"
_PROGRAMS = {"onboard": "onboard.cli", "onboard-update": "deploy.update.__main__"}


def build_layer(debian: Debian, release: Release, to: Path) -> Path:
    """Write the layer as a folder. Raises ``DeployError`` where a wheel cannot be had, ``OSError``."""
    shutil.rmtree(to, ignore_errors=True)
    files = {place: source.read_bytes() for source, place in _PLACES.items()}
    files["etc/hostname"] = b"onboard\n"
    for name, content in {**files, **release.files()}.items():
        _put(to / name, content)
    for name in ("clock", "take-over"):
        (to / "usr/lib/onboard" / name).chmod(0o755)
    for name, module in _PROGRAMS.items():
        _put(to / "usr/bin" / name, _PROGRAM.format(module=module).encode())
        (to / "usr/bin" / name).chmod(0o755)
    for folder in ("boot/onboard", "var/lib/onboard"):
        (to / folder).mkdir(parents=True)
    for name, target in _ENABLED.items():
        _link(to / f"etc/systemd/system/{target}.target.wants" / name, f"/{_UNITS}/{name}")
    for name in _MASKED:
        _link(to / "etc/systemd/system" / name, "/dev/null")
    shutil.copytree(debian.kernel / "lib" / "modules", to / "usr/lib/modules")
    _add_libraries(to)
    return to


def _put(file: Path, content: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)


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
    for file in (DEPLOY / "__init__.py", *(DEPLOY / "update").glob("*.py")):
        _put(libraries / file.relative_to(DEPLOY.parent), file.read_bytes())
    if sys.version_info[:2] != PYTHON:
        raise DeployError(f"the boards' Python is {PYTHON[0]}.{PYTHON[1]}; build with that version")
    # The order within a compiled set follows the hash seed.
    words = ["-q", "-j", "1", "--invalidation-mode", "unchecked-hash", "-s", str(to), "-p", "/", str(libraries)]
    subprocess.run([sys.executable, "-m", "compileall", *words], env={**os.environ, "PYTHONHASHSEED": "0"}, check=True)
