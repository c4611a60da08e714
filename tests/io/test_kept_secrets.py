"""The file with the desks' secret: made once, kept from others, the same for all desks, never on the fleet bus."""

from pathlib import Path

import pytest

from bus_sim.sites import site_text
from onboard.cli import main
from onboard.io.kept_secrets import KeptSecrets, kept_secrets, secrets_path
from onboard.io.owned_file import OwnedFileError

FIRST, SECOND = "ab" * 32, "cd" * 32
BUS = 'interface = "virtual"\nchannel = "{}"\n'


def written(path: Path, text: str, mode: int = 0o600) -> Path:
    path.write_text(text)
    path.chmod(mode)
    return path


def test_a_secret_is_drawn_once_for_its_owner_alone(tmp_path: Path) -> None:
    path = secrets_path(tmp_path / "journal-IOC1")
    made = kept_secrets(path)
    assert made.is_new
    assert len(made.secrets[0]) == 32
    assert path.stat().st_mode & 0o777 == 0o600
    assert kept_secrets(path) == KeptSecrets(made.secrets, is_new=False)
    assert kept_secrets(tmp_path / "other").secrets != made.secrets


@pytest.mark.parametrize(
    ("text", "mode", "why"),
    [
        (f"{FIRST}\n", 0o640, "others may read it; chmod 600"),
        ("", 0o600, "is not one line of 64"),
        (f"{FIRST[:-2]}\n", 0o600, "is not one line of 64"),
        (f"{FIRST}\n{SECOND}\n{FIRST}\n", 0o600, "is not one line of 64"),
    ],
    ids=["open", "empty", "short", "too many"],
)
def test_a_file_that_is_none_is_refused_and_never_told(tmp_path: Path, text: str, mode: int, why: str) -> None:
    with pytest.raises(OwnedFileError, match=why) as error:
        kept_secrets(written(tmp_path / "secret", text, mode))
    assert FIRST[:16] not in str(error.value)


def test_a_new_secret_stands_before_the_one_so_far_in_one_file_for_all_desks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "kept"
    words = ["keys", "tickets", "standard", "--folder", str(kept)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "IOC1, IOC2, IOC3 as JOURNAL.tickets" in said
    file = kept / "desks.tickets"
    assert file.stat().st_mode & 0o777 == 0o600
    first = kept_secrets(file).secrets
    assert main(words) == main(words) == 0
    newest = kept_secrets(file).secrets
    assert len(newest) == 2, "the newest and the one before"
    assert first[0] not in newest
    assert not any(secret.hex() in capsys.readouterr().out for secret in newest)


def test_a_site_without_desks_has_no_tickets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "tickets", "cell", "--folder", str(tmp_path)]) == 2
    assert "no machine of cell prints tickets; name the site file of a car park" in capsys.readouterr().err


def test_a_desk_whose_devices_are_on_the_fleet_bus_is_not_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], shared_site: Path
) -> None:
    def checked(machine: str, *tables: str) -> int:
        text = f'[machine]\nname = "{machine}"\nsite = "{shared_site}"\n' + "".join(tables)
        return main(["--machine", str(written(tmp_path / "one.toml", text)), "--check"])

    fleet, devices = f"[fleet_bus]\n{BUS.format('a')}", f"[device_bus]\n{BUS.format('b')}"
    assert checked("IOC1", fleet) == 2
    assert "IOC1: its tickets would be read on the fleet bus; give its devices a bus" in capsys.readouterr().err
    assert checked("IOC1", fleet, devices) == checked("MR1", fleet) == 0


@pytest.fixture
def shared_site(tmp_path: Path) -> Path:
    return written(tmp_path / "site.toml", site_text("small"))
