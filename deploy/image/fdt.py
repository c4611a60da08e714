"""Flattened device trees (Devicetree Specification 0.4, chapter 5): read, changed, written."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from deploy.wheels import DeployError

_MAGIC, _VERSION, _COMPATIBLE = 0xD00DFEED, 17, 16
_BEGIN, _END, _PROPERTY, _NOP, _FINISH = 1, 2, 3, 4, 9
_HEADER = struct.Struct(">10I")


@dataclass
class DeviceTreeNode:
    """A node with its properties as they lie in the file, and its children by full name (``spi@7e204000``)."""

    properties: dict[str, bytes] = field(default_factory=dict)
    children: dict[str, "DeviceTreeNode"] = field(default_factory=dict)

    def at(self, path: str) -> "DeviceTreeNode":
        """The node at an absolute path. Raises ``DeployError``."""
        node = self
        for part in filter(None, path.split("/")):
            if part not in node.children:
                raise DeployError(f"device tree: no {path}")
            node = node.children[part]
        return node

    def walk(self, path: str = "/") -> Iterator[tuple[str, "DeviceTreeNode"]]:
        """All nodes from this one down, with their paths."""
        yield path, self
        for name, child in self.children.items():
            yield from child.walk(f"{path.rstrip('/')}/{name}")

    def cells(self, name: str) -> list[int]:
        """A property as 32-bit numbers."""
        raw = self.properties[name]
        return list(struct.unpack(f">{len(raw) // 4}I", raw))

    def text(self, name: str) -> str:
        """A property as text, without the zero byte at its end. Raises ``KeyError`` where there is none of the name."""
        return self.properties[name].rstrip(b"\0").decode()


def read_tree(raw: bytes) -> DeviceTreeNode:
    """The root node. Raises ``DeployError`` for what is no device tree."""
    try:
        magic, _, structure, strings, *_ = _HEADER.unpack_from(raw)
        if magic != _MAGIC:
            raise DeployError("this is no device tree")
        return _read(raw, structure, strings)
    except (struct.error, ValueError, IndexError) as error:
        raise DeployError(f"this is no whole device tree ({error})") from error


def _read(raw: bytes, at: int, strings: int) -> DeviceTreeNode:
    above: list[DeviceTreeNode] = [DeviceTreeNode()]
    while True:
        (token,) = struct.unpack_from(">I", raw, at)
        at += 4
        if token == _BEGIN:
            end = raw.index(b"\0", at)
            node = DeviceTreeNode()
            above[-1].children[raw[at:end].decode()] = node
            above.append(node)
            at = (end + 4) & ~3
        elif token == _END:
            above.pop()
        elif token == _PROPERTY:
            length, name = struct.unpack_from(">2I", raw, at)
            begin = strings + name
            above[-1].properties[raw[begin : raw.index(b"\0", begin)].decode()] = raw[at + 8 : at + 8 + length]
            at = (at + 8 + length + 3) & ~3
        elif token == _FINISH:
            return above[0].children[""]
        elif token != _NOP:
            raise DeployError(f"device tree: unknown token {token}")


def write_tree(root: DeviceTreeNode) -> bytes:
    """A tree as a file."""
    strings: dict[str, int] = {}
    table = bytearray()
    structure = bytearray()

    def add(name: str, node: DeviceTreeNode) -> None:
        structure.extend(struct.pack(">I", _BEGIN) + _padded(name.encode() + b"\0"))
        for key, value in node.properties.items():
            if key not in strings:
                strings[key] = len(table)
                table.extend(key.encode() + b"\0")
            structure.extend(struct.pack(">3I", _PROPERTY, len(value), strings[key]) + _padded(value))
        for key, child in node.children.items():
            add(key, child)
        structure.extend(struct.pack(">I", _END))

    add("", root)
    structure.extend(struct.pack(">I", _FINISH))
    reserved = bytes(16)
    begin = _HEADER.size + len(reserved)
    total = begin + len(structure) + len(table)
    lengths = (len(table), len(structure))
    header = (_MAGIC, total, begin, begin + len(structure), _HEADER.size, _VERSION, _COMPATIBLE, 0, *lengths)
    return _HEADER.pack(*header) + reserved + bytes(structure) + bytes(table)


def _padded(value: bytes) -> bytes:
    return value + bytes(-len(value) % 4)
