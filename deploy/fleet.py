"""What goes onto the boot partition of every board of a site: a folder a machine, generated from the site file."""

from pathlib import Path

from onboard.config.site import load_site
from onboard.core.site import Site

_MACHINE = """\
# {name}, a {kind} of site {site}, node {node}. All keys: docs/machine-file.md
[machine]
name = "{name}"
site = "site.toml"

[fleet_bus]
interface = "socketcan"
channel = "{fleet}"
"""
_DEVICE = """
[device_bus]
interface = "socketcan"
channel = "{device}"
"""


def machine_file(site: Site, node: int, fleet: str, device: str) -> str:
    """The machine file of one node; one interface may carry both buses. Raises ``KeyError``."""
    machine = site.machines[node]
    kind = machine.kind.name.lower().replace("_", " ")
    text = _MACHINE.format(name=machine.name, kind=kind, site=site.name, node=node, fleet=fleet)
    return text if device == fleet else text + _DEVICE.format(device=device)


def write_fleet(site_file: Path, to: Path, fleet: str = "can0", device: str = "can1") -> list[Path]:
    """Write ``to/NAME/machine.toml`` and ``site.toml`` for every machine. Raises ``ConfigError``, ``OSError``."""
    site = load_site(site_file)
    text = site_file.read_text(encoding="utf-8")
    folders = []
    for node, machine in site.machines.items():
        folder = to / machine.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "site.toml").write_text(text, encoding="utf-8")
        (folder / "machine.toml").write_text(machine_file(site, node, fleet, device), encoding="utf-8")
        folders.append(folder)
    return folders
