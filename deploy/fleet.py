"""What goes onto the boot partition of every board of a site: a folder a machine, generated from the site file."""

from pathlib import Path

from deploy.wheels import DeployError
from onboard.config.machine_text import BusTable, machine_text
from onboard.config.shipped import site_source
from onboard.config.site import parse_site
from onboard.core.site import Site
from onboard.systems.registry import factory_for
from onboard.systems.system import WithSecrets


def machine_file(site: Site, node: int, fleet: str, device: str) -> str:
    """The machine file of one node; one interface may carry both buses. Raises ``KeyError``."""
    machine = site.machines[node]
    kind = machine.kind.name.lower().replace("_", " ")
    head = f"# {machine.name}, a {kind} of site {site.name}, node {node}. All keys: docs/machine-file.md\n"
    devices = BusTable("socketcan", device) if device != fleet else None
    return head + machine_text(machine.name, "site.toml", BusTable("socketcan", fleet), devices)


def write_fleet(site_file: Path, to: Path, fleet: str = "can0", device: str = "can1") -> list[Path]:
    """Write ``to/NAME/machine.toml`` and ``site.toml`` for every machine.

    Raises ``ConfigError``, ``OSError``, and ``DeployError`` where one wire would carry the secrets of a machine.
    """
    text, name = site_source(site_file)
    site = parse_site(text, name)
    told = [one.name for one in site.machines.values() if isinstance(factory_for(site, one.kind), WithSecrets)]
    if device == fleet and told:
        raise DeployError(
            f"{name}: tickets at {', '.join(told)} would be read on the fleet bus; give --device another channel"
        )
    folders = []
    for node, machine in site.machines.items():
        folder = to / machine.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "site.toml").write_text(text, encoding="utf-8")
        (folder / "machine.toml").write_text(machine_file(site, node, fleet, device), encoding="utf-8")
        folders.append(folder)
    return folders
