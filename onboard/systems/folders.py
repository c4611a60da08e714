"""Parts of systems found by name: modules of a folder, or of a package that says so by an entry point.

Boards find their half of a system below ``onboard.systems``, the simulator its own below ``bus_sim.systems``.
"""

import importlib
import pkgutil
from functools import cache
from importlib import util
from types import ModuleType


class Folders:
    """The systems below one package, and those of the entry point of the same name. Nothing is loaded before asked."""

    def __init__(self, root: ModuleType) -> None:
        self._root = root
        self.names = cache(self._names)
        self.part = cache(self._part)
        self._package = cache(self._found)

    def _names(self) -> tuple[str, ...]:
        """The names of all systems as site files say them, in the order of the alphabet."""
        from importlib import metadata  # noqa: PLC0415  # see _found

        others = (entry.name for entry in metadata.entry_points(group=self._root.__name__))
        return tuple(sorted({*self.own_names(), *others}))

    def own_names(self) -> tuple[str, ...]:
        """The names of the systems that are folders here, in the order of the alphabet."""
        folders = (module.name for module in pkgutil.iter_modules(self._root.__path__) if module.ispkg)
        return tuple(sorted(name.replace("_", "-") for name in folders))

    def _part(self, system: str, noun: str) -> ModuleType | None:
        """The module of this name of a system; None where the system has none, or where nobody knows it."""
        package = self._package(system)
        if package is None or util.find_spec(f"{package}.{noun}") is None:
            return None
        return importlib.import_module(f"{package}.{noun}")

    def _found(self, system: str) -> str | None:
        """The folder is looked for first: to read the entry points of all packages takes a board long.

        So does what reads them: it is imported where it is needed.
        """
        folder = f"{self._root.__name__}.{system.replace('-', '_')}"
        if "_" not in system and system.replace("-", "").isalnum() and util.find_spec(folder) is not None:
            return folder
        from importlib import metadata  # noqa: PLC0415  # see above

        return next((one.value for one in metadata.entry_points(group=self._root.__name__, name=system)), None)
