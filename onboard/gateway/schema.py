"""A checker of JSON values against the part of JSON Schema (draft 2020-12) that the schemas of this package use.

A library would bring a binary that no armv7l board has (docs/decisions.md). A keyword that this does not know makes
loading fail, so a schema is never half-checked; a test holds it to the library ``jsonschema``.
"""

import json
import re
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any

#: Keywords that say something to people only; ``format`` is looked at where its value is used.
_WORDS = frozenset(
    {"title", "description", "examples", "unit", "subtopic", "$schema", "definitions", "format", "required", "default"}
)
_CHECKED = frozenset(
    {"type", "properties", "items", "enum", "minimum", "maximum", "minLength", "maxLength", "pattern", "$ref"}
    | {"additionalProperties", "maxItems"}
)
#: Schemas by name, as files below ``schemas``.
TRANSPORT = "transport"


class Schema:
    """One schema, read once. ``first_error`` is all that a refusal needs."""

    def __init__(self, root: dict[str, Any]) -> None:
        self._root = root
        _know(root)

    def first_error(self, value: Any) -> tuple[str, str] | None:
        """Path (``$.nodes[0].released``) and reason of the first thing that is wrong; None where nothing is."""
        return next(self._errors(self._root, value, "$"), None)

    def _errors(self, schema: dict[str, Any], value: Any, path: str) -> Iterator[tuple[str, str]]:
        if "$ref" in schema:
            schema = self._root["definitions"][schema["$ref"].rsplit("/", 1)[1]]
        kinds = schema.get("type", [])
        if kinds and not any(_is_kind(value, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds)):
            yield path, f"must be {kinds if isinstance(kinds, str) else ' or '.join(kinds)}"
            return
        if "enum" in schema and value not in schema["enum"]:
            yield path, f"must be one of {', '.join(str(one) for one in schema['enum'])}"
        if isinstance(value, str):
            yield from _text_errors(schema, value, path)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield from _number_errors(schema, value, path)
        elif isinstance(value, dict):
            yield from self._object_errors(schema, value, path)
        elif isinstance(value, list):
            if len(value) > schema.get("maxItems", len(value)):
                yield path, f"must have at most {schema['maxItems']} elements"
            for number, one in enumerate(value):
                yield from self._errors(schema.get("items", {}), one, f"{path}[{number}]")

    def _object_errors(self, schema: dict[str, Any], value: dict[str, Any], path: str) -> Iterator[tuple[str, str]]:
        known = schema.get("properties", {})
        for name in schema.get("required", ()):
            if name not in value:
                yield f"{path}.{name}", "is missing"
        for name, one in value.items():
            if name in known:
                yield from self._errors(known[name], one, f"{path}.{name}")
            elif schema.get("additionalProperties") is False:
                yield f"{path}.{name[:64]}", f"is not known; one of {', '.join(known)}"


@cache
def schema(name: str) -> Schema:
    """A schema of this package: ``transport``, or ``2.1.0/order``. Raises ``ValueError`` for one it cannot check."""
    text = files("onboard.gateway").joinpath("schemas", f"{name}.schema").read_text(encoding="utf-8")
    return Schema(json.loads(text))


def _know(part: dict[str, Any]) -> None:
    unknown = part.keys() - _WORDS - _CHECKED
    if unknown:
        raise ValueError(f"keywords that are not checked: {', '.join(sorted(unknown))}")
    for one in (*part.get("properties", {}).values(), *part.get("definitions", {}).values()):
        _know(one)
    if "items" in part:
        _know(part["items"])


def _is_kind(value: Any, kind: str) -> bool:
    if kind in ("integer", "number"):
        whole = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
        return not isinstance(value, bool) and (whole if kind == "integer" else isinstance(value, int | float))
    wanted: dict[str, type] = {"string": str, "boolean": bool, "object": dict, "array": list, "null": type(None)}
    return isinstance(value, wanted[kind])


def _text_errors(schema: dict[str, Any], value: str, path: str) -> Iterator[tuple[str, str]]:
    if len(value) < schema.get("minLength", 0):
        yield path, f"must have at least {schema['minLength']} characters"
    if len(value) > schema.get("maxLength", len(value)):
        yield path, f"must have at most {schema['maxLength']} characters"
    if "pattern" in schema and not re.search(schema["pattern"], value):
        yield path, f"must fit {schema['pattern']}"


def _number_errors(schema: dict[str, Any], value: float, path: str) -> Iterator[tuple[str, str]]:
    if value < schema.get("minimum", value):
        yield path, f"must be at least {schema['minimum']}"
    if value > schema.get("maximum", value):
        yield path, f"must be at most {schema['maximum']}"
