"""Whatever stands at a key of a site file, of each system: a person gets mistakes in lines, or a site."""

import re

import pytest

from bus_sim.sites import site_text
from onboard.config.problems import MOST_NAMED, ConfigError
from onboard.config.site import parse_site
from tests.mapd import sites

#: One value of each kind, a list of lists, and numbers that no float holds and no machine word.
VALUES = ("[]", '[["a"], {}, 0]', "nan", "1" + "0" * 400, '"p(1,1)"', "1979-05-27")
SITES = {name: site_text(name) for name in ("level1", "graph", "cell", "turning", "terminal")}
SITES["mapd"] = sites.site_text(2, [(0, "1,2", "3,5")])


def keys_of(text: str) -> list[int]:
    """The first line of each key of each kind of table."""
    head = ""
    found: dict[tuple[str, str], int] = {}
    for number, line in enumerate(text.splitlines()):
        if line.startswith("["):
            head = line
        elif match := re.match(r"([a-z_0-9]+) *=", line):
            found.setdefault((head, match[1]), number)
    return list(found.values())


@pytest.mark.parametrize("name", SITES)
def test_any_value_at_any_key(name: str) -> None:
    """A list among the works of a tool, and a whole number too long for a float, ended in a traceback."""
    lines = SITES[name].splitlines()
    for place in keys_of(SITES[name]):
        key = lines[place].split("=")[0]
        for value in VALUES:
            changed = [*lines[:place], f"{key}= {value}", *lines[place + 1 :]]
            try:
                parse_site("\n".join(changed), "s.toml")
            except ConfigError as error:
                told = str(error).splitlines()
                assert 1 <= len(told) <= MOST_NAMED + 1, (key, value)
