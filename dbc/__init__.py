"""The wire contract as data: ``fleet.dbc`` and ``device.dbc``. The files are the truth; this only finds them."""

from importlib.resources import files


def fleet_dbc_text() -> str:
    """Text of the contract between machines."""
    return files(__name__).joinpath("fleet.dbc").read_text(encoding="utf-8")


def device_dbc_text() -> str:
    """Text of the contract between a machine and its own drives, doors and sensors."""
    return files(__name__).joinpath("device.dbc").read_text(encoding="utf-8")
