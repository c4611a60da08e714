"""Signed updates on a board made of plain files: what is refused, what is written, and what the loader does next."""

import contextlib
import gzip
import io
import json
import os
import tarfile
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pytest

from deploy.fleet import write_fleet
from deploy.update.__main__ import last_update, status
from deploy.update.board import BoardFiles
from deploy.update.bundle import MANIFEST, write_bundle
from deploy.update.install import install as install_telling
from deploy.update.judge import judge
from deploy.update.manifest import INITRD, KERNEL, ROOT, Manifest, UpdateError
from deploy.update.signature import make_keys, public_key, sign
from deploy.update.slots import ATTEMPTS, BoardEvent, Slots, after
from tests.tools import require_tool

SITE = Path(__file__).parents[2] / "bus_sim" / "sites" / "small.toml"
PARTS = {KERNEL: b"kernel 2" * 1000, INITRD: b"initrd 2" * 100, ROOT: b"root 2" * 300_000}
SLOT_BYTES = 3_000_000
TODAY = date(2026, 11, 23)


@pytest.fixture(scope="module")
def secret(tmp_path_factory: pytest.TempPathFactory) -> Path:
    require_tool("openssl")
    folder = tmp_path_factory.mktemp("keys")
    make_keys(folder / "key.pem", folder / "key.pub.pem")
    return folder / "key.pem"


@pytest.fixture
def place(secret: Path, tmp_path: Path) -> BoardFiles:
    """MR1's board of the small site: slot A runs version 1.0, slot B is empty."""
    write_fleet(SITE, tmp_path / "fleet")
    boot = tmp_path / "fleet" / "MR1"
    (boot / "a").mkdir()
    for slot in "ab":
        (tmp_path / slot).write_bytes(b"old" + bytes(SLOT_BYTES - 3))
    (tmp_path / "release.json").write_text('{"board": "arm64", "version": "1.0"}')
    (tmp_path / "update.pem").write_bytes(public_key(secret))
    devices = {slot: tmp_path / slot for slot in "ab"}
    release, key = tmp_path / "release.json", tmp_path / "update.pem"
    made = BoardFiles("a", devices, boot, release, key, contextlib.nullcontext, lambda: TODAY)
    made.keep(Slots())
    return made


@pytest.fixture
def make(secret: Path, tmp_path: Path) -> Callable[..., Path]:
    """Makes an update file."""

    def update(version: str = "1.1", key: Path = secret, site: str = "", expires: date = TODAY, **parts: bytes) -> Path:
        folder = tmp_path / "parts"
        folder.mkdir(exist_ok=True)
        for name, content in PARTS.items():
            (folder / name).write_bytes(parts.get(name.partition(".")[0], content))
        file = tmp_path / f"{version}.update"
        write_bundle(file, {name: folder / name for name in PARTS}, key, version, site, expires)
        return file

    return update


def install(file: Path, place: BoardFiles) -> Manifest:
    said: list[str] = []
    manifest = install_telling(file, place, said.append)
    assert said == [f"version {manifest.version} is in order; writing it into slot b"]
    return manifest


def image_of(place: BoardFiles) -> list[bytes]:
    """Everything on the board that an update could change."""
    return [file.read_bytes() for file in (*place.devices.values(), *sorted(place.boot.rglob("*"))) if file.is_file()]


def started(place: BoardFiles, slot: str, version: str) -> BoardFiles:
    """The board after its boot loader has started a slot, with the system that is in it."""
    assert place.state().next_start == slot
    place.keep(after(place.state(), BoardEvent.STARTED))
    place.release.write_text(json.dumps({"board": "arm64", "version": version}))
    return replace(place, running=slot)


def refused(file: Path, place: BoardFiles) -> str:
    before = image_of(place)
    with pytest.raises(UpdateError) as why:
        install(file, place)
    assert image_of(place) == before, "something was written"
    assert "\n" not in str(why.value)
    return str(why.value)


def test_a_good_update_is_written_tried_and_stays(place: BoardFiles, make: Callable[..., Path]) -> None:
    install(make(), place)
    assert place.devices["b"].read_bytes().startswith(PARTS[ROOT]) and place.devices["a"].read_bytes()[:3] == b"old"
    assert (place.boot / "b" / KERNEL).read_bytes() == PARTS[KERNEL]
    assert (place.boot / "b" / INITRD).read_bytes() == PARTS[INITRD]
    assert status(place) == "version 1.0 runs in slot a; version 1.1 in slot b is tried at the next start"
    trial = started(place, "b", "1.1")
    assert status(trial) == "version 1.1 runs in slot b, on trial"
    assert judge(trial, lambda: True).line == "version 1.1 in slot b is healthy, and stays"
    assert trial.state() == Slots("b") and status(trial) == "version 1.1 runs in slot b"


def test_a_system_that_is_not_healthy_is_left_at_once_and_never_tried_again(
    place: BoardFiles, make: Callable[..., Path]
) -> None:
    install(make(), place)
    verdict = judge(started(place, "b", "1.1"), lambda: False)
    assert not verdict.is_good and verdict.line == "version 1.1 in slot b is not healthy; back to slot a"
    back = started(place, "a", "1.0")
    assert judge(back, lambda: False).line == "version 1.1 did not work and is given up; version 1.0 runs again"
    assert status(back) == "version 1.0 runs in slot a; version 1.1 was given up"
    assert refused(make(), back) == "version 1.1 was given up here before; make a newer one"
    assert install(make("1.2"), back).version == "1.2"


def test_a_system_that_never_says_anything_is_started_so_often_and_no_more(
    place: BoardFiles, make: Callable[..., Path]
) -> None:
    install(make(), place)
    for _ in range(ATTEMPTS):
        started(place, "b", "1.1")
    assert "did not work" in judge(started(place, "a", "1.0"), lambda: False).line


def test_a_system_without_an_update_is_not_judged(place: BoardFiles) -> None:
    before = image_of(place)
    assert judge(place, lambda: False).line == "" and image_of(place) == before


@pytest.mark.parametrize(
    ("version", "why"),
    [
        ("0.9", "version 0.9 is older than 1.0, which runs"),
        ("1.0", "version 1.0 runs already"),
    ],
)
def test_an_update_that_is_not_newer_is_refused(
    place: BoardFiles, make: Callable[..., Path], version: str, why: str
) -> None:
    assert refused(make(version), place) == why


def test_an_update_of_another_key_is_refused(place: BoardFiles, make: Callable[..., Path], tmp_path: Path) -> None:
    make_keys(tmp_path / "other.pem", tmp_path / "other.pub.pem")
    why = "it is not signed with a key that this system trusts"
    assert refused(make(key=tmp_path / "other.pem"), place) == why


def test_an_update_is_taken_until_its_last_day(place: BoardFiles, make: Callable[..., Path]) -> None:
    """Whoever kept an old one, with a weakness that is known by now, cannot put it onto a board that is older still."""
    late = replace(place, today=lambda: TODAY + timedelta(days=1))
    why = "it was to be taken until 2026-11-23, and the clock here says 2026-11-24; make it anew"
    assert refused(make(), late) == why
    assert install(make(), place).expires == TODAY


def test_what_does_not_say_until_when_is_refused(
    place: BoardFiles, make: Callable[..., Path], secret: Path, tmp_path: Path
) -> None:
    with tarfile.open(make()) as whole, tarfile.open(tmp_path / "endless.update", "w") as endless:
        parts = {entry.name: io.BytesIO(whole.extractfile(entry).read()) for entry in whole}  # type: ignore[union-attr]  # all are files
        said = json.loads(parts["manifest.json"].read())
        del said["expires"]
        parts["manifest.json"] = io.BytesIO(json.dumps(said).encode())
        parts["manifest.sig"] = io.BytesIO(sign(parts["manifest.json"].getvalue(), secret))
        for name, content in parts.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content.getvalue())
            endless.addfile(entry, content)
    assert refused(tmp_path / "endless.update", place) == "its manifest cannot be read; make the update anew"


def test_where_nothing_is_said_an_update_lives_for_some_months(secret: Path, tmp_path: Path) -> None:
    for name in PARTS:
        (tmp_path / name).write_bytes(b"x")
    manifest = write_bundle(tmp_path / "new.update", {name: tmp_path / name for name in PARTS}, secret, "1.1")
    assert timedelta(days=89) <= manifest.expires - datetime.now(UTC).date() <= timedelta(days=90)


def test_a_stolen_key_is_revoked_by_an_update_of_the_other(
    place: BoardFiles, make: Callable[..., Path], secret: Path, tmp_path: Path
) -> None:
    """A board trusts two; the one in the safe signs a system that trusts others."""
    keys = {}
    for name in ("safe", "new"):
        make_keys(tmp_path / f"{name}.pem", tmp_path / f"{name}.pub.pem")
        keys[name] = public_key(tmp_path / f"{name}.pem")
    place.key.write_bytes(public_key(secret) + keys["safe"])
    assert install(make(), place).version == "1.1"
    place.keep(Slots())
    assert install(make("1.2", key=tmp_path / "safe.pem"), place).version == "1.2"
    board = started(place, "b", "1.2")
    board.key.write_bytes(keys["new"] + keys["safe"])
    board.keep(Slots(good="b"))
    assert "is not signed with" in refused(make("1.3"), board)


def test_an_update_for_another_site_or_board_is_refused(place: BoardFiles, make: Callable[..., Path]) -> None:
    assert refused(make(site="harbour"), place) == "it is for site harbour, and this machine's is small"
    assert install(make(site="small"), place).site == "small"
    place.keep(Slots())
    place.release.write_text('{"board": "riscv64", "version": "1.0"}')
    assert refused(make(), place) == "it is for arm64 boards, and this is one of riscv64"


@pytest.mark.parametrize("length", [0, 1, 500, 1500, 5000, 600_000, -20_000])
def test_a_torn_file_is_refused(place: BoardFiles, make: Callable[..., Path], length: int) -> None:
    file = make()
    file.write_bytes(file.read_bytes()[:length])
    assert refused(file, place)


def test_a_file_that_was_changed_is_refused_wherever_the_change_is(
    place: BoardFiles, make: Callable[..., Path]
) -> None:
    whole = make().read_bytes()
    for needle, what in ((b'"version": "1.1"', "not signed"), (b"kernel 2", "vmlinuz"), (b"root 2", "root.squashfs")):
        changed = bytearray(whole)
        changed[whole.index(needle) + len(needle) - 2] ^= 1
        file = place.boot.parent / "changed.update"
        file.write_bytes(changed)
        assert what in refused(file, place)


def test_a_file_with_a_signed_manifest_and_missing_parts_is_refused(
    place: BoardFiles, make: Callable[..., Path], tmp_path: Path
) -> None:
    with tarfile.open(make()) as whole, tarfile.open(tmp_path / "part.update", "w") as part:
        for entry in whole:
            if entry.name != ROOT:
                part.addfile(entry, whole.extractfile(entry))
    assert refused(tmp_path / "part.update", place) == (
        "it has no root.squashfs; it is not an update file, or not a whole one"
    )


def test_a_file_that_is_something_else_is_refused(place: BoardFiles, tmp_path: Path) -> None:
    (tmp_path / "cat.jpg").write_bytes(b"\xff\xd8\xff" * 5000)
    assert refused(tmp_path / "cat.jpg", place) == "it is not an update file, or not a whole one"
    with tarfile.open(tmp_path / "other.tar", "w") as other:
        entry = tarfile.TarInfo(MANIFEST)
        entry.size = 1 << 17
        other.addfile(entry, io.BytesIO(bytes(entry.size)))
    assert refused(tmp_path / "other.tar", place) == "it is not an update file"


@pytest.mark.parametrize("form", [tarfile.XHDTYPE, tarfile.GNUTYPE_LONGNAME, tarfile.GNUTYPE_SPARSE, tarfile.SYMTYPE])
def test_a_head_that_a_reader_would_unfold_is_refused_unread(place: BoardFiles, tmp_path: Path, form: bytes) -> None:
    """A reader of any archive holds 4 GB of an extended head before it knows whose the file is."""
    head = tarfile.TarInfo(MANIFEST)
    head.type, head.size = form, 4 << 30
    file = tmp_path / "head.update"
    file.write_bytes(head.tobuf(tarfile.GNU_FORMAT))
    os.truncate(file, 5 << 30)
    assert refused(file, place) == "it is not an update file, or not a whole one"


def test_a_packed_update_is_not_unpacked(place: BoardFiles, make: Callable[..., Path], tmp_path: Path) -> None:
    file = tmp_path / "packed.update"
    file.write_bytes(gzip.compress(make().read_bytes(), 1))
    assert refused(file, place) == "it is not an update file, or not a whole one"


def test_what_is_no_file_is_not_opened(place: BoardFiles, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.update")
    assert refused(tmp_path / "pipe.update", place) == "it is not a file; name an update file"


def test_a_root_file_system_larger_than_the_slot_is_refused(place: BoardFiles, make: Callable[..., Path]) -> None:
    why = refused(make(root=bytes(SLOT_BYTES + 1)), place)
    assert why == f"its root file system has {SLOT_BYTES + 1} bytes, and slot b takes {SLOT_BYTES}"


def test_a_system_on_trial_takes_no_update(place: BoardFiles, make: Callable[..., Path]) -> None:
    install(make(), place)
    assert "is itself on trial" in refused(make("1.2"), started(place, "b", "1.1"))


def test_an_image_without_a_key_takes_no_update(place: BoardFiles, make: Callable[..., Path]) -> None:
    place.key.write_bytes(b"")
    assert refused(make(), place) == "this image was built without a key, so it takes no updates; flash the card anew"


def test_power_that_fails_while_a_newer_update_replaces_one_that_waits_starts_the_old_system(
    place: BoardFiles, make: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The slot is half written, so the loader must not try what was there before."""
    install(make(), place)

    def fail(*_: object) -> None:
        raise OSError(5, "Input/output error", str(place.devices["b"]))

    monkeypatch.setattr("deploy.update.install._overwrite", fail)
    with pytest.raises(OSError, match="Input/output"):
        install(make("1.2"), place)
    assert place.state() == Slots("a") and place.state().next_start == "a"


def test_a_medium_that_does_not_give_back_what_was_written_is_told(
    place: BoardFiles, make: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.update.install._overwrite", lambda *_: None)
    with pytest.raises(UpdateError, match="the medium has failed"):
        install(make(), place)
    assert place.state().next_start == "a"


def test_of_several_files_on_a_stick_the_last_is_taken(tmp_path: Path) -> None:
    with pytest.raises(UpdateError, match=r"no file that ends in \.update"):
        last_update(tmp_path)
    for name in ("onboard-1.1.update", "onboard-1.2.update", "zoo.txt"):
        (tmp_path / name).write_bytes(b"")
    assert last_update(tmp_path).name == "onboard-1.2.update"


def test_a_board_without_a_valid_machine_file_takes_updates_for_any_site_only(
    place: BoardFiles, make: Callable[..., Path]
) -> None:
    (place.boot / "machine.toml").write_text("nonsense")
    assert refused(make(site="small"), place) == "it is for site small, and this machine's is not known"
    assert install(make(), place).version == "1.1"


def test_the_secret_key_is_not_overwritten(secret: Path) -> None:
    before = secret.read_bytes()
    with pytest.raises(UpdateError, match="is there already"):
        make_keys(secret, secret.with_suffix(".pub.pem"))
    assert secret.read_bytes() == before
    assert secret.stat().st_mode & 0o077 == 0
