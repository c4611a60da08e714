"""YAML with the lines on which values begin, for messages that name a place. PyYAML is known to this file only."""

from dataclasses import dataclass
from typing import Any

import yaml

from onboard.config.problems import Problems

#: Deeper than any building.
_MOST_DEPTH = 50
#: Values and what is around them; an airport of several floors has a third of it.
_MOST_EVENTS = 300_000
#: The one in C takes a tenth of the time; PyYAML comes without it where it was built so.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


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
        """A number; None where it is none, or one that no float holds."""
        try:
            return float(self.of) if isinstance(self.of, int | float) and not isinstance(self.of, bool) else None
        except OverflowError:
            return None


def parse_yaml(text: str, problems: Problems) -> Value:
    """The document; a value of None, with a problem noted, where it is no YAML. Aliases are refused: they can grow."""
    try:
        wrong = _first_wrong(text)
        if wrong is not None:
            problems.add(*wrong)
            return Value(None, 1)
        node = yaml.compose(text, Loader=_LOADER)
        return _value(node, 0) if node is not None else Value(None, 1)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or "nested too deeply, or not a value"
        # The parser in C puts what is missing at the end on the line behind the last one.
        line = min(mark.line, text.count("\n")) + 1 if mark else 0
        problems.add(line, "", None, f"not usable YAML: {what}", "export the building again")
        return Value(None, 1)


def _first_wrong(text: str) -> tuple[int, str, None, str, str] | None:
    """The first thing that has no bound, or is beyond it, as ``Problems.add`` takes it; raises as the parser does.

    One look at its events, which are made one by one: nothing is built of what is refused.
    """
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=_LOADER)):
        at = event.start_mark.line + 1 if event.start_mark else 0
        if isinstance(event, yaml.AliasEvent):
            return at, "", None, "an alias (*)", "write the value itself"
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _MOST_DEPTH:
            return at, "", None, "not usable YAML: nested too deeply", "export the building again"
        if count > _MOST_EVENTS:
            return at, "", None, f"more than {_MOST_EVENTS} values", "export floor by floor"
    return None


def _value(node: yaml.Node, depth: int) -> Value:
    if depth > _MOST_DEPTH:
        raise ValueError("nested too deeply")
    line = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        return Value({str(key.value): _value(value, depth + 1) for key, value in node.value}, line)
    if isinstance(node, yaml.SequenceNode):
        return Value([_value(one, depth + 1) for one in node.value], line)
    return Value(yaml.constructor.SafeConstructor().construct_object(node), line)
