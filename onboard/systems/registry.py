"""Which systems there are: each is a folder beside this file, or a package that says so by an entry point.

A part of a system is a module of its folder (``system``, ``reader``, ``checks``, ``scene`` ...), loaded when it is
asked for: a board loads the machines of its own system and nothing of the others. docs/new-kind.md lists the parts.
"""

from collections.abc import Callable, Iterable
from functools import partial
from types import ModuleType

from onboard import systems
from onboard.contract.codes import KindCode
from onboard.core.behaviour import BehaviourFactory
from onboard.core.journal_records import Entry, misshapen
from onboard.core.journal_state import JournalCondition, JournalState
from onboard.core.records import CORE_RECORDS
from onboard.core.site import Site
from onboard.systems.folders import Folders
from onboard.systems.system import System, WithSecrets
from onboard.work.compaction import compact

#: What a site file is that does not say: those of version 0.1 had no other system.
FIRST_SYSTEM = "car-park"
#: Packages of other people have an entry point ``onboard.systems``: the system's name, then its package.
_FOLDERS = Folders(systems)
#: Systems that are only tried, in this process.
_ADDED: dict[str, System] = {}


def add_system(system: System) -> None:
    """One more system in this process, such as one that is being tried. Raises ``ValueError`` for a name twice."""
    if system.name in (*_ADDED, *system_names()):
        raise ValueError(f"system {system.name}: there is one of this name")
    _ADDED[system.name] = system


def remove_system(name: str) -> None:
    """Take out what ``add_system`` put in. Raises ``KeyError``."""
    del _ADDED[name]


def own_names() -> tuple[str, ...]:
    """The names of the systems that are folders beside this file, in the order of the alphabet."""
    return _FOLDERS.own_names()


def system_names() -> tuple[str, ...]:
    """The names of all systems as site files say them, in the order of the alphabet."""
    return _FOLDERS.names()


def part(system: str, noun: str) -> ModuleType | None:
    """The module of this name in a system's folder; None where the system has none, or where nobody knows it."""
    return _FOLDERS.part(system, noun)


def find_system(name: str) -> System:
    """The system of this name. Raises ``KeyError`` for one that this image does not know."""
    if name in _ADDED:
        return _ADDED[name]
    module = part(name, "system")
    if module is None:
        raise KeyError(name)
    found: System = module.SYSTEM
    return found


def system_of(site: Site) -> System:
    """The system of a site. Raises ``KeyError``, as ``find_system``."""
    return find_system(site.system)


def factory_for(site: Site, kind: KindCode) -> BehaviourFactory:
    """The factory of one kind of machine. Raises ``KeyError`` for a kind that this image cannot drive there."""
    return system_of(site).factories[kind]


def with_secrets(factory: BehaviourFactory, secrets: tuple[bytes, ...]) -> BehaviourFactory:
    """The factory for these secrets, where its kind keeps any (``WithSecrets``)."""
    return factory.with_secrets(secrets) if isinstance(factory, WithSecrets) else factory


def compaction_for(site: Site) -> Callable[[list[Entry]], list[Entry]]:
    """What a journal of this site may leave out: entries in, those that still mean something out."""
    return partial(compact, system_of(site).records)


def condition_for(site: Site, found: JournalCondition, entries: Iterable[Entry], name: str) -> JournalCondition:
    """The condition in which a journal of this site was ``found``, or SHORT where a record has not its form."""
    why = misshapen(entries, (*CORE_RECORDS, *system_of(site).records)) if found.is_reliable else ""
    return JournalCondition(JournalState.SHORT, 1, 0, f"{name}: {why}") if why else found
