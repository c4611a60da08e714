"""What may differ between a site file and the one that follows it while the site works: machines that are added.

A right that nobody has moved is whose the site file says. So this is only for sites where no right begins by it: a new
robot's home would be the robot's by the new file and its steward's by the old one. Such a class says so (``GROWS``).
"""

from collections.abc import Iterator
from dataclasses import fields

from onboard.config.problems import ConfigError, Problem
from onboard.core.site import Site

#: What is no matter of the machines: docs/site-file.md, "The digest".
_ASIDE = {"digest", "time_zone"}
_REMEDY = "while a site works machines may be added to its file and nothing else; stop the site for this"
_STOP = "stop the site for another file"


def added_machines(old: Site, new: Site, file: str) -> tuple[int, ...]:
    """Node-IDs of the machines that ``new``, read from ``file``, has beyond ``old``.

    Raises ``ConfigError`` with every other difference, or where there is none at all, or for a site whose rights begin
    by its file.
    """
    grows: frozenset[str] = getattr(old, "GROWS", frozenset())
    if not grows or type(old) is not type(new):
        what = f"rights of a site of system {old.system} begin by its file, and would have two holders"
        raise ConfigError([Problem(file, 0, "", None, what, _STOP)])
    found = [Problem(file, 0, where, None, what, _REMEDY) for where, what in _differences(old, new, grows)]
    added = tuple(node for node in new.machines if node not in old.machines)
    if not found and not added:
        found = [Problem(file, 0, "", None, "no machine is added", "name the site file that is to come")]
    if found:
        raise ConfigError(found)
    return added


def _differences(old: Site, new: Site, grows: frozenset[str]) -> Iterator[tuple[str, str]]:
    """Where ``new`` is not ``old``, but for more entries in the tables that may grow; and what is there."""
    for name in (one.name for one in fields(old) if one.name not in _ASIDE | old.demand):
        before, after = getattr(old, name), getattr(new, name)
        if name in grows:
            yield from ((f"{name}[{key}]", "left out") for key in before if key not in after)
            changed = ((key, one, after[key]) for key, one in before.items() if key in after and one != after[key])
            yield from (
                (f"{name}[{key}]", f"{_short(one)} before, {_short(other)} here") for key, one, other in changed
            )
        elif before != after:
            yield name, f"{_short(before)} before, {_short(after)} here"


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
