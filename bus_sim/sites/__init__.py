"""Sites that ship with the simulator."""

from importlib.resources import files
from pathlib import Path

from onboard.config.site import load_site, parse_site
from onboard.core.site import Site


class SiteNotFoundError(ValueError):
    """No shipped site of that name, and no such file."""


def site_names() -> list[str]:
    """Names of the shipped sites."""
    return sorted(
        entry.name.removesuffix(".toml") for entry in files(__name__).iterdir() if entry.name.endswith(".toml")
    )


def site_text(name: str) -> str:
    """The text of a site file that ``find_site`` has read."""
    if name in site_names():
        return files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return Path(name).read_text(encoding="utf-8")


def find_site(name: str) -> Site:
    """A shipped site by its name, else a site file by its path.

    Raises ``SiteNotFoundError`` where there is neither, and ``ConfigError`` for a file with mistakes.
    """
    if name in site_names():
        return parse_site(site_text(name), f"{name}.toml")
    if not Path(name).exists():
        raise SiteNotFoundError(
            f'site "{name}": no such file, and no such shipped site; shipped: {", ".join(site_names())}'
        )
    return load_site(Path(name))
