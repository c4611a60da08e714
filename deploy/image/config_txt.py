"""What a board's firmware does with the CAN lines of ``config.txt``: overlays, their parameters, the merged tree.

The board's own firmware does it on the board. Here it shows, before anything is flashed, that the lines fit the trees
and overlays of the image (Raspberry Pi documentation, "Device Trees, overlays, and parameters", part 3).
"""

import re
import struct
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from deploy.image.apt import run_tool
from deploy.image.fdt import DeviceTreeNode, read_tree, write_tree
from deploy.wheels import DeployError

_LINE = re.compile(r"\s*dtoverlay\s*=\s*(?P<name>[\w-]+)(?P<parameters>(?:,[^#\s]*)?)\s*(?:#.*)?")


def overlays_of(config: str) -> list[tuple[str, dict[str, str]]]:
    """Every ``dtoverlay`` line: its overlay and its parameters; one without a value is switched on."""
    found = []
    for line in config.splitlines():
        match = _LINE.fullmatch(line)
        if match is not None:
            words = [word.partition("=") for word in match["parameters"].split(",") if word]
            found.append((match["name"], {key: value or "on" for key, _, value in words}))
    return found


def merged(config: str, tree: Path, overlays: Path) -> DeviceTreeNode:
    """A board's tree with all that ``config`` lays over it, in order. Raises ``DeployError`` for what does not fit."""
    with tempfile.TemporaryDirectory() as name:
        now = Path(name, "tree.dtb")
        now.write_bytes(tree.read_bytes())
        for number, (overlay, parameters) in enumerate(overlays_of(config)):
            source = overlays / f"{overlay}.dtbo"
            if not source.exists():
                known = ", ".join(sorted(file.stem for file in overlays.glob("*.dtbo")))
                raise DeployError(f"config.txt: dtoverlay={overlay}: there is no such overlay; known: {known}")
            given = Path(name, f"{number}.dtbo")
            given.write_bytes(with_parameters(source.read_bytes(), parameters, overlay))
            then = Path(name, f"{number}.dtb")
            run_tool(["fdtoverlay", "-i", str(now), "-o", str(then), str(given)])
            now = then
        return read_tree(now.read_bytes())


def with_parameters(overlay: bytes, parameters: Mapping[str, str], name: str) -> bytes:
    """An overlay as it is after its parameters. Raises ``DeployError`` for one that it does not have."""
    root = read_tree(overlay)
    overrides = root.children.pop("__overrides__", DeviceTreeNode()).properties
    for key, value in parameters.items():
        if key not in overrides:
            known = ", ".join(sorted(set(overrides) - {"phandle"})) or "none"
            raise DeployError(f"config.txt: dtoverlay={name},{key}: no such parameter; known: {known}")
        for phandle, word in _entries(overrides[key]):
            _apply(root, phandle, word, value)
    fixups = root.children.get("__local_fixups__", DeviceTreeNode())
    fixups.children.pop("__overrides__", None)
    # A fragment that sleeps is none.
    for key in [key for key, node in root.children.items() if "__dormant__" in node.children]:
        del root.children[key]
        fixups.children.pop(key, None)
        _forget(root, f"/{key}")
    return write_tree(root)


def _entries(raw: bytes) -> Iterable[tuple[int, str]]:
    """Pairs of a node's handle, 0 for the overlay itself, and what is to be done there."""
    at = 0
    while at < len(raw):
        (phandle,) = struct.unpack_from(">I", raw, at)
        end = raw.index(b"\0", at + 4)
        yield phandle, raw[at + 4 : end].decode()
        at = end + 1


def _apply(root: DeviceTreeNode, phandle: int, word: str, value: str) -> None:
    if phandle == 0:
        for sign, number in re.findall(r"([+-])(\d+)", word):
            _switch(root, f"fragment@{number}", is_on=sign == "+")
        return
    path = next(
        (path for path, node in root.walk() if node.properties.get("phandle") == struct.pack(">I", phandle)), ""
    )
    where, is_literal, literal = word.partition("=")
    key, is_cell, offset = where.partition(":")
    given = literal if is_literal else value
    node = root.at(path)
    if not is_cell:
        if key == "name":
            _rename(root, path, given)
        else:
            node.properties[key] = given.encode() + b"\0"
        return
    raw = bytearray(node.properties[key])
    struct.pack_into(">I", raw, int(offset), int(given, 0))
    node.properties[key] = bytes(raw)
    if key == "reg":
        # A node's name ends in its address, and the firmware keeps the two together.
        _rename(root, path, f"{path.rpartition('/')[2].partition('@')[0]}@{int(given, 0):x}")


def _switch(root: DeviceTreeNode, fragment: str, *, is_on: bool) -> None:
    """A fragment sleeps by the name of its content; what refers to it by its path goes with it."""
    here, there = ("__dormant__", "__overlay__") if is_on else ("__overlay__", "__dormant__")
    if here in root.children[fragment].children:
        _rename(root, f"/{fragment}/{here}", there)


def _rename(root: DeviceTreeNode, path: str, name: str) -> None:
    """Also in the overlay's own lists of what refers to where (``__fixups__``, ``__local_fixups__``, symbols)."""
    parent, _, old = path.rpartition("/")
    trees = [root]
    if "__local_fixups__" in root.children:
        trees.append(root.children["__local_fixups__"])
    for tree in trees:
        try:
            children = tree.at(parent).children
        except DeployError:
            continue
        renamed = {name if key == old else key: node for key, node in children.items()}
        children.clear()
        children.update(renamed)
    pattern = re.compile(rf"{re.escape(path)}(?=[/:\0])".encode())
    for list_name in ("__fixups__", "__symbols__"):
        listed = root.children.get(list_name, DeviceTreeNode()).properties
        for key, raw in listed.items():
            listed[key] = pattern.sub(f"{parent}/{name}".encode(), raw)


def _forget(root: DeviceTreeNode, path: str) -> None:
    """Take what lies below a path out of the overlay's lists."""
    for list_name in ("__fixups__", "__symbols__"):
        listed = root.children.get(list_name, DeviceTreeNode()).properties
        for key, raw in list(listed.items()):
            kept = [one for one in raw.rstrip(b"\0").split(b"\0") if not one.startswith(f"{path}/".encode())]
            kept = [one for one in kept if not one.startswith(f"{path}:".encode())]
            if kept:
                listed[key] = b"\0".join(kept) + b"\0"
            else:
                del listed[key]
