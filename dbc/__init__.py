"""The wire contract as data: six files of all systems, and what single systems add. This only finds the files."""

from importlib.resources import files

#: What is no single system's.
_OF_ALL = ("fleet.dbc", "device.dbc", "seal.dbc", "battery.dbc", "change.dbc", "announce.dbc")


def fleet_dbc_text() -> str:
    """Text of the contract between machines."""
    return files(__name__).joinpath("fleet.dbc").read_text(encoding="utf-8")


def device_dbc_text() -> str:
    """Text of the contract between a machine and its own drives, doors and sensors."""
    return files(__name__).joinpath("device.dbc").read_text(encoding="utf-8")


def seal_dbc_text() -> str:
    """Text of what proves on the fleet bus who said a frame; only sites with seals have it said."""
    return files(__name__).joinpath("seal.dbc").read_text(encoding="utf-8")


def battery_dbc_text() -> str:
    """Text of what machines with a battery tell of it on the fleet bus; only sites with batteries have it said."""
    return files(__name__).joinpath("battery.dbc").read_text(encoding="utf-8")


def change_dbc_text() -> str:
    """Text of the word of a change of site on the fleet bus; said while an operator rolls one out, and never else."""
    return files(__name__).joinpath("change.dbc").read_text(encoding="utf-8")


def announce_dbc_text() -> str:
    """Text of what is said on both buses when a driver announces when the car will be fetched, and never else."""
    return files(__name__).joinpath("announce.dbc").read_text(encoding="utf-8")


def systems() -> list[str]:
    """Names of the systems that have a file of their own, as site files say them."""
    names = (entry.name for entry in files(__name__).iterdir() if entry.name.endswith(".dbc"))
    own = (name for name in names if name not in _OF_ALL)
    return sorted(name.removesuffix(".dbc").replace("_", "-") for name in own)


def system_dbc_text(system: str) -> str | None:
    """What one system says beyond the two others, on both buses, of its file (``_`` for ``-``); None for nothing."""
    file = files(__name__).joinpath(f"{system.replace('-', '_')}.dbc")
    return file.read_text(encoding="utf-8") if file.is_file() else None
