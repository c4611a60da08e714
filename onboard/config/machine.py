"""The machine file: the small TOML that makes one board this machine. docs/machine-file.md describes every key."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from onboard.bounded_file import is_there
from onboard.config.files import read_text, root_table
from onboard.config.problems import ConfigError, Problem, Problems, quoted
from onboard.config.reader import TomlTable, type_name
from onboard.config.site import load_site
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Machine, Site


@dataclass(frozen=True, slots=True)
class BusInterface:
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
    fleet_bus: BusInterface
    device_bus: BusInterface
    journal: Path


def load_machine(path: Path) -> MachineConfig:
    """Read a machine file and its site file. Raises ``ConfigError`` with every mistake in both."""
    problems = Problems(str(path))
    root = root_table(read_text(path, "machine"), problems)
    head = root.table("machine", required=True)
    site, of_site = _load_site(head, path)
    machine = _read_machine(head, site)
    journal = head.text("journal", f"journal-{machine.name}" if machine is not None else "journal")
    bitrate = site.bitrate if site is not None else 500_000
    fleet_table = root.table("fleet_bus", required=True)
    fleet_bus = _read_interface(fleet_table, bitrate)
    device_bus = _read_interface(root.table("device_bus"), bitrate) if "device_bus" in root.values else fleet_bus
    if site is not None and fleet_bus is not None and fleet_bus.bitrate != bitrate:
        what = f"site {site.name} runs its fleet bus at {bitrate} bit/s"
        fleet_table.bad("bitrate", fleet_bus.bitrate, what, "leave the key out")
    root.check_unknown()
    found = problems.in_order() + of_site
    if found or site is None or machine is None or fleet_bus is None or device_bus is None:
        raise ConfigError(found)
    return MachineConfig(path, site, machine, fleet_bus, device_bus, path.parent / journal)


def _load_site(head: TomlTable, path: Path) -> tuple[Site | None, list[Problem]]:
    """The site that the machine file names, relative to its own directory, or what is wrong with it."""
    name = head.text("site")
    if not name:
        return None, []
    site_path = path.parent / name
    try:
        return load_site(site_path), []
    except ConfigError as error:
        if not (is_there(site_path) and site_path.is_file()):
            head.bad("site", name, f"no file {quoted(str(site_path))}", "write its path as seen from the machine file")
            return None, []
        return None, error.problems


def _read_machine(head: TomlTable, site: Site | None) -> Machine | None:
    """The machine by name, by node-ID, or by both where they agree."""
    name = head.text("name") if head.has("name") or not head.has("node") else ""
    node = head.integer("node", 1, MAX_NODE_ID) if head.has("node") else 0
    if site is None or head.wrong:
        return None
    machines = list(site.machines.values())
    fitting = [one for one in machines if name in ("", one.name) and node in (0, one.node_id)]
    if not fitting:
        key = "name" if name else "node"
        known = ", ".join(f"{one.name} (node {one.node_id})" for one in machines)
        what = f"no such machine in site {site.name}"
        if name in {one.name for one in machines}:
            key, what = "node", f"{name} has another node-ID in site {site.name}"
        head.bad(key, head.values[key], what, f"machines there: {known}")
        return None
    return fitting[0]


def _read_interface(table: TomlTable, bitrate: int) -> BusInterface | None:
    """``interface``, ``channel``, ``bitrate``; all further keys go to python-can as they are."""
    interface = table.text("interface")
    # python-can's tools hand every channel on as text, numbers too.
    channel = table.values.get("channel")
    channel = str(table.integer("channel", 0, 255)) if type(channel) is int else table.text("channel")
    own_bitrate = table.integer("bitrate", 10_000, 1_000_000, bitrate)
    extra = []
    for key in table.values.keys() - {"interface", "channel", "bitrate"}:
        value = table.values[key]
        table.has(key)
        if not isinstance(value, str | int | float | bool):
            table.bad(key, value, f"is {type_name(value)}", "write a text, a number, true or false")
        extra.append((key, value))
    if table.wrong:
        return None
    return BusInterface(interface, channel, own_bitrate, tuple(sorted(extra)))
