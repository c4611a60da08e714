"""The secret under which all desks of a site print tickets: one file, the same on each desk's board."""

import re
import secrets
from pathlib import Path

from onboard.core.site import Site
from onboard.keys.agreement import KeysError
from onboard.keys.folder import write_private
from onboard.seal.keys import KEY_BYTES
from onboard.systems.registry import system_of
from onboard.systems.system import WithSecrets

_LINE = re.compile(rf"(?m)^[0-9a-f]{{{2 * KEY_BYTES}}}$")


def desks_of(site: Site) -> list[str]:
    """The machines that print tickets, by name. Raises ``KeysError`` where there are none."""
    factories = system_of(site).factories
    names = [one.name for one in site.machines.values() if isinstance(factories.get(one.kind), WithSecrets)]
    if not names:
        raise KeysError(f"no machine of {site.name} prints tickets; name the site file of a car park")
    return names


def write_tickets(folder: Path) -> tuple[Path, int]:
    """A new secret before the newest one so far; the file, and how many it holds. Raises ``OSError``."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = folder / "desks.tickets"
    before = _LINE.findall(path.read_text("ascii", "replace")) if path.exists() else []
    lines = [secrets.token_hex(KEY_BYTES), *before[:1]]
    head = "# Tickets: printed under the first, read under all. Mode 0600, and never into an image."
    write_private(path, "\n".join([head, *lines, ""]).encode())
    return path, len(lines)
