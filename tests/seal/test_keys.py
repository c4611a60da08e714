"""Key files: made at commissioning, read by a board, refused with one line where they are not fit."""

from pathlib import Path

import pytest

from bus_sim.processes.fleet import write_keys
from bus_sim.seals import SimulatedSeals
from onboard.cli import main
from onboard.config.keys import load_keys, machine_keys
from onboard.config.problems import ConfigError
from onboard.config.site import load_site, parse_site
from onboard.core.site import Site
from onboard.io.seal_lives import SealLivesError, next_life
from onboard.systems.contract import codecs_for
from tests.seal.test_site import site_with

TEXT = (Path(__file__).parents[2] / "bus_sim" / "sites" / "level1.toml").read_text(encoding="utf-8")


def sealed(word: str) -> str:
    return TEXT.replace("[site]\n", f'[site]\nseals = "{word}"\n')


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Site, Path]:
    """A site and the folder of its keys."""
    folder = tmp_path_factory.mktemp("keys")
    (folder / "site.toml").write_text(sealed("required"), encoding="utf-8")
    assert main(["keys", "make", str(folder / "site.toml"), "--folder", str(folder / "kept")]) == 0
    return load_site(folder / "site.toml"), folder / "kept"


def test_a_site_without_the_word_is_the_site_that_it_was() -> None:
    plain, off = parse_site(TEXT, "a"), parse_site(sealed("off"), "a")
    assert plain == off and plain.seals == "off"
    assert len({parse_site(sealed(word), "a").digest for word in ("off", "watch", "required")}) == 3
    with pytest.raises(ConfigError, match=r'site.seals = "on": unknown word'):
        parse_site(sealed("on"), "a")


def test_two_nodes_have_the_same_key_and_nobody_else_has_it(made: tuple[Site, Path]) -> None:
    site, folder = made
    names = {machine.node_id: machine.name for machine in site.machines.values()} | {251: "tool-251"}
    keys = {node: load_keys(folder / f"{name}.keys", site, node) for node, name in names.items()}
    assert len({one.group for one in keys.values()}) == 1
    assert all(keys[one].pairs[other] == keys[other].pairs[one] for one in keys for other in keys if one != other)
    every = [key for one in keys.values() for key in (*one.pairs.values(), one.group)]
    assert len(set(every)) == len(keys) * (len(keys) - 1) // 2 + 1
    assert all(file.stat().st_mode & 0o077 == 0 for file in (folder, *folder.iterdir()))


def test_a_board_finds_its_keys_beside_its_journal_and_does_not_start_without(
    made: tuple[Site, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, folder = made
    (tmp_path / "site.toml").write_text(sealed("required"), encoding="utf-8")
    machine = tmp_path / "mr1.toml"
    bus = '[fleet_bus]\ninterface = "virtual"\nchannel = "x"\n'
    machine.write_text(f'[machine]\nname = "MR1"\nsite = "site.toml"\njournal = "j"\n{bus}', encoding="utf-8")
    assert main(["--machine", str(machine)]) == 2
    assert f"{tmp_path}/j.keys: does not exist; name an existing key file" in capsys.readouterr().err
    node = site.machine("MR1").node_id
    (tmp_path / "j.keys").write_bytes((folder / "MR1.keys").read_bytes())
    (tmp_path / "j.keys").chmod(0o644)
    with pytest.raises(ConfigError, match=r"j.keys: others may read it; chmod 600"):
        machine_keys(tmp_path / "j", site, node)
    (tmp_path / "j.keys").chmod(0o600)
    keys = machine_keys(tmp_path / "j", site, node)
    assert keys is not None and keys.node == node
    assert machine_keys(tmp_path / "none", parse_site(TEXT, "a"), node) is None


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("node = 11", "node = 12", ":5: keys.node = 12: this is node 11; name the key file of this node"),
        ('site = "level1"', 'site = "other"', ':4: keys.site = "other": the site is level1;'),
        ('group = "', 'group = "x', ':7: keys.group = "...": is no key of 64 hexadecimal digits; write the file again'),
        ('1 = "', '2 = "', ": with = 1: the site has a machine that these keys do not know;"),
    ],
)
def test_a_wrong_file_is_told_in_one_line_that_holds_no_key(
    made: tuple[Site, Path], tmp_path: Path, old: str, new: str, line: str
) -> None:
    site, folder = made
    text = (folder / "MR1.keys").read_text(encoding="utf-8")
    file = tmp_path / "a.keys"
    file.touch(mode=0o600)
    file.write_text(text.replace(f"\n{old}", f"\n{new}"), encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_keys(file, site, 11)
    assert line in str(error.value)
    assert not any(word.strip('"') in str(error.value) for word in text.split() if len(word) > 60)


def test_keys_stay_until_they_are_renewed(made: tuple[Site, Path], tmp_path: Path) -> None:
    site, _ = made
    words = [str(tmp_path / "site.toml"), "--folder", str(tmp_path / "kept"), "--tools", ""]
    (tmp_path / "site.toml").write_text(sealed("required"), encoding="utf-8")
    assert main(["keys", "make", *words]) == 0
    first = load_keys(tmp_path / "kept" / "MR1.keys", site)
    assert main(["keys", "make", *words]) == 0
    again = load_keys(tmp_path / "kept" / "MR1.keys", site)
    assert (again.group, again.pairs) == (first.group, first.pairs) and again.made >= first.made
    assert main(["keys", "renew", words[0], "MR1", *words[1:]]) == 0
    other = load_keys(tmp_path / "kept" / "MR1.keys", site)
    assert other.group != first.group and not set(other.pairs.values()) & set(first.pairs.values())


def test_secret_keys_do_not_come_into_a_checkout(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / ".git").mkdir()
    assert main(["keys", "make", "level1", "--folder", str(tmp_path / "kept")]) == 2
    assert "is inside the checkout" in capsys.readouterr().err
    assert not (tmp_path / "kept").exists()


def test_no_life_has_the_number_of_another(tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    assert [next_life(journal, 100) for _ in range(3)] == [101, 102, 103]
    # Keys that were written later begin above all lives of the old ones, and old ones go on.
    assert next_life(journal, 1_000) == 1_001
    assert next_life(journal, 100) == 1_002
    (tmp_path / "journal.lives").write_text("", encoding="ascii")
    with pytest.raises(SealLivesError, match="holds no number of a life; delete it, and give"):
        next_life(journal, 100)


def test_a_simulated_machines_process_finds_the_keys_of_its_run(tmp_path: Path) -> None:
    site = load_site(Path(site_with("required", tmp_path)))
    seals = SimulatedSeals(site, 1, codecs_for(site).fleet.decode_part)
    write_keys(tmp_path, site, seals, ("R1",))
    assert [file.name for file in tmp_path.glob("*.keys")] == ["journal-R1.keys"]
    keys = machine_keys(tmp_path / "journal-R1", site, 11)
    assert keys is not None and (keys.group, keys.pairs) == (seals.keys(11).group, seals.keys(11).pairs)
