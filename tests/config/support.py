"""Texts of site files, and what is said of wrong ones."""

from pathlib import Path

import pytest

from onboard.config.problems import ConfigError
from onboard.config.site import parse_site

ROOT = Path(__file__).parents[2]

#: Two floors, a lift at each end, a spur, a compartment and a robot.
TWO_FLOORS = """\
[site]
name = "two"

[floors]
count = 2
positions = 8

[[lifts]]
name = "LL"
node = 2
end = "left"

[[lifts]]
name = "LR"
node = 3
end = "right"

[[spurs]]
at = "p(2,5)"

[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"

[[robots]]
name = "MR1"
node = 11
home = "p(2,3)"
"""


def problems_of(text: str) -> list[str]:
    """The lines that a person sees for a wrong site file named ``s.toml``."""
    with pytest.raises(ConfigError) as caught:
        parse_site(text, "s.toml")
    return str(caught.value).splitlines()


def changed(old: str, new: str, text: str = TWO_FLOORS) -> str:
    """The text with one passage changed, which it must contain exactly once."""
    assert text.count(old) == 1
    return text.replace(old, new)
