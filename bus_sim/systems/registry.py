"""The simulator's half of each system: a folder beside this file, or a package that says so by an entry point.

Its parts are modules of that folder, loaded when they are asked for: ``simulated`` describes it, ``commands`` has
``COMMANDS`` of ``bus-sim`` for its sites alone. docs/new-system.md lists what is asked of each.
"""

from typing import TYPE_CHECKING, Any

from bus_sim import systems
from bus_sim.commands import Command
from onboard.systems.folders import Folders

if TYPE_CHECKING:
    from bus_sim.systems.system import SimulatedSystem
    from onboard.core.site import Site

#: Packages of other people have an entry point ``bus_sim.systems``: the system's name, then its package.
_FOLDERS = Folders(systems)


class UnknownSystemError(ValueError):
    """There is no simulator for the sites of a system."""


def simulated_names() -> tuple[str, ...]:
    """The names of all systems that can be simulated, as site files say them, in the order of the alphabet."""
    return _FOLDERS.names()


def simulated(name: str) -> "SimulatedSystem[Any, Any]":
    """The system of this name. Raises ``UnknownSystemError`` for one that cannot be simulated."""
    module = _FOLDERS.part(name, "simulated")
    if module is None:
        raise UnknownSystemError(
            f"{name}: no simulator for this system; there are {', '.join(simulated_names())}, and packages with an "
            "entry point bus_sim.systems"
        )
    found: SimulatedSystem[Any, Any] = module.SIMULATED
    return found


def simulated_of(site: "Site") -> "SimulatedSystem[Any, Any]":
    """The system of a site. Raises ``UnknownSystemError``, as ``simulated``."""
    return simulated(site.system)


def own_commands() -> dict[str, Command]:
    """The commands of ``bus-sim`` for the sites of one system, by name."""
    modules = (_FOLDERS.part(name, "commands") for name in simulated_names())
    return {name: command for module in modules if module is not None for name, command in module.COMMANDS.items()}
