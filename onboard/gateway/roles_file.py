"""The file of ``onboard gateway --roles``: one table for each name that gives orders (docs/mqtt.md)."""

from pathlib import Path

from onboard.config.files import read_text, root_table
from onboard.config.problems import Problems
from onboard.config.reader import TomlTable
from onboard.core.site import Site
from onboard.gateway.inbox import GIVER
from onboard.gateway.roles import Role, Roles

#: Longest file of roles, bytes.
_MOST_BYTES = 100_000


def load_roles(path: Path, site: Site) -> Roles:
    """Read a file of roles for a site. Raises ``ConfigError`` with every mistake in it."""
    problems = Problems(str(path))
    root = root_table(read_text(path, "roles", _MOST_BYTES), problems)
    roles: dict[str, Role] = {}
    for name in list(root.values):
        table = root.table(name)
        if not GIVER.fullmatch(name):
            root.bad(name, name, "is no level of a topic", "letters, digits and _ . : - only, 64 at most")
        desks = _machines(table, "desks", site)
        roles[name] = Role(desks, _machines(table, "cars", site) if table.has("cars") else desks)
    root.check_unknown()
    problems.raise_if_any()
    return roles


def _machines(table: TomlTable, key: str, site: Site) -> frozenset[int]:
    """Machines by name; all of the site where the key is left out."""
    if not table.has(key):
        return frozenset(site.machines)
    known = {machine.name: node for node, machine in site.machines.items()}
    found = set()
    for number, name in enumerate(table.items(key, "names of machines") or []):
        if name in known:
            found.add(known[name])
        else:
            table.bad(key, name, f"no machine of {site.name}", f"one of {', '.join(known)}", item=number)
    return frozenset(found)
