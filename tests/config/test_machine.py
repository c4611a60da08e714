"""What a machine file means, and what is said of wrong ones."""

from pathlib import Path

import pytest

from onboard.config.machine import BusInterface, load_machine
from onboard.config.problems import ConfigError
from tests.config.support import TWO_FLOORS, changed

MACHINE = """\
[machine]
name = "MR1"
site = "site/two.toml"

[fleet_bus]
interface = "socketcan"
channel = "can0"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "two.toml").write_text(TWO_FLOORS, encoding="utf-8")
    return tmp_path


def write(folder: Path, text: str) -> Path:
    (folder / "mr1.toml").write_text(text, encoding="utf-8")
    return folder / "mr1.toml"


def mistakes(folder: Path, text: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_machine(write(folder, text))
    return [line.replace(f"{folder}/", "") for line in str(caught.value).splitlines()]


def test_a_short_file_names_machine_site_and_bus_and_the_rest_follows(folder: Path) -> None:
    config = load_machine(write(folder, MACHINE))
    assert (config.machine.node_id, config.machine.name, config.site.name) == (11, "MR1", "two")
    assert config.fleet_bus == config.device_bus == BusInterface("socketcan", "can0", 500_000)
    assert config.journal == folder / "journal-MR1"


def test_every_key_counts(folder: Path) -> None:
    text = changed('site = "', 'node = 11\njournal = "state/journal"\nsite = "', MACHINE)
    text += 'receive_own_messages = true\n[device_bus]\ninterface = "kvaser"\nchannel = 1\nbitrate = 125_000\n'
    text += 'tseg1 = 5\nhost = "gateway"\ntimeout = 0.5\n'
    config = load_machine(write(folder, text))
    assert config.fleet_bus == BusInterface("socketcan", "can0", 500_000, (("receive_own_messages", True),))
    extra = (("host", "gateway"), ("timeout", 0.5), ("tseg1", 5))
    assert config.device_bus == BusInterface("kvaser", "1", 125_000, extra)
    assert config.journal == folder / "state" / "journal"


def test_a_machine_may_be_named_by_its_node_id(folder: Path) -> None:
    assert load_machine(write(folder, changed('name = "MR1"', "node = 1", MACHINE))).machine.name == "IOC1"


def test_buses_without_a_bitrate_run_at_the_sites(folder: Path) -> None:
    slow = changed('name = "two"', 'name = "two"\nbitrate = 125_000')
    (folder / "site" / "two.toml").write_text(slow, encoding="utf-8")
    config = load_machine(write(folder, MACHINE + '[device_bus]\ninterface = "virtual"\nchannel = "x"\n'))
    assert (config.fleet_bus.bitrate, config.device_bus.bitrate) == (125_000, 125_000)


def test_the_mistakes_of_both_files_are_told_at_once(folder: Path) -> None:
    (folder / "site" / "two.toml").write_text(changed("count = 2", "count = 200"), encoding="utf-8")
    text = changed('interface = "socketcan"\n', "", MACHINE) + "[device_bus]\nchannel = true\nfilter = [1]\n"
    assert mistakes(folder, changed('site = "', 'jurnal = "x"\nsite = "', text)) == [
        'mr1.toml:3: machine.jurnal: unknown key; did you mean "journal"?',
        "mr1.toml:6: fleet_bus.interface: missing; write a text in quotes",
        "mr1.toml:8: device_bus.interface: missing; write a text in quotes",
        "mr1.toml:9: device_bus.channel = true: is true or false; write a text in quotes",
        "mr1.toml:10: device_bus.filter = [1]: is a list; write a text, a number, true or false",
        "site/two.toml:5: floors.count = 200: out of range; write a whole number from 1 to 127",
    ]


KNOWN = "machines there: IOC1 (node 1), LL (node 2), LR (node 3), MR1 (node 11)"
ONE_MISTAKE = {
    "unknown machine": (
        '"MR1"',
        '"MR2"',
        f'mr1.toml:2: machine.name = "MR2": no such machine in site two; {KNOWN}',
    ),
    "unknown node-ID": (
        'name = "MR1"',
        "node = 12",
        f"mr1.toml:2: machine.node = 12: no such machine in site two; {KNOWN}",
    ),
    "name of one and node-ID of another": (
        'name = "MR1"',
        'name = "MR1"\nnode = 1',
        f"mr1.toml:3: machine.node = 1: MR1 has another node-ID in site two; {KNOWN}",
    ),
    "neither name nor node-ID": (
        'name = "MR1"\n',
        "",
        "mr1.toml:1: machine.name: missing; write a text in quotes",
    ),
    "no site": ('site = "site/two.toml"\n', "", "mr1.toml:1: machine.site: missing; write a text in quotes"),
    "no site file": (
        '"site/two.toml"',
        '"two.toml"',
        'mr1.toml:3: machine.site = "two.toml": no file "two.toml"; write its path as seen from the machine file',
    ),
    "other bitrate": (
        'channel = "can0"\n',
        'channel = "can0"\nbitrate = 250_000\n',
        "mr1.toml:8: fleet_bus.bitrate = 250000: site two runs its fleet bus at 500000 bit/s; leave the key out",
    ),
}


@pytest.mark.parametrize(("old", "new", "line"), ONE_MISTAKE.values(), ids=ONE_MISTAKE.keys())
def test_one_mistake_gives_one_line(folder: Path, old: str, new: str, line: str) -> None:
    assert mistakes(folder, changed(old, new, MACHINE)) == [line]


def test_a_file_without_a_fleet_bus_is_told_what_one_needs(folder: Path) -> None:
    assert mistakes(folder, MACHINE.partition("[fleet_bus]")[0]) == [
        "mr1.toml: fleet_bus: missing; add a table [fleet_bus]",
        "mr1.toml: fleet_bus.interface: missing; write a text in quotes",
        "mr1.toml: fleet_bus.channel: missing; write a text in quotes",
    ]


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_machine(tmp_path / "none.toml")
    assert str(caught.value) == f"{tmp_path / 'none.toml'}: does not exist; name an existing machine file"
