"""What may differ between a site file and the one that follows it while the site works: machines that are added.

A right that nobody has moved is whose the site file says. So a right that both files know must begin with the same
machine in both, or it would have two holders while some machines have the one file and some the other.
"""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass

from onboard.config.problems import ConfigError, Problem
from onboard.core.site import Site

#: What is no matter of the machines: docs/site-file.md, "The digest".
_ASIDE = {"digest", "time_zone"}
_REMEDY = "while a site works machines may be added to its file and nothing else; stop the site for this"


def added_machines(old: Site, new: Site, file: str) -> tuple[int, ...]:
    """Node-IDs of the machines that ``new``, read from ``file``, has beyond ``old``.

    Raises ``ConfigError`` with every other difference, or where there is none at all.
    """
    aside = _ASIDE | set(old.demand)
    found = [Problem(file, 0, where, None, what, _REMEDY) for where, what in _differences(old, new, "", aside)]
    added = tuple(node for node in new.machines if node not in old.machines)
    if not found and not added:
        found = [Problem(file, 0, "", None, "no machine is added", "name the site file that is to come")]
    if found:
        raise ConfigError(found)
    return added


def _differences(old: object, new: object, where: str, aside: set[str]) -> Iterator[tuple[str, str]]:
    """Where ``new`` is not ``old`` with more in its tables and lists, and what is there."""
    if type(old) is not type(new):
        yield where, f"{_short(old)} before, {_short(new)} here"
    elif is_dataclass(old):
        for one in fields(old):
            if one.name not in aside:
                name = f"{where}.{one.name}" if where else one.name
                yield from _differences(getattr(old, one.name), getattr(new, one.name), name, set())
    elif isinstance(old, Mapping) and isinstance(new, Mapping):
        yield from ((f"{where}[{key}]", "left out") for key in old if key not in new)
        for key in (key for key in old if key in new):
            yield from _differences(old[key], new[key], f"{where}[{key}]", set())
    elif old != new and not _is_longer(old, new):
        yield where, f"{_short(old)} before, {_short(new)} here"


def _is_longer(old: object, new: object) -> bool:
    """Whether a set or a list of things, not of numbers, has all that it had, in that order, and more."""
    if isinstance(old, frozenset) and isinstance(new, frozenset):
        return old <= new
    if type(old) not in (tuple, list) or not isinstance(old, tuple | list) or not isinstance(new, tuple | list):
        return False
    rest = iter(new)
    return not any(isinstance(one, int | float) for one in new) and all(one in rest for one in old)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
