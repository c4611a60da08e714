"""The reference pages say what the loaders do: every key, with its range and default."""

import re
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import pytest

from onboard.config.machine import load_machine
from onboard.config.problems import ConfigError
from onboard.config.reader import TomlTable
from onboard.config.site import parse_site
from onboard.core.site import Segment
from onboard.systems.car_park.site import car_park
from tests.config.support import ROOT

SITE_PAGE = ROOT / "docs" / "site-file.md"
MACHINE_PAGE = ROOT / "docs" / "machine-file.md"


class Bounds(NamedTuple):
    low: int
    high: int
    default: int | None


class Asked:
    """Keys that a loader asks for, by section as the pages head them, and the bounds of whole numbers."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.keys: dict[str, set[str]] = defaultdict(set)
        self.bounds: dict[tuple[str, str], Bounds] = {}
        integer, check_unknown = TomlTable.integer, TomlTable.check_unknown

        def watched_integer(table: TomlTable, name: str, low: int, high: int, default: int | None = None) -> int:
            self.bounds[section_of(table), name] = Bounds(low, high, default)
            return integer(table, name, low, high, default)

        def watched_check(table: TomlTable) -> None:
            self.keys[section_of(table)] |= table.asked
            check_unknown(table)

        monkeypatch.setattr(TomlTable, "integer", watched_integer)
        monkeypatch.setattr(TomlTable, "check_unknown", watched_check)


def section_of(table: TomlTable) -> str:
    if any(isinstance(part, int) for part in table.path):
        return f"[[{table.path[0]}]]"
    return "[" + ".".join("N" if str(part).isdigit() else str(part) for part in table.path) + "]"


def rows_of(page: Path) -> dict[str, dict[str, tuple[str, str]]]:
    """Range and default of each key by section."""
    rows: dict[str, dict[str, tuple[str, str]]] = {}
    section = ""
    for line in page.read_text(encoding="utf-8").splitlines():
        heading = re.fullmatch(r"### `(.+)`", line)
        if heading:
            section = heading[1]
            rows[section] = {}
        row = re.match(r"\| `(\w+)` \| (.+?) \| (.+?) \|", line)
        if row:
            rows[section][row[1]] = (row[2], row[3])
    return rows


def examples_of(page: Path) -> list[str]:
    return re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def assert_bounds_are_told(asked: Asked, rows: dict[str, dict[str, tuple[str, str]]]) -> None:
    for (section, key), bounds in asked.bounds.items():
        told, default = rows[section][key]
        assert told.endswith(f"{bounds.low} to {bounds.high}"), (section, key)
        if re.fullmatch(r"\d+", default):
            assert bounds.default == int(default), (section, key)
        elif default == "required":
            assert bounds.default is None, (section, key)


def test_the_site_page_names_every_key_with_its_range_and_default(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked(monkeypatch)
    rows = rows_of(SITE_PAGE)
    for text in examples_of(SITE_PAGE):
        car_park(parse_site(text, "site-file.md"))
    told = {section: set(keys) for section, keys in rows.items() if section != "[stewards]"}
    for keys in asked.keys.values():
        keys -= {str(number) for number in range(256)}
    assert told == {section: keys for section, keys in asked.keys.items() if section not in ("[]", "[stewards]")}
    assert asked.keys["[]"] == {re.sub(r"\W", "", section) for section in rows if section != "[floors.N]"}
    assert_bounds_are_told(asked, rows)


def test_the_example_of_the_site_page_means_what_its_comments_say() -> None:
    site = car_park(parse_site(examples_of(SITE_PAGE)[0], "site-file.md"))
    assert [site.tracks[number].length for number in (1, 9, 10, 128, 129)] == [40, 40, 30, 10, 5]
    assert not [place for place in site.places if place.index == 20]
    assert site.machine("MR3").home == Segment(192, 1)
    assert len(site.places) == 9 * 2 * 40 + 30 - (9 * 2 + 1) - 1 - 4 - 1


def test_the_line_of_a_mistake_on_the_site_page_is_what_is_printed() -> None:
    text = (ROOT / "bus_sim" / "sites" / "level1.toml").read_text(encoding="utf-8")
    with pytest.raises(Exception, match="no such segment") as caught:
        parse_site(text.replace('home = "p(1,2)"', 'home = "p(1,99)"'), "level1.toml")
    assert f"```\n{caught.value}\n```" in SITE_PAGE.read_text(encoding="utf-8")


def test_the_line_of_too_few_refuges_on_the_site_page_is_what_is_printed() -> None:
    text = (ROOT / "bus_sim" / "sites" / "standard.toml").read_text(encoding="utf-8")
    more = "".join(f'[[robots]]\nname = "MR{n}"\nnode = {n + 10}\nhome = "p({n - 3},5)"\n' for n in (5, 6))
    with pytest.raises(ConfigError) as caught:
        car_park(parse_site(text + more, "standard.toml"))
    assert f"```\n{caught.value}\n```" in SITE_PAGE.read_text(encoding="utf-8")


def test_the_machine_page_names_every_key_with_its_range(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (text,) = examples_of(MACHINE_PAGE)
    level1 = (ROOT / "bus_sim" / "sites" / "level1.toml").read_text(encoding="utf-8")
    (tmp_path / "level1.toml").write_text(level1, encoding="utf-8")
    (tmp_path / "machine.toml").write_text(text.replace('name = "MR1"', 'name = "MR1"\nnode = 11'), encoding="utf-8")
    asked = Asked(monkeypatch)
    config = load_machine(tmp_path / "machine.toml")
    assert (config.machine.name, config.fleet_bus.channel, config.device_bus.channel) == ("MR1", "can0", "can1")
    rows = rows_of(MACHINE_PAGE)
    assert asked.keys["[machine]"] == set(rows["[machine]"])
    assert asked.keys["[fleet_bus]"] == asked.keys["[device_bus]"] == set(rows["[fleet_bus]"])
    for (section, key), bounds in asked.bounds.items():
        if section in ("[machine]", "[fleet_bus]"):
            assert rows[section][key][0].endswith(f"{bounds.low} to {bounds.high}"), (section, key)
