"""The small checker on board, held to the library that has no wheel for every board."""

import json
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from onboard.gateway.schema import Schema, schema
from tests.graph.test_named_orders import action, order
from tests.mqtt.logs import OWN

NAMES = ("transport", "2.1.0/order", "2.1.0/instantActions", "3.0.0/order", "3.0.0/instantActions")
ODD = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 5) | st.floats(allow_nan=False, width=16) | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=2) | st.dictionaries(st.sampled_from(["key", "value", "x"]), inner, max_size=2)
    ),
    max_leaves=4,
)


def good(name: str) -> dict[str, Any]:
    """A value that fits."""
    if name == "transport":
        return {"id": "a", "car": "1.7", "from": "p", "to": "IOC1", "before": "2026-03-01T06:00:00Z", "priority": 3}
    version, kind = name.split("/")
    if kind == "order":
        return order("a", (0, "pick"), (1, ""), version=version)
    found = action("stateRequest", "a", version)
    found["actions"][0]["actionParameters"] = [{"key": "k", "value": 1.5}]
    return found


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in a value."""
    found = [path] if path else []
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in parts:
        found += places(one, (*path, key))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_what_fits_is_taken(name: str) -> None:
    assert schema(name).first_error(good(name)) is None


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=120, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_it_agrees_with_the_library_on_values_that_were_changed_anywhere(name: str, data: st.DataObject) -> None:
    value = good(name)
    path = data.draw(st.sampled_from(places(value)))
    inside = value
    for key in path[:-1]:
        inside = inside[key]
    if data.draw(st.booleans()) and isinstance(inside, dict):
        del inside[path[-1]]
    else:
        inside[path[-1]] = data.draw(ODD)
    judge = Draft202012Validator(json.loads((OWN / f"{name}.schema").read_text(encoding="utf-8")))
    wrong = schema(name).first_error(value)
    assert (wrong is None) is judge.is_valid(value), wrong
    if wrong is not None:
        assert wrong[0].startswith("$") and wrong[1]


def test_a_schema_with_a_word_that_is_not_checked_does_not_load() -> None:
    with pytest.raises(ValueError, match="not checked: oneOf"):
        Schema({"type": "object", "properties": {"a": {"oneOf": []}}})


def test_the_place_that_is_wrong_is_named() -> None:
    value = order("a", (0, "pick"), (1, ""))
    value["nodes"][1]["released"] = "yes"
    assert schema("2.1.0/order").first_error(value) == ("$.nodes[1].released", "must be boolean")
    assert schema("transport").first_error({"id": "a", "priority": 12}) == ("$.priority", "must be at most 9")
