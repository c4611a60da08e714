"""Sites that ship with a package, by name: wherever a site file is named, such a name will do.

A package offers its folder of site files, and the folders in it, under the entry point ``onboard.sites``; what boards
carry offers none.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from onboard.bounded_file import is_there
from onboard.config.files import read_text
from onboard.config.problems import ConfigError, Problem, nearest

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

#: Under this name packages say which of their folders holds site files.
GROUP = "onboard.sites"
_SUFFIX = ".toml"


def shipped_sites() -> dict[str, "Traversable"]:
    """Site files of all installed packages by their names, in the order of these."""
    # A board names a file, and would wait for what reads archives and e-mail headers of packages.
    from importlib.metadata import entry_points  # noqa: PLC0415  # see above
    from importlib.resources import files  # noqa: PLC0415  # see above

    folders = [files(entry.load()) for entry in entry_points(group=GROUP)]
    folders += [below for folder in folders for below in folder.iterdir() if below.is_dir()]
    found = {file.name.removesuffix(_SUFFIX): file for folder in folders for file in folder.iterdir() if _is_site(file)}
    return dict(sorted(found.items()))


def site_source(path: Path) -> tuple[str, str]:
    """The text of a site file, or of a shipped site by its bare name, and what messages call it.

    Raises ``ConfigError`` with one problem where there is neither.
    """
    if path.suffix or path.name != str(path) or (is_there(path) and path.is_file()):
        return read_text(path, "site"), str(path)
    shipped = shipped_sites()
    if path.name in shipped:
        return shipped[path.name].read_text(encoding="utf-8"), f"{path.name}{_SUFFIX}"
    if is_there(path) or not shipped:
        return read_text(path, "site"), str(path)
    remedy = f"name a site file, or a shipped site; {nearest(path.name, list(shipped))}"
    raise ConfigError([Problem(str(path), 0, "", None, "no such file, and no such shipped site", remedy)])


def _is_site(file: "Traversable") -> bool:
    return file.name.endswith(_SUFFIX)
