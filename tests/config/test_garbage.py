"""Whatever stands in a site file, a person gets mistakes in lines of text, or a site."""

import tomllib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from onboard.config.problems import ConfigError, quoted
from onboard.config.site import parse_site
from tests.config.support import TWO_FLOORS

_WORDS = st.sampled_from(
    [
        *("site", "floors", "lifts", "spurs", "compartments", "robots", "stewards", "carrier", "cars", "timing"),
        *("name", "node", "at", "home", "side", "end", "count", "positions", "without", "call_window_ms"),
        *("1", "2", "128", "x\ny"),
    ]
)
_TEXTS = st.sampled_from(["", "p(1,4)", "p(0,0)", "p(999,999)", "p(*,1)", "near", "left", "MR1", "a\nb"]) | st.text()
_SCALARS = _TEXTS | st.integers(-(2**70), 2**70) | st.booleans() | st.floats() | st.integers(1, 3)
_VALUES = st.recursive(
    _SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_WORDS | st.text(), inner, max_size=6),
    max_leaves=40,
)


def toml(value: Any) -> str:
    """A value in TOML's inline form."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_basic(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return _basic(value) if isinstance(value, str) else str(value)


def _basic(text: str) -> str:
    letters = (f"\\U{ord(one):08x}" if one in '"\\' or ord(one) < 32 or ord(one) == 127 else one for one in text)
    return '"' + "".join(letters) + '"'


def judge(text: str) -> None:
    for line in mistakes(text):
        assert line.isprintable(), line
        assert line.startswith("s.toml"), line


def mistakes(text: str) -> list[str]:
    try:
        parse_site(text, "s.toml")
    except ConfigError as error:
        return [str(problem) for problem in error.problems] or ["nothing is said"]
    return []


@given(st.text())
def test_any_text(text: str) -> None:
    judge(text)


@given(st.dictionaries(_WORDS, _VALUES, max_size=8))
def test_any_toml(values: dict[str, Any]) -> None:
    text = "\n".join(f"{quoted(key)} = {toml(value)}" for key, value in values.items())
    tomllib.loads(text)
    judge(text)


@given(st.data())
def test_a_good_file_with_any_one_value_replaced(data: st.DataObject) -> None:
    lines = TWO_FLOORS.splitlines()
    number = data.draw(st.sampled_from([place for place, line in enumerate(lines) if "=" in line]))
    lines[number] = f"{lines[number].partition('=')[0]}= {toml(data.draw(_VALUES))}"
    judge("\n".join(lines))


@given(st.data())
def test_a_good_file_with_any_piece_cut_out(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(TWO_FLOORS)))
    judge(TWO_FLOORS[:start] + TWO_FLOORS[data.draw(st.integers(start, len(TWO_FLOORS))) :])
