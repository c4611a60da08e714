"""Sites that ship with the simulator."""

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from onboard.bounded_file import is_there
from onboard.config.files import read_text
from onboard.config.site import load_site, parse_site
from onboard.core.site import Site

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

_LAYOUTS = "layouts"


class SiteNotFoundError(ValueError):
    """No shipped site of that name, and no such file."""


def site_names() -> list[str]:
    """Names of the shipped sites, one or more of each system."""
    return _names(files(__name__))


def layout_names() -> list[str]:
    """Names of the shipped car parks of many forms (docs/layouts.md)."""
    return _names(files(__name__).joinpath(_LAYOUTS))


def _names(folder: "Traversable") -> list[str]:
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def site_text(name: str) -> str:
    """The text of a site file that ``find_site`` has read."""
    for folder in (files(__name__), files(__name__).joinpath(_LAYOUTS)):
        if name in _names(folder):
            return folder.joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return read_text(Path(name), "site")


def find_site(name: str) -> Site:
    """A shipped site by its name, else a site file by its path.

    Raises ``SiteNotFoundError`` where there is neither, and ``ConfigError`` for a file with mistakes.
    """
    if name in (*site_names(), *layout_names()):
        return parse_site(site_text(name), f"{name}.toml")
    if not is_there(Path(name)):
        shipped = ", ".join([*site_names(), *layout_names()])
        raise SiteNotFoundError(f'site "{name}": no such file, and no such shipped site; shipped: {shipped}')
    return load_site(Path(name))
