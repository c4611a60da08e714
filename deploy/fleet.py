"""What goes onto the boot partition of every board of a site: a folder a machine, generated from the site file."""

from pathlib import Path

from onboard.config.machine_text import BusTable, machine_text
from onboard.config.shipped import site_source
from onboard.config.site import parse_site
from onboard.core.site import Machine, Site
from onboard.systems.registry import factory_for
from onboard.systems.system import WithSecrets

#: The device bus of a machine that may not share a wire.
OWN_WIRE = "can1"


def keeps_secrets(machine: Machine, site: Site) -> bool:
    """Whether its devices say what nobody on the fleet bus may read."""
    return isinstance(factory_for(site, machine.kind), WithSecrets)


def machine_file(site: Site, node: int, fleet: str, device: str) -> str:
    """The machine file of one node; one interface may carry both buses, but of a desk, as tickets are read on its own.

    Raises ``KeyError``.
    """
    machine = site.machines[node]
    if device == fleet and keeps_secrets(machine, site):
        device = OWN_WIRE if fleet != OWN_WIRE else "can0"
    kind = machine.kind.name.lower().replace("_", " ")
    head = f"# {machine.name}, a {kind} of site {site.name}, node {node}. All keys: docs/machine-file.md\n"
    devices = BusTable("socketcan", device) if device != fleet else None
    return head + machine_text(machine.name, "site.toml", BusTable("socketcan", fleet), devices)


def write_fleet(site_file: Path, to: Path, fleet: str = "can0", device: str = "can1") -> list[Path]:
    """Write ``to/NAME/machine.toml`` and ``site.toml`` for every machine. Raises ``ConfigError``, ``OSError``."""
    text, name = site_source(site_file)
    site = parse_site(text, name)
    folders = []
    for node, machine in site.machines.items():
        folder = to / machine.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "site.toml").write_text(text, encoding="utf-8")
        (folder / "machine.toml").write_text(machine_file(site, node, fleet, device), encoding="utf-8")
        folders.append(folder)
    return folders
