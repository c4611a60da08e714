"""``python -m tests.foreign.table``: writes ``contract.json``, what the foreign robot's codec has of the DBC files."""

import json
from pathlib import Path
from zlib import crc32

from dbc import device_dbc_text, fleet_dbc_text
from onboard.wire.dbc_file import MessageLayout, read_layouts

FILE = Path(__file__).parent / "contract.json"
_YES_NO = ((0, "NO"), (1, "YES"))


def _row(message: MessageLayout) -> dict[str, object]:
    """A message; a signal is name, first bit, bits, signed, factor, offset, least, most, names of its values."""
    signals = []
    for one in message.signals:
        names = [] if one.choices == _YES_NO else [name for _, name in sorted(one.choices)]
        place = one.shift, one.bits, int(one.signed), one.scale, one.offset
        signals.append([one.name, *place, one.minimum, one.maximum, names])
    senders = sorted(message.senders)
    return {"name": message.name, "number": message.frame_id, "senders": senders, "signals": signals}


def text() -> str:
    """The file: a message a line."""
    words = "\n".join(line for line in fleet_dbc_text().split("\n") if line.startswith(("BO_ ", " SG_ ")))
    lines = [f'{{"contract": {128 | crc32(words.encode()) & 0x7F}']
    for bus, dbc in (("fleet", fleet_dbc_text()), ("device", device_dbc_text())):
        rows = ",\n".join(json.dumps(_row(message)) for message in read_layouts(dbc))
        lines.append(f'"{bus}": [\n{rows}]')
    return ",\n".join(lines) + "}\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
