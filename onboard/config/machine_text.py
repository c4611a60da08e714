"""Writing machine files: for a whole fleet at once, for processes on one computer, for a board on a bench.

What is written here, ``onboard.config.machine`` reads; docs/machine-file.md describes every key.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from onboard.config.problems import quoted

#: What a further key of a bus table may be.
Value = str | int | float | bool


@dataclass(frozen=True, slots=True)
class BusTable:
    """A bus in python-can's words; ``extra`` are further keys. The bit rate is the site's."""

    interface: str
    channel: str
    extra: Mapping[str, Value] = field(default_factory=dict)

    def lines(self, name: str) -> list[str]:
        """Header and keys as lines of TOML; ``name`` is that of the table."""
        values: dict[str, Value] = {"interface": self.interface, "channel": self.channel, **self.extra}
        return [f"[{name}]", *(f"{key} = {_written(value)}" for key, value in values.items())]


def machine_text(
    name: str, site: str, fleet_bus: BusTable, device_bus: BusTable | None = None, journal: str | None = None
) -> str:
    """The machine file of machine ``name``. ``site`` and ``journal`` are paths as seen from the file's directory.

    Without ``device_bus`` the devices are on the fleet bus; without ``journal`` it is the reader's default.
    """
    lines = ["[machine]", f"name = {quoted(name)}", f"site = {quoted(site)}"]
    lines += [f"journal = {quoted(journal)}"] if journal is not None else []
    lines += ["", *fleet_bus.lines("fleet_bus")]
    lines += ["", *device_bus.lines("device_bus")] if device_bus is not None else []
    return "\n".join([*lines, ""])


def _written(value: Value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return quoted(value) if isinstance(value, str) else str(value)
