"""The machines of a site file: names and node-IDs, each its own."""

import re
from dataclasses import dataclass, field

from onboard.config.reader import TomlTable
from onboard.config.toml_lines import path_text
from onboard.contract.codes import KindCode
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Machine, Segment, Station

#: A C identifier, as a DBC names nodes and messages, short enough for ``<name>_<message>`` within its 32 characters.
#: No underscore at the end: most words of the DBC language end so. The others are ``_DBC_WORDS``.
_NAME = re.compile(r"[A-Za-z](?:[A-Za-z0-9_]{0,14}[A-Za-z0-9])?")
_DBC_WORDS = frozenset(["FILTER", "VERSION", "Vector__XXX"])


@dataclass
class FleetReader:
    """Machines read so far, by node-ID, and everything that has a name already, mistaken machines included.

    ``robots`` are their tables and homes, in the order of the file; ``odd`` stands in for machines whose name or
    node-ID is mistaken, by node-IDs that nobody has.
    """

    by_node: dict[int, Machine] = field(default_factory=dict)
    by_name: dict[str, Machine | None] = field(default_factory=dict)
    homes: dict[Segment, str] = field(default_factory=dict)
    robots: list[tuple[TomlTable, Segment]] = field(default_factory=list)
    odd: dict[int, Machine] = field(default_factory=dict)
    are_names_odd: bool = False

    def add(self, table: TomlTable, kind: KindCode, home: Segment, station: Station | None = None) -> Machine:
        """Read name and node-ID of one machine; both are its own. A machine with a mistake is named but only odd."""
        name = table.text("name")
        if name and (not _NAME.fullmatch(name) or name in _DBC_WORDS):
            table.bad(
                "name", name, "not usable in a DBC", "write a letter, then up to 15 letters, digits or _ (not last)"
            )
        elif name in self.by_name:
            table.bad("name", name, "used twice", "give each machine a name of its own")
        node = table.integer("node", 1, MAX_NODE_ID)
        if "node" not in table.wrong and node in self.by_node:
            what = f"node-ID of {self.by_node[node].name} already"
            table.bad("node", node, what, "give each machine a node-ID of its own")
        if table.wrong & {"name", "node"}:
            self.by_name.setdefault(name, None)
            self.are_names_odd |= "name" in table.wrong
            node = MAX_NODE_ID + 1 + len(self.odd)
            self.odd[node] = Machine(node, path_text(table.path), kind, home, station)
            return self.odd[node]
        self.by_name[name] = self.by_node[node] = Machine(node, name, kind, home, station)
        return self.by_node[node]

    def is_odd(self, name: str) -> bool:
        """Whether a machine that is mistaken is meant by a name, or may be, as its own name is mistaken."""
        return self.by_name.get(name, ...) is None or (name not in self.by_name and self.are_names_odd)

    def fixed(self) -> list[Machine]:
        """Compartments and lifts by node-ID: what can be a steward."""
        return [machine for _, machine in sorted(self.by_node.items()) if machine.kind is not KindCode.ROBOT]
