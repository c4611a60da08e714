"""The bench file: which devices are under test, by what they are reached, and what can be done to them.

``hil/benches/board.toml`` describes every key. A test asks for capabilities, never for a device.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from onboard.config.files import read_text, root_table
from onboard.config.machine import BusInterface
from onboard.config.machine_text import BusTable
from onboard.config.problems import ConfigError, Problem, Problems, nearest
from onboard.config.reader import TomlTable
from onboard.config.site import load_site
from onboard.core.site import Machine, Site


class Capability(StrEnum):
    """What a bench can do with a device under test; each needs the resource of the same name."""

    #: The simulated fleet and the device hear each other.
    FLEET_BUS = "fleet_bus"
    #: The device's sensors and actuators are the simulated plant's.
    DEVICE_BUS = "device_bus"
    #: Its power can be cut and given back.
    POWER = "power"
    #: Its plug on the fleet bus can be pulled and put back.
    CABLE = "cable"
    #: Its frames can be destroyed on the wire until it is off the bus.
    BUS_OFF = "bus_off"
    #: Its site and machine file can be replaced.
    FILES = "files"
    #: What it says on its console can be read.
    CONSOLE = "console"
    #: Its error counters can be read.
    COUNTERS = "counters"


class TargetKind(StrEnum):
    """How a device under test is there."""

    #: ``onboard`` as a process of this computer, on the served buses: has every capability.
    PROCESS = "process"
    #: A board behind interfaces and commands.
    BOARD = "board"
    #: A controller in the simulator's own process and time; scenarios are the simulator's too.
    SIMULATED = "simulated"


#: A command as a list of words.
Command = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Switch:
    """Two commands; ``on`` is the usual state."""

    on: Command
    off: Command


@dataclass(frozen=True, slots=True)
class Files:
    """``install`` takes both files to the board; its own interfaces go into the machine file."""

    install: Command
    fleet_bus: BusTable
    device_bus: BusTable | None


@dataclass(frozen=True)
class Resources:
    """How a board is reached; None where the bench has no such thing."""

    buses: dict[Capability, BusInterface] = field(default_factory=dict)
    switches: dict[Capability, Switch] = field(default_factory=dict)
    readers: dict[Capability, Command] = field(default_factory=dict)
    files: Files | None = None

    def has(self, capability: Capability) -> bool:
        """Whether there is what this capability needs."""
        if capability is Capability.FILES:
            return self.files is not None
        return any(capability in found for found in (self.buses, self.switches, self.readers))


@dataclass(frozen=True)
class Target:
    """One device under test: which machine of the site it is, how it is reached, and what can be done to it."""

    machine: Machine
    kind: TargetKind
    capabilities: frozenset[Capability]
    resources: Resources = field(default_factory=Resources)


@dataclass(frozen=True)
class Bench:
    """A bench file that was read."""

    name: str
    site: Site
    site_text: str
    targets: tuple[Target, ...]


_BUSES = (Capability.FLEET_BUS, Capability.DEVICE_BUS)
_SWITCHES = (Capability.POWER, Capability.CABLE, Capability.BUS_OFF)
_READERS = (Capability.CONSOLE, Capability.COUNTERS)


def load_bench(path: Path) -> Bench:
    """Read a bench file and the site file that it names. Raises ``ConfigError`` with every mistake in it."""
    problems = Problems(str(path))
    root = root_table(read_text(path, "bench"), problems)
    head = root.table("bench", required=True)
    name, site_name = head.text("name"), head.text("site")
    site_path = path.parent / site_name
    if not head.wrong and not site_path.is_file():
        head.bad("site", site_name, "no such file", "write its path as seen from the bench file")
    targets = root.tables("targets")
    if not targets:
        root.bad("targets", None, "no device under test", "add a table [[targets]]")
    site = load_site(site_path) if not head.wrong else None
    found = [_read_target(table, site, problems) for table in targets]
    root.check_unknown()
    problems.raise_if_any()
    if site is None:
        raise ConfigError([Problem(str(path), 0, "", None, "cannot be read", "name an existing bench file")])
    kept = tuple(target for target in found if target is not None)
    return Bench(name, site, read_text(site_path, "site"), kept)


def _read_target(table: TomlTable, site: Site | None, problems: Problems) -> Target | None:
    name = table.text("machine")
    kind = TargetKind(table.choice("kind", [str(one) for one in TargetKind]))
    capabilities = _read_capabilities(table)
    resources = _read_resources(table, site.bitrate if site is not None else 500_000)
    for one in sorted(capabilities):
        if kind is TargetKind.BOARD and not resources.has(one):
            table.bad("capabilities", str(one), "nothing on this bench does that", f"add a table [targets.{one}]")
    machines = {} if site is None else {machine.name: machine for machine in site.machines.values()}
    if site is not None and name and name not in machines:
        table.bad("machine", name, f"no such machine in site {site.name}", nearest(name, list(machines)))
    return Target(machines[name], kind, capabilities, resources) if name in machines else None


def _read_capabilities(table: TomlTable) -> frozenset[Capability]:
    known = [str(one) for one in Capability]
    found = set()
    for number, word in enumerate(table.items("capabilities", "a list of words") or []):
        if word in known:
            found.add(Capability(word))
        else:
            table.bad("capabilities", word, "unknown capability", nearest(str(word), known), item=number)
    return frozenset(found)


def _read_resources(table: TomlTable, bitrate: int) -> Resources:
    buses = {one: _read_bus(table.table(one), bitrate) for one in _BUSES if table.has(one)}
    switches = {one: _read_switch(table.table(one)) for one in _SWITCHES if table.has(one)}
    readers = {one: _read_command(table.table(one), "read") for one in _READERS if table.has(one)}
    files = _read_files(table.table(Capability.FILES)) if table.has(Capability.FILES) else None
    return Resources(buses, switches, readers, files)


def _read_bus(table: TomlTable, bitrate: int) -> BusInterface:
    extra = tuple(sorted(_extra(table).items()))
    return BusInterface(table.text("interface"), table.text("channel"), bitrate, extra)


def _extra(table: TomlTable) -> dict[str, str | int | float | bool]:
    """Every further key of a bus, as in a machine file."""
    names = table.values.keys() - {"interface", "channel"}
    return {name: table.values[name] for name in sorted(names) if table.has(name)}


def _read_switch(table: TomlTable) -> Switch:
    return Switch(_read_command(table, "on"), _read_command(table, "off"))


def _read_command(table: TomlTable, name: str) -> Command:
    words = 'a list of words, such as ["ssh", "root@board", "reboot"]'
    value = table.items(name, words)
    if value is None or not value or not all(isinstance(word, str) for word in value):
        table.bad(name, value, "no command", f"write {words}")
        return ()
    return tuple(value)


def _read_files(table: TomlTable) -> Files:
    fleet = table.table("fleet_bus", required=True)
    device = table.table("device_bus") if table.has("device_bus") else None
    return Files(
        _read_command(table, "install"),
        _bus_table(fleet),
        _bus_table(device) if device is not None else None,
    )


def _bus_table(table: TomlTable) -> BusTable:
    return BusTable(table.text("interface"), table.text("channel"), _extra(table))
