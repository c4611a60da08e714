"""docs/network.md from the DBC files: ``python -m onboard.wire.network_doc [FILE]``."""

import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from dbc import (
    announce_dbc_text,
    battery_dbc_text,
    change_dbc_text,
    device_dbc_text,
    fleet_dbc_text,
    seal_dbc_text,
    system_dbc_text,
    systems,
)
from onboard.wire.dbc_file import (
    MessageLayout,
    SignalLayout,
    announce_layouts,
    battery_layouts,
    change_layouts,
    device_layouts,
    fleet_layouts,
    read_annotations,
    read_layouts,
    read_nodes,
    seal_layouts,
    system_layouts,
)

_HEAD = """\
# The network

Generated from `dbc/fleet.dbc` and `dbc/device.dbc` by `make docs`; the DBC files are the contract, this page only shows
them.

The machines of a site share one **fleet bus**, at the bit rate that the site file names. Each machine speaks with its
own drives, doors and sensors on a **device bus**. No identifier is in both contracts, so that a machine with one
interface may have both on one wire.

All of it is classic CAN 2.0B: data frames with 29-bit identifiers and 8 data bytes. Bit 0 of a signal is its least
significant; bits count from the first byte's lowest bit (Intel, little-endian); bits without a signal are sent as 0 and
not looked at. An identifier is

| bits 28..24 | bits 23..16 | bits 15..8 | bits 7..0 |
|---|---|---|---|
| priority, 0 highest | message type | zero | node-ID of the sending machine, 1 to 255 |

so two nodes never send one identifier with different data. Below, `nn` is the node-ID. On a device bus it is the
machine's in both directions. `bus-sim dbc SITE` prints a DBC with one message for each machine, for tools that use no
mask.

A frame that is shorter, has another identifier, or holds a value out of its range is dropped and counted. Cycle times
are the ones of a site file that does not set its own.
"""


def _identifier(layout: MessageLayout) -> str:
    return f"`{layout.frame_id >> 8:06X}nn`"


def _cell(text: str) -> str:
    """Text that stays in its cell: a pipe would end it."""
    return text.replace("|", r"\|")


def _link(name: str) -> str:
    return f"[{name}](#{name.lower()})"


@cache
def _value_tables() -> dict[tuple[tuple[int, str], ...], str]:
    """Name of each value table of the two contracts of all (``VAL_TABLE_``), by its content."""
    named: dict[tuple[tuple[int, str], ...], str] = {}
    beside = (seal_dbc_text(), battery_dbc_text(), change_dbc_text(), announce_dbc_text())
    for text in (fleet_dbc_text(), device_dbc_text(), *beside):
        named |= {choices: name for name, choices in read_annotations(text).tables.items()}
    return {**named, ((0, "NO"), (1, "YES")): "Answer"}


def _values(signal: SignalLayout) -> str:
    if signal.choices:
        return _link(_table_name(signal))
    scale = f"; raw x {signal.scale} + {signal.offset}" if signal.is_scaled else ""
    return f"{signal.minimum} to {signal.maximum}{f' {signal.unit}' if signal.unit else ''}{scale}"


def _table_name(signal: SignalLayout) -> str:
    """The enumeration's name; a table that only one system has goes by its signal's name."""
    return _value_tables().get(signal.choices) or "".join(word.capitalize() for word in signal.name.split("_"))


def _when(layout: MessageLayout) -> str:
    if not layout.cycle_ms:
        return "on events"
    return f"{layout.cycle_ms} ms{' and on events' if layout.on_events else ''}"


def _ends(nodes: Iterable[str], everybody: tuple[str, ...]) -> str:
    found = tuple(nodes)
    return "all" if set(found) == set(everybody) else ", ".join(found)


def _bus(title: str, text: str, layouts: tuple[MessageLayout, ...]) -> list[str]:
    nodes = read_nodes(text)
    names = tuple(name for name, _ in nodes)
    lines = [f"## {title}", "", "| node | what it is |", "|---|---|"]
    lines += [f"| {name} | {_cell(comment)} |" for name, comment in nodes]
    lines += ["", "| message | identifier | priority | from | to | sent |", "|---|---|---|---|---|---|"]
    for layout in layouts:
        ends = f"{_ends(layout.senders, names)} | {_ends(layout.receivers, names)}"
        lines.append(
            f"| {_link(layout.name)} | {_identifier(layout)} | {layout.frame_id >> 24} | {ends} | {_when(layout)} |"
        )
    for layout in layouts:
        lines += _message(layout)
    return [*lines, ""]


def _message(layout: MessageLayout) -> list[str]:
    lines = ["", f"### {layout.name}", "", layout.comment, ""]
    if layout.timeout_ms:
        lines += [f"Time-out of the drive: {layout.timeout_ms} ms.", ""]
    lines += ["| signal | bits | values | meaning |", "|---|---|---|---|"]
    for signal in layout.signals:
        bits = f"{signal.shift} to {signal.shift + signal.bits - 1}" if signal.bits > 1 else f"{signal.shift}"
        sign = ", signed" if signal.signed else ""
        lines.append(f"| `{signal.name}` | {bits}{sign} | {_values(signal)} | {_cell(signal.comment)} |")
    return lines


def _tables(layouts: Iterable[MessageLayout]) -> list[str]:
    """Every value table that is used, once, in the order of its first use."""
    used = {
        (_table_name(signal), signal.choices): signal.choices
        for layout in layouts
        for signal in layout.signals
        if signal.choices
    }
    lines = ["## Value tables"]
    for (name, _), choices in used.items():
        lines += ["", f"### {name}", "", "| value | name |", "|---|---|"]
        lines += [f"| {value} | {name} |" for value, name in choices]
    return lines


def network_page() -> str:
    """The whole page as Markdown."""
    lines = [
        _HEAD,
        *_bus("Fleet bus", fleet_dbc_text(), read_layouts(fleet_dbc_text())),
        *_bus("Seals on the fleet bus", seal_dbc_text(), seal_layouts()),
        *_bus("Batteries on the fleet bus", battery_dbc_text(), battery_layouts()),
        *_bus("A change of site on the fleet bus", change_dbc_text(), change_layouts()),
        *_bus("Device bus", device_dbc_text(), read_layouts(device_dbc_text())),
        *_bus("Announced times on both buses", announce_dbc_text(), (*announce_layouts()[0], *announce_layouts()[1])),
    ]
    layouts = [*fleet_layouts(), *device_layouts()]
    for system in systems():
        text = system_dbc_text(system)
        assert text is not None
        added = (*system_layouts(system)[0], *system_layouts(system)[1])
        lines += _bus(f"What the system {system} adds", text, added)
        layouts += added
    lines += _tables(layouts)
    return "\n".join(lines).rstrip("\n") + "\n"


def main() -> None:
    """Write the page to the file named, or to docs/network.md."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/network.md")
    target.write_text(network_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
