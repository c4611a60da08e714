"""The simulator's half of each system: a folder beside this file, or a package that says so by an entry point.

Its parts are modules of that folder, loaded when they are asked for: ``simulated`` describes it, ``commands`` are
commands of ``bus-sim`` for its sites alone. docs/new-system.md lists what is asked of each.
"""

import importlib
import pkgutil
from collections.abc import Iterator
from functools import cache
from importlib import metadata, util
from types import ModuleType
from typing import Any

from bus_sim import systems
from bus_sim.systems.system import SimulatedSystem
from onboard.core.site import Site

#: Entry points of packages of other people: the system's name, then its package.
GROUP = "bus_sim.systems"


class UnknownSystemError(ValueError):
    """There is no simulator for the sites of a system."""


@cache
def simulated_names() -> tuple[str, ...]:
    """The names of all systems that can be simulated, as site files say them, in the order of the alphabet."""
    own = (module.name.replace("_", "-") for module in pkgutil.iter_modules(systems.__path__) if module.ispkg)
    return tuple(sorted({*own, *(entry.name for entry in metadata.entry_points(group=GROUP))}))


@cache
def part(system: str, noun: str) -> ModuleType | None:
    """The module of this name in a system's folder; None where the system has none, or where nobody knows it."""
    package = _package(system)
    if package is None or util.find_spec(f"{package}.{noun}") is None:
        return None
    return importlib.import_module(f"{package}.{noun}")


@cache
def _package(system: str) -> str | None:
    folder = f"{systems.__name__}.{system.replace('-', '_')}"
    if "_" not in system and system.replace("-", "").isalnum() and util.find_spec(folder) is not None:
        return folder
    return next((entry.value for entry in metadata.entry_points(group=GROUP, name=system)), None)


def simulated(name: str) -> SimulatedSystem[Any, Any]:
    """The system of this name. Raises ``UnknownSystemError`` for one that cannot be simulated."""
    module = part(name, "simulated")
    if module is None:
        raise UnknownSystemError(
            f"{name}: no simulator for this system; there are {', '.join(simulated_names())}, and packages with an "
            f"entry point {GROUP}"
        )
    found: SimulatedSystem[Any, Any] = module.SIMULATED
    return found


def simulated_of(site: Site) -> SimulatedSystem[Any, Any]:
    """The system of a site. Raises ``UnknownSystemError``, as ``simulated``."""
    return simulated(site.system)


def own_commands() -> Iterator[ModuleType]:
    """The modules that bring commands of ``bus-sim`` for the sites of one system; each has ``add`` and ``RUN``."""
    for name in simulated_names():
        module = part(name, "commands")
        if module is not None:
            yield module
