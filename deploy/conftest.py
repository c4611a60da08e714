"""``pytest deploy``: what takes minutes and root, and is not part of ``make test``."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.fleet import write_fleet
from deploy.image.disk import copy_disk
from deploy.image.emulate import personalise
from deploy.image.image import Image, build_image
from deploy.image.release import Release
from deploy.update.signature import make_keys

SITE = Path(__file__).parents[1] / "bus_sim" / "sites" / "level1.toml"


#: Does to the controller what ``deploy/harm.py`` says, where the kernel's parameters have test.harm.
UNIT = b"""\
[Unit]
ConditionKernelCommandLine=test.harm
After=onboard.service
RequiresMountsFor=/var/lib/onboard
[Service]
ExecStart=/usr/bin/python3 -I /usr/lib/test/harm.py
StandardOutput=journal+console
StandardError=journal+console
[Install]
WantedBy=multi-user.target
"""


@pytest.fixture(scope="session")
def secret(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The secret key of the updates that the image takes; the public one is beside it."""
    folder = Path(tmp_path_factory.mktemp("keys"))
    make_keys(folder / "key.pem", folder / "key.pub.pem")
    return folder / "key.pem"


@pytest.fixture(scope="session")
def release(secret: Path) -> Release:
    """What the image says of itself."""
    extra = {
        "usr/lib/test/harm.py": Path(__file__).with_name("harm.py").read_bytes(),
        "etc/systemd/system/test-harm.service": UNIT,
        "etc/systemd/system/multi-user.target.d/test.conf": b"[Unit]\nWants=test-harm.service\n",
    }
    return Release("1.0", secret.with_suffix(".pub.pem").read_bytes(), extra)


@pytest.fixture(scope="session")
def image(release: Release, tmp_path_factory: pytest.TempPathFactory) -> Image:
    """One image for all tests of a session: to build it takes minutes."""
    return build_image(Path(tmp_path_factory.mktemp("image")) / "onboard.img", release)


@pytest.fixture
def disk(image: Image, tmp_path: Path) -> Iterator[Path]:
    """A card as it comes from flashing, without a machine's files."""
    copy = copy_disk(image.disk, tmp_path / "disk.img")
    yield copy
    # What a board writes fills holes: the cards of all tests together would fill a small disk.
    copy.unlink()


@pytest.fixture
def mr1(disk: Path, tmp_path: Path) -> Path:
    """MR1's card: its files on the boot partition."""
    write_fleet(SITE, tmp_path / "fleet")
    personalise(disk, [tmp_path / "fleet" / "MR1" / name for name in ("machine.toml", "site.toml")])
    return disk
