"""The site file: TOML text to a checked ``Site``. docs/site-file.md describes every key."""

import hashlib
import json
import re
from collections.abc import Collection, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

from onboard.config.files import root_table
from onboard.config.problems import Problems
from onboard.config.reader import Common, TomlTable
from onboard.config.shipped import site_source
from onboard.core.site import Site
from onboard.systems.registry import FIRST_SYSTEM, own_names, part, system_names

_ZONE = re.compile(r"[A-Za-z][A-Za-z0-9_+-]*(/[A-Za-z0-9_+-]+){0,2}")
#: What a site does with proof of who said a frame (docs/seals.md).
SEALS = ("off", "watch", "required")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


def load_site(path: Path) -> Site:
    """Read a site file, or a shipped site by its name (``site_source``).

    Raises ``ConfigError`` with every mistake, or with one problem where it cannot be read.
    """
    return parse_site(*site_source(path))


def parse_site(text: str, file: str, *, crowded: bool = False) -> Site:
    """Check and build a site from TOML text; ``file`` is its name in messages. Raises ``ConfigError``.

    ``crowded`` lets more robots in than can find refuges, and lets them be at home together: for studies of what they
    do in each other's way.
    """
    problems = Problems(file)
    root = root_table(text, problems)
    head = root.table("site", required=True)
    common = Common(_read_name(head), head.integer("bitrate", 10_000, 1_000_000, 500_000), crowded)
    zone = _read_time_zone(head)
    seals = head.choice("seals", SEALS, "off")
    own = own_names()
    # Packages of other people are asked for where the word is none of ours: that takes a board long.
    known = own if head.values.get("system", FIRST_SYSTEM) in own else system_names()
    system = head.choice("system", known, FIRST_SYSTEM)
    site = _read_system(root, common, system)
    root.check_unknown()
    problems.raise_if_any()
    site = replace(site, seals=seals or "off", time_zone=zone)
    return replace(site, digest=site_digest(site))


def _read_system(root: TomlTable, common: Common, system: str) -> Site:
    """A reader takes the whole document, notes every mistake in ``root.problems``, and returns what it made of it."""
    reader = part(system, "reader")
    assert reader is not None, f"system {system} has no reader"
    site: Site = reader.read(root, common)
    return site


def site_digest(site: Site) -> int:
    """1 to 65535, over what a site is and not what comes to it; docs/site-file.md says how to compute it."""
    text = json.dumps(
        _meaning(site, {"digest", "time_zone", *site.demand}), sort_keys=True, separators=(",", ":"), default=_plain
    )
    module = part(site.system, "frames")
    asked_by = getattr(module, "ASKED_BY", None)
    words = getattr(module, "WORDS", None) if asked_by is None or getattr(site, asked_by) else None
    text += "" if words is None else f"{words:08X}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:2], "big") or 1


def _meaning(value: object, left_out: Collection[str] = ()) -> object:
    """A value for JSON; dataclasses as dictionaries without the fields that have their defaults.

    So a field that a later version adds does not make strangers of the sites that do not use it.
    """
    if is_dataclass(value):
        own = ((one, getattr(value, one.name)) for one in fields(value) if one.name not in left_out)
        return {one.name: _meaning(content) for one, content in own if content != _default(one)}
    if isinstance(value, Mapping):
        return {key: _meaning(content) for key, content in value.items()}
    if isinstance(value, list | tuple):
        return [_meaning(content) for content in value]
    return value


def _default(one: Field[Any]) -> object:
    return one.default if one.default_factory is MISSING else one.default_factory()


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f"a site holds a {type(value).__name__}, which has no canonical text")


def _read_time_zone(head: TomlTable) -> str:
    """Its form alone: a board need not know any zone, as no machine does anything by it."""
    zone = head.text("time_zone", "") if head.has("time_zone") else ""
    if zone and not _ZONE.fullmatch(zone):
        head.bad("time_zone", zone, "no name of a time zone", 'write one such as "Europe/Berlin"')
    return zone


def _read_name(head: TomlTable) -> str:
    name = head.text("name")
    if name and not _NAME.fullmatch(name):
        head.bad("name", name, "not usable in a file name", "write up to 32 letters, digits, dots, - or _")
    return name
