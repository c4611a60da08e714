"""The machine file: the small TOML that makes one board this machine. docs/machine-file.md describes every key."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from onboard.config.problems import ConfigError, Problem, Problems
from onboard.config.reader import Table
from onboard.config.site import load_site
from onboard.config.toml_lines import parse
from onboard.core.site import Machine, Site


@dataclass(frozen=True, slots=True)
class Interface:
    """A bus interface in python-can's words; ``extra`` are further keyword arguments of ``can.Bus``."""

    interface: str
    channel: str
    bitrate: int
    extra: tuple[tuple[str, Any], ...] = field(default=())


@dataclass(frozen=True, slots=True)
class MachineConfig:
    """One machine of one site, where its buses are, and where it keeps its journal."""

    file: Path
    site: Site
    machine: Machine
    fleet_bus: Interface
    device_bus: Interface
    journal: Path


def load_machine(path: Path) -> MachineConfig:
    """Read a machine file and its site file. Raises ``ConfigError`` with every mistake in both."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        problem = Problem(str(path), 0, "", None, f"cannot be read: {why}", "name an existing machine file")
        raise ConfigError([problem]) from error
    problems = Problems(str(path))
    document = parse(text, str(path), problems)
    problems.raise_if_any()
    root = Table(document, problems, "", document.values)
    head = root.table("machine", required=True)
    name = head.text("name")
    site_name = head.text("site")
    journal = head.text("journal", f"journal-{name}")
    site, mistakes = _site(path.parent / site_name) if site_name else (None, [])
    bitrate = site.bitrate if site is not None else 500_000
    fleet_table, device_table = root.table("fleet_bus", required=True), root.table("device_bus")
    fleet = _interface(fleet_table, bitrate)
    device = _interface(device_table, bitrate) if device_table.values else fleet
    if site is not None and name and name not in {machine.name for machine in site.machines.values()}:
        known = ", ".join(machine.name for machine in site.machines.values())
        head.bad("name", name, f"no such machine in {site_name}", f"machines there: {known}")
    head.check_unknown()
    root.check_unknown()
    found = problems.found + mistakes
    if found or site is None:
        raise ConfigError(found)
    return MachineConfig(path, site, site.machine(name), fleet, device, path.parent / journal)


def _site(path: Path) -> tuple[Site | None, list[Problem]]:
    try:
        return load_site(path), []
    except ConfigError as error:
        return None, error.problems


def _interface(table: Table, bitrate: int) -> Interface:
    """``interface``, ``channel``, ``bitrate``; all further keys go to python-can as they are."""
    known = ("interface", "channel", "bitrate")
    extra = tuple((key, value) for key, value in table.values.items() if key not in known)
    return Interface(
        table.text("interface"), table.text("channel"), table.integer("bitrate", 10_000, 1_000_000, bitrate), extra
    )
