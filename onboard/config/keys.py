"""The key file of one node: what it seals with, as ``onboard keys`` writes it; docs/seals.md describes it."""

import re
import stat
from pathlib import Path

from onboard.config.files import read_text, root_table
from onboard.config.problems import ConfigError, Problem, Problems
from onboard.config.reader import TomlTable
from onboard.core.site import Site
from onboard.seal.keys import KEY_BYTES, Keys

#: Longest key file, bytes: 255 keys of 64 digits.
_MOST_BYTES = 100_000
_KEY = re.compile(rf"[0-9a-f]{{{2 * KEY_BYTES}}}")
#: Lives begin above this number; 32 bits of a seal's number are the life.
MOST_MADE = (1 << 32) - (1 << 24)


def key_text(keys: Keys, site: str, name: str, fingerprint: str) -> str:
    """The text of a key file; ``name`` is its owner's, ``fingerprint`` of its identity, for people."""
    lines = [f"# Keys of {name}, fingerprint {fingerprint}"]
    lines += [f"# Whoever reads them can speak as {name}: mode 0600, and never into an image."]
    lines += ["[keys]", f'site = "{site}"', f"node = {keys.node}", f"made = {keys.made}"]
    lines += [f'group = "{keys.group.hex()}"', "[with]"]
    lines += [f'{node} = "{key.hex()}"' for node, key in sorted(keys.pairs.items())]
    return "\n".join(lines) + "\n"


def key_path(journal: Path) -> Path:
    """Where a machine's key file is: beside its journal's folder."""
    return journal.with_name(f"{journal.name}.keys")


def machine_keys(journal: Path, site: Site, node: int) -> Keys | None:
    """What a machine seals with; None where its site has no seals. Raises ``ConfigError``."""
    return load_keys(key_path(journal), site, node) if site.seals != "off" else None


def tool_keys(path: Path | None, site: Site, node: int | None) -> Keys | None:
    """The keys of a person's tool that speaks; None where it may speak without. Raises ``ConfigError``."""
    if path is None and site.seals != "required":
        return None
    if path is None:
        remedy = "name the tool's own key file, which onboard keys has made"
        raise ConfigError([Problem("--keys", 0, "", None, f"site {site.name} hears nobody without a seal", remedy)])
    return load_keys(path, site, node)


def load_keys(path: Path, site: Site, node: int | None = None) -> Keys:
    """Read a key file of ``site``, of ``node`` where that is given.

    Raises ``ConfigError``, whose lines never hold a key. A file that others may read is refused.
    """
    problems = Problems(str(path))
    root = root_table(read_text(path, "key", _MOST_BYTES), problems)
    if path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ConfigError([Problem(str(path), 0, "", None, "others may read it", f"chmod 600 {path}")])
    head = root.table("keys", required=True)
    name, owner = head.text("site"), head.integer("node", 1, 255)
    made = head.integer("made", 1, MOST_MADE)
    group = _key(head, "group")
    others = root.table("with", required=True)
    pairs = {int(other): _key(others, other) for other in others.values if _is_node(others, other)}
    if name and name != site.name:
        head.bad("site", name, f"the site is {site.name}", "name the key file that was made for it")
    if node not in (None, owner):
        head.bad("node", owner, f"this is node {node}", "name the key file of this node")
    missing = sorted(set(site.machines) - pairs.keys() - {owner})
    if missing and not others.wrong and node in (None, owner):
        remedy = "write the files again with onboard keys make, and put each on its board"
        problems.add(0, "with", missing[0], "the site has a machine that these keys do not know", remedy)
    root.check_unknown()
    problems.raise_if_any()
    return Keys(owner, group, {other: key for other, key in pairs.items() if other != owner}, made)


def _is_node(table: TomlTable, name: str) -> bool:
    if name.isascii() and name.isdecimal() and 1 <= int(name) <= 255 and name == str(int(name)):
        return True
    if table.has(name):
        table.bad(name, 0, "is no node-ID", "write 1 to 255")
    return False


def _key(table: TomlTable, name: str) -> bytes:
    text = table.text(name)
    if text and _KEY.fullmatch(text) is None:
        # The value is not told: it may be most of a key.
        table.bad(name, "...", f"is no key of {2 * KEY_BYTES} hexadecimal digits", "write the file again")
        text = ""
    return bytes.fromhex(text) if text else bytes(KEY_BYTES)
