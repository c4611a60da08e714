"""Which module of ``onboard/contract`` holds what, and its whole text."""

import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
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
from onboard.contract.generate.classes import (
    HEAD,
    enumerations,
    message_class,
    set_classes,
    uses,
    version,
    words_digest,
)
from onboard.contract.generate.decoding import function_name, reader, table_name, unpack_function
from onboard.contract.generate.encoding import pack_function, tools
from onboard.contract.generate.model import TUPLES, ContractError, DbcFile, DbcMessage, FrameSet, read_contract

PACKAGE = "onboard.contract"
#: The module of the enumerations of the two contracts of all.
CODES = "codes"
#: What each module of classes is about, behind the name of its file.
_ABOUT = {
    "calls": "Calls, bids and awards",
    "plans": "Plans, places, and where cars and machines are",
    "presence": "Who lives, who stands and why, and what people order",
    "rights": "Tokens: who asks for them, who gives and who holds them",
    "seal": "Seals: proof of who said what on the fleet bus",
    "battery": "What machines with a battery tell of it on the fleet bus",
    "change": "The word of a change of site",
    "announce": "When a car will be fetched, as its driver says beforehand",
    "announce_device": "When a car will be fetched, as its driver says beforehand",
    "device": "What a machine says to its own drives, doors and sensors, and they to it",
}


def contracts() -> tuple[DbcFile, ...]:
    """Every DBC in ``dbc/``, those of all first. ``ContractError`` for one that is not fit for code."""
    fleet = read_contract("fleet", fleet_dbc_text(), CODES, ())
    device = read_contract("device", device_dbc_text(), CODES, fleet.tables)
    shared = (*fleet.tables, *device.tables)
    found = [fleet, device, read_contract("seal", seal_dbc_text(), "seal", shared)]
    found.append(read_contract("battery", battery_dbc_text(), "battery", shared))
    found.append(read_contract("change", change_dbc_text(), "change", shared))
    found.append(read_contract("announce", announce_dbc_text(), "announce", shared))
    for name in systems():
        text = system_dbc_text(name)
        assert text is not None
        module = name.replace("-", "_")
        found.append(read_contract(module, text, module, shared))
    return _with_common_tables(tuple(found))


def _with_common_tables(every: tuple[DbcFile, ...]) -> tuple[DbcFile, ...]:
    """An enumeration that several systems name alike is one, and stands where those of all are.

    ``ContractError`` where they name alike what is not: other values, or another comment.
    """
    tables = [(contract, table) for contract in every for table in contract.tables]
    first = {table.name: (contract, table) for contract, table in reversed(tables)}
    for contract, table in tables:
        other, known = first[table.name]
        if (known.choices, known.comment) != (table.choices, table.comment):
            raise ContractError(
                f"{contract.name}.dbc: value table {table.name} is another than that of {other.name}.dbc"
            )
    times = Counter(table.name for _, table in tables)
    return tuple(
        replace(
            contract,
            tables=tuple(replace(one, module=CODES) if times[one.name] > 1 else one for one in contract.tables),
        )
        for contract in every
    )


def generated(every: tuple[DbcFile, ...]) -> dict[str, str]:
    """The text of every generated file, by its name below ``onboard/contract``, in ruff's format."""
    fleet, device, *_ = every
    common = {table.name: table for one in every for table in one.tables if table.module == CODES}
    where = dict.fromkeys(common, CODES)
    files = {
        "codes.py": HEAD.format(what="Value tables shared by every message.", file="fleet.dbc`` and ``dbc/device")
        + f"from enum import IntEnum\n\n{version(fleet)}\n\n{enumerations(common.values())}"
    }
    shared: dict[str, list[str]] = {}
    for contract in every:
        own = where | {table.name: contract.name for table in contract.tables if table.module != CODES}
        for module in dict.fromkeys(frame.module for frame in contract.frames):
            frames = tuple(frame for frame in contract.frames if frame.module == module)
            sets = tuple(one for one in contract.sets if one.module == module)
            files[f"{module}.py"] = _classes(contract, module, frames, sets, own)
            files[f"packing/{module}.py"] = _packing(contract, module, frames, sets, own)
            if module.replace("_", "-") in systems():
                files[f"packing/{module}.py"] += _words(contract)
            if contract in (fleet, device):
                names = [frame.layout.name for frame in frames] + [one.name for one in sets]
                shared[module] = sorted([*names, *(one.repeated for one in sets if one.repeated)])
    files["messages.py"] = _every_message(shared)
    return _formatted(files)


def _classes(
    contract: DbcFile, module: str, frames: tuple[DbcMessage, ...], sets: tuple[FrameSet, ...], where: dict[str, str]
) -> str:
    about = _ABOUT.get(
        module, f"What the machines of the system {contract.name.replace('_', '-')} say beyond the messages of all"
    )
    about += ", on their device buses" if module.endswith("_device") else ""
    own = tuple(table for table in contract.tables if table.module == module)
    used = {name for frame in frames for name in uses(frame.fields)}
    used |= {name for one in sets for name in uses((*one.fields, *one.repeated_fields))}
    lines = [HEAD.format(what=f"{about}.", file=contract.name)]
    if own:
        lines.append("from enum import IntEnum\n")
    if any(one.repeated for one in sets):
        lines.append("from typing import NamedTuple\n")
    base = {"message", *(used & {*TUPLES, "NO_REFERENCE"})}
    base |= {"SetFrame" if frame.part_of else "Message" for frame in frames} | {"Message" for _ in sets}
    lines.append(_import("base", base))
    lines += [
        _import(place, {name for name in used if where.get(name) == place})
        for place in sorted(set(where.values()) - {module})
    ]
    blocks = [enumerations(own)] if own else []
    blocks += [message_class(frame) for frame in frames]
    blocks += [set_classes(one) for one in sets]
    return "".join(lines) + "\n\n" + "\n\n".join(blocks)


def _packing(
    contract: DbcFile, module: str, frames: tuple[DbcMessage, ...], sets: tuple[FrameSet, ...], where: dict[str, str]
) -> str:
    used = {name for frame in frames for name in uses(frame.fields)}
    tuples = used & set(TUPLES)
    enums = {name for name in used if name in where}
    first = {one.frames[0].layout.name: one.name for one in sets}
    packs = [pack_function(frame) for frame in frames]
    lines = [HEAD.format(what=f"Bytes of the messages in ``{PACKAGE}.{module}``, and back.", file=contract.name)]
    lines.append("import struct\n\n")
    helpers = {name for name in ("OutOfRangeError", "refusal") if any(name in text for text in packs)}
    lines.append(_import("base", {"FrameCode", *helpers, *tuples}))
    for place in sorted({where[name] for name in enums}):
        names = {name for name in enums if where[name] == place}
        if place != module:
            lines.append(_import(place, names))
    own = {name for name in enums if where[name] == module}
    lines.append(_import(module, own | {frame.layout.name for frame in frames} | set(first.values())))
    lines.append("\n")
    if tuples:
        lines.append("_new = tuple.__new__\n")
    lines += [f"{table_name(name)} = tuple({name})\n" for name in sorted(enums)]
    made = {one for frame in frames for one in (*tools(frame), reader(frame))}
    lines += [f"{name} = {value}\n" for name, value in sorted(made)]
    blocks = [text for pack, frame in zip(packs, frames, strict=True) for text in (pack, unpack_function(frame))]
    return "".join(lines) + "\n\n" + "\n\n".join([*blocks, _frames(frames, first)])


def _frames(frames: tuple[DbcMessage, ...], first: dict[str, str]) -> str:
    """The list of a module's frames."""
    lines = ["#: Every frame of this module.", "FRAMES = ("]
    for frame in frames:
        layout, name = frame.layout, function_name(frame)
        says = first.get(layout.name) if frame.part_of else layout.name
        senders = ", ".join(f'"{one}"' for one in layout.senders) + ("," if len(layout.senders) == 1 else "")
        lines.append(
            f'    FrameCode("{layout.name}", 0x{layout.frame_id:08X}, {layout.length}, pack_{name}, unpack_{name}, '
            f"{layout.name}, {says}, ({senders}), {frame.is_device}),"
        )
    return "\n".join([*lines, ")"]) + "\n"


def _words(contract: DbcFile) -> str:
    """By what machines of one system know that they mean the same by its own words."""
    number = f"WORDS = 0x{words_digest(contract):08X}\n"
    return f"#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).\n{number}"


def _every_message(shared: dict[str, list[str]]) -> str:
    lines = [HEAD.format(what="Every message of the two contracts of all.", file="fleet.dbc`` and ``dbc/device")]
    lines.append(_import("base", {"NO_REFERENCE", "Message", "Reference", "Stamp"}))
    lines += [_import(module, set(names)) for module, names in sorted(shared.items())]
    names = sorted(
        {"NO_REFERENCE", "Message", "Reference", "Stamp", *(name for one in shared.values() for name in one)}
    )
    return "".join(lines) + "\n__all__ = [" + ", ".join(f'"{name}"' for name in names) + "]\n"


def _import(module: str, names: Iterable[str]) -> str:
    ordered = ", ".join(sorted(names))
    return f"from {PACKAGE}.{module} import {ordered}\n" if ordered else ""


def _formatted(files: dict[str, str]) -> dict[str, str]:
    """The texts as ruff sorts imports and lays out code; ruff comes with the tools for tests."""
    ruff = [sys.executable, "-m", "ruff"]
    config = ("--quiet", "--no-cache", "--config", str(_ROOT / "pyproject.toml"))
    with tempfile.TemporaryDirectory() as folder:
        places = {name: Path(folder, name) for name in files}
        Path(folder, "packing").mkdir()
        for name, text in files.items():
            places[name].write_text(text, encoding="utf-8")
        subprocess.run([*ruff, "check", *config, "--select", "I,RUF022", "--fix", "--exit-zero", folder], check=True)
        subprocess.run([*ruff, "format", *config, folder], check=True)
        return {name: place.read_text(encoding="utf-8") for name, place in places.items()}


_ROOT = Path(__file__).parents[3]
