"""What a computer lacks is told at once, and a secret key lies in no checkout."""

from pathlib import Path

import pytest

from deploy.cli import build_parser, main
from deploy.image import needs
from deploy.image.apt import run_tool
from deploy.image.needs import BASE_PACKAGES, PACKAGES, ROOM_MB, check_needs, check_room, missing_of
from deploy.update.manifest import UpdateError
from deploy.update.signature import make_keys
from deploy.wheels import DeployError
from tests.tools import require_tool

ROOT = Path(__file__).parents[2]


def test_everything_that_is_missing_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(needs, "_PATH", str(tmp_path))
    with pytest.raises(DeployError) as told:
        check_needs(tmp_path / "base.tar", is_root=False)
    said = str(told.value)
    assert said.count("\n") == 0 and "as root" in said
    assert all(package in said for package in [*PACKAGES.values(), *BASE_PACKAGES.values()])
    (tmp_path / "base.tar").touch()
    with pytest.raises(DeployError) as told:
        check_needs(tmp_path / "base.tar", is_root=False)
    assert "mmdebstrap" not in str(told.value), "it is made once"


def test_nothing_is_missing_where_all_is_there() -> None:
    assert missing_of(PACKAGES, there=PACKAGES.keys()) == []
    assert missing_of(PACKAGES, there=PACKAGES.keys() - {"mksquashfs", "unsquashfs"}) == ["squashfs-tools"]


def test_a_full_disk_is_told_before_anything_is_built(tmp_path: Path) -> None:
    check_room(tmp_path / "dist" / "root", ROOM_MB)
    with pytest.raises(DeployError, match=r"dist/root: 287 MB are free, a build takes up to \d+ MB; free some, or use"):
        check_room(tmp_path / "dist" / "root", 287)


def test_a_tool_that_fails_is_quoted_with_its_reason() -> None:
    fails = r"printf 'begun\nNo space left on device\nFATAL ERROR: Failed to write\n' >&2; exit 1"
    with pytest.raises(DeployError, match=r"^sh: No space left on device; FATAL ERROR: Failed to write$"):
        run_tool(["sh", "-c", fails])


def test_a_secret_key_is_written_into_no_checkout(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / ".git").write_text("gitdir: elsewhere")
    secret = tmp_path / "below" / "key.pem"
    secret.parent.mkdir()
    with pytest.raises(UpdateError, match="is inside the checkout"):
        make_keys(secret, secret.with_suffix(".pub.pem"))
    assert main(["keys", "--out", str(secret)]) == 2
    assert "--out" in capsys.readouterr().err
    assert not secret.exists()


def test_by_itself_it_lies_with_the_persons_own_settings(tmp_path: Path) -> None:
    require_tool("openssl")
    default: Path = build_parser().parse_args(["keys"]).out
    assert default.is_absolute() and ROOT not in default.parents
    secret = tmp_path / "onboard" / "key.pem"
    assert main(["keys", "--out", str(secret)]) == 0
    assert secret.stat().st_mode & 0o077 == 0 and secret.parent.stat().st_mode & 0o077 == 0


def test_git_passes_keys_over() -> None:
    assert "*.pem" in (ROOT / ".gitignore").read_text().splitlines()
