"""docs/network.md from the DBC files: ``python -m onboard.wire.network_doc [FILE]``."""

import sys
from collections.abc import Iterable
from pathlib import Path

from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts

_HEAD = """\
# The network

Generated from `dbc/fleet.dbc` and `dbc/device.dbc` by `make docs`; the DBC files are the contract, this page only shows
them.

Classic CAN 2.0B, 29-bit identifiers, 8 data bytes, little-endian signals. An identifier is

| bits 28..24 | bits 23..16 | bits 15..8 | bits 7..0 |
|---|---|---|---|
| priority, 0 highest | message type | zero | node-ID of the sending machine |

so two nodes never send one identifier with different data. On a device bus the lowest byte is the machine's node-ID in
both directions. `bus-sim dbc SITE` prints a DBC with one message for each machine of a site, for tools without a mask.
"""


def _identifier(layout: MessageLayout) -> str:
    return f"`{layout.frame_id >> 8:06X}nn`"


def _values(signal: SignalLayout) -> str:
    if signal.choices:
        return "<br>".join(f"{value} {name}" for value, name in signal.choices)
    scale = "" if (signal.scale, signal.offset) == (1, 0) else f"; raw x {signal.scale} + {signal.offset}"
    return f"{signal.minimum} to {signal.maximum}{f' {signal.unit}' if signal.unit else ''}{scale}"


def _summary(layouts: Iterable[MessageLayout]) -> list[str]:
    lines = ["| message | identifier | priority | from | to | cycle |", "|---|---|---|---|---|---|"]
    for layout in layouts:
        cycle = f"{layout.cycle_ms} ms" if layout.cycle_ms else "on events"
        name = f"[{layout.name}](#{layout.name.lower()})"
        ends = f"{', '.join(layout.senders)} | {', '.join(layout.receivers)}"
        lines.append(f"| {name} | {_identifier(layout)} | {layout.frame_id >> 24} | {ends} | {cycle} |")
    return lines


def _message(layout: MessageLayout) -> list[str]:
    lines = [
        "",
        f"### {layout.name}",
        "",
        layout.comment,
        "",
        "| signal | bits | values | meaning |",
        "|---|---|---|---|",
    ]
    for signal in layout.signals:
        bits = f"{signal.shift} to {signal.shift + signal.bits - 1}" if signal.bits > 1 else f"{signal.shift}"
        lines.append(f"| `{signal.name}` | {bits} | {_values(signal)} | {signal.comment} |")
    return lines


def network_page() -> str:
    """The whole page as Markdown."""
    lines = [_HEAD]
    for title, layouts in (("Fleet bus", fleet_layouts()), ("Device bus", device_layouts())):
        lines += [f"## {title}", "", *_summary(layouts)]
        for layout in layouts:
            lines += _message(layout)
        lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


def main() -> None:
    """Write the page to the file named, or to docs/network.md."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/network.md")
    target.write_text(network_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
