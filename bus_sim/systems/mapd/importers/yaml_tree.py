"""YAML with the lines on which values begin, for messages that name a place. PyYAML is known to this file only."""

from dataclasses import dataclass
from typing import Any

import yaml

from onboard.config.problems import Problems

#: Deeper than any building.
_MOST_DEPTH = 50


@dataclass(frozen=True)
class Value:
    """One value: ``of`` is a dict of values by key, a list of values, a text, a number, True, False or None."""

    of: Any
    line: int

    def get(self, key: str) -> "Value":
        """The value of a key; one of None where there is no such key, or no mapping."""
        found = self.of.get(key) if isinstance(self.of, dict) else None
        return found if found is not None else Value(None, self.line)

    def items(self) -> "list[tuple[str, Value]]":
        """Keys and values of a mapping; none where it is no mapping."""
        return list(self.of.items()) if isinstance(self.of, dict) else []

    def values(self) -> "list[Value]":
        """The values of a list; none where it is no list."""
        return self.of if isinstance(self.of, list) else []

    def number(self) -> float | None:
        """A number; None where it is none."""
        return float(self.of) if isinstance(self.of, int | float) and not isinstance(self.of, bool) else None


def parse_yaml(text: str, problems: Problems) -> Value:
    """The document; a value of None, with a problem noted, where it is no YAML. Aliases are refused: they can grow."""
    try:
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent):
                at = event.start_mark
                problems.add(at.line + 1 if at else 0, "", None, "an alias (*)", "write the value itself")
                return Value(None, 1)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        return _value(node, 0) if node is not None else Value(None, 1)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or "nested too deeply, or not a value"
        problems.add(mark.line + 1 if mark else 0, "", None, f"not usable YAML: {what}", "export the building again")
        return Value(None, 1)


def _value(node: yaml.Node, depth: int) -> Value:
    if depth > _MOST_DEPTH:
        raise ValueError("nested too deeply")
    line = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        return Value({str(key.value): _value(value, depth + 1) for key, value in node.value}, line)
    if isinstance(node, yaml.SequenceNode):
        return Value([_value(one, depth + 1) for one in node.value], line)
    return Value(yaml.constructor.SafeConstructor().construct_object(node), line)
