"""The site's digest: what makes two machines strangers, and what does not."""

from dataclasses import dataclass, field, fields, make_dataclass, replace
from zlib import crc32

import pytest

from bus_sim.sites import find_site, site_text
from dbc import system_dbc_text, systems
from onboard.config.site import parse_site, site_digest
from onboard.core.site import Site
from onboard.systems.car_park.site import car_park
from onboard.systems.registry import part
from tests.mapd.sites import made

#: What is added to a shipped file: one more thing that comes to the site while it runs.
MORE = {
    "graph": "[[orders]]\nat_s = 61\nvisit = [1, 7]\n",
    "cell": "[[goals]]\nat_s = 91\nfrom_mm = [12000, 30000]\nto_mm = [44000, 20000]\n",
    "turning": "[[orders]]\nat_s = 61\ndrawing = 1\nmaterial = 1\nbar_mm = 16\n",
    "terminal": '[[missions]]\nat_s = 31\ntranship = ["B14"]\nto = "S1"\n'
    '[[blockages]]\nlane = "L11"\nat_s = 101\nfor_s = 90\n',
}


@pytest.mark.parametrize("name", MORE)
def test_what_comes_to_a_site_makes_no_strangers(name: str) -> None:
    other = parse_site(f"{site_text(name)}\n{MORE[name]}", f"{name}.toml")
    assert other != replace(find_site(name), digest=other.digest), "nothing was added"
    assert other.digest == find_site(name).digest


def test_tasks_of_pick_up_and_delivery_make_no_strangers() -> None:
    one, other = made(2, [(0, "1,2", "3,5")]), made(2, [(1, "1,2", "3,5"), (4, "2,4", "0,6")])
    assert one.tasks != other.tasks
    assert one.digest == other.digest
    assert made(3, [(0, "1,2", "3,5")]).digest != one.digest


def test_a_field_that_a_later_version_adds_changes_nothing_until_it_is_used() -> None:
    site = find_site("level1")
    names = {one.name: getattr(site, one.name) for one in fields(site)}
    later = make_dataclass("Later", [("doors", int, field(default=1))], bases=(type(site),), frozen=True, kw_only=True)
    assert site_digest(later(**names)) == site.digest
    assert site_digest(later(**names, doors=2)) != site.digest


def _site_of(system: str) -> Site:
    """One on which all words of its system are said."""
    if system == "mapd":
        return made(2, [])
    return replace(car_park(find_site("level1")), promises=True) if system == "car-park" else find_site(system)


@pytest.mark.parametrize("system", systems())
def test_builds_that_mean_other_things_by_a_systems_own_words_are_strangers(
    system: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = system_dbc_text(system)
    assert text is not None
    lines = [line for line in text.splitlines() if line.startswith(("BO_ ", " SG_ "))]
    module, site = part(system, "frames"), _site_of(system)
    assert module is not None and crc32("\n".join(lines).encode()) == module.WORDS
    before = site_digest(site)
    monkeypatch.setattr(module, "WORDS", module.WORDS ^ 1)
    assert site_digest(site) != before


def test_words_that_a_site_does_not_ask_for_make_no_strangers_there(monkeypatch: pytest.MonkeyPatch) -> None:
    module, site = part("car-park", "frames"), find_site("level1")
    assert module is not None
    monkeypatch.setattr(module, "WORDS", module.WORDS ^ 1)
    assert site_digest(site) == site.digest


def test_defaults_are_left_out_at_any_depth() -> None:
    @dataclass(frozen=True)
    class Door:
        width_mm: int
        is_double: bool = False

    @dataclass(frozen=True, kw_only=True)
    class Gates(Site):
        doors: tuple[Door, ...]

    @dataclass(frozen=True)
    class OldDoor:
        width_mm: int

    level1 = find_site("level1")
    common = {one.name: getattr(level1, one.name) for one in fields(Site)}
    now, then = Gates(**common, doors=(Door(900),)), Gates(**common, doors=(OldDoor(900),))  # type: ignore[arg-type]  # as an older version has it
    assert site_digest(now) == site_digest(then)
    assert site_digest(replace(now, doors=(Door(900, is_double=True),))) != site_digest(now)
