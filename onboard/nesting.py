"""How deep a parsed value is: what a parser lets through may still be too deep for whoever goes into it by itself."""

from collections.abc import Iterable
from typing import Any


def is_deeper(value: Any, most: int) -> bool:
    """Whether more than ``most`` dicts and lists lie within each other. It looks level by level, however deep it is."""
    level = _containers([value])
    for _ in range(most):
        level = _containers(one for each in level for one in (each.values() if isinstance(each, dict) else each))
    return bool(level)


def _containers(values: Iterable[Any]) -> list[dict[str, Any] | list[Any]]:
    return [one for one in values if isinstance(one, dict | list)]
