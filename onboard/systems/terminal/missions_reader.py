"""What an operator orders at a terminal, and obstacles on its lanes: the demonstration in a site file."""

import re
from typing import Protocol

from onboard.config.fleet import FleetReader
from onboard.config.problems import nearest
from onboard.config.reader import TomlTable
from onboard.contract.codes import KindCode
from onboard.systems.terminal.site import Blockage, EntityKind, Mission, Press

_CLOCK = re.compile(r"(\d{1,2}):([0-5]\d) ?(am|pm)?", re.IGNORECASE)
_DAY_S = 86_400
#: What a person can do to a vehicle by hand.
PRESSES = ("hold", "step", "release")
#: A mission's boxes and count fit into five bits on the wire.
MOST_BOXES = 31


class EntityNames(Protocol):
    """What is asked of the network: the entity that a key names."""

    def find(self, table: TomlTable, key: str, kinds: tuple[EntityKind, ...], name: str | None = None) -> int:
        """Its number, 0 for none; a mistake is noted."""


def read_missions(
    root: TomlTable,
    network: EntityNames,
    boxes: dict[str, int],
    fleet: FleetReader,
    desk: int,
    begins_s: int,
) -> tuple[Mission, ...]:
    """Rows M04 to M06: "load S10 with 10 of type T1 from A1", "tranship B1, B2 to S4", "before 4:30 pm"."""
    found = []
    for table in root.tables("missions"):
        at_s = table.integer("at_s", 0, _DAY_S, 0)
        target = network.find(table, "to", (EntityKind.STATION,))
        named = _boxes(table, boxes)
        count, kind, source = 0, "", 0
        if table.has("tranship"):
            for key in ("load", "type", "from"):
                if table.has(key):
                    table.bad(key, table.values[key], "does not go with tranship", "take it out")
        else:
            count = table.integer("load", 1, MOST_BOXES)
            kind = table.text("type")
            source = network.find(table, "from", (EntityKind.AREA, EntityKind.STATION))
        found.append(
            Mission(
                at_s * 1_000_000,
                _desk(table, fleet, desk),
                target,
                count,
                kind,
                source,
                named,
                _before_us(table, at_s, begins_s),
                _is_urgent(table),
            )
        )
    return tuple(found)


def _boxes(table: TomlTable, boxes: dict[str, int]) -> tuple[int, ...]:
    named = []
    for item, name in enumerate(table.items("tranship", "a list of boxes") or []):
        number = boxes.get(name) if isinstance(name, str) else None
        if number is None:
            table.bad("tranship", name, "no box of this name", nearest(str(name), sorted(boxes)), item=item)
        else:
            named.append(number)
    return tuple(named)


def _desk(table: TomlTable, fleet: FleetReader, desk: int) -> int:
    if not table.has("desk"):
        return desk
    name = table.text("desk")
    machine = fleet.by_name.get(name)
    if machine is None and ("desk" in table.wrong or fleet.is_odd(name)):
        return desk
    if machine is None or machine.kind is not KindCode.DESK:
        known = [one.name for one in fleet.by_node.values() if one.kind is KindCode.DESK]
        table.bad("desk", table.values["desk"], "no desk of this name", nearest(str(table.values["desk"]), known))
        return desk
    return machine.node_id


def _is_urgent(table: TomlTable) -> bool:
    return table.choice("priority", ["normal", "urgent"], "normal") == "urgent"


def _before_us(table: TomlTable, at_s: int, begins_s: int) -> int:
    """The date in us from the begin of the run, 0 for none."""
    if not table.has("before"):
        return 0
    text = table.text("before")
    clock = _CLOCK.fullmatch(text)
    hour = int(clock.group(1)) if clock else 24
    if clock and clock.group(3):
        hour = hour % 12 + (12 if clock.group(3).lower() == "pm" else 0) if 1 <= hour <= 12 else 24
    if clock is None or hour > 23:
        table.bad("before", text, "not a time of day", 'write hours and minutes such as "16:30" or "4:30 pm"')
        return 0
    before_s = (hour * 3600 + int(clock.group(2)) * 60 - begins_s) % _DAY_S
    if before_s <= at_s:
        table.bad("before", text, "not after the mission's own time", "write a later time, or an earlier at_s")
    return before_s * 1_000_000


def read_blockages(root: TomlTable, network: EntityNames) -> tuple[Blockage, ...]:
    """Obstacles on lanes (row M03), by no machine known beforehand."""
    found = []
    for table in root.tables("blockages"):
        lane = network.find(table, "lane", (EntityKind.LANE,))
        at_s, for_s = table.integer("at_s", 0, _DAY_S), table.integer("for_s", 1, _DAY_S)
        found.append(Blockage(lane, at_s * 1_000_000, (at_s + for_s) * 1_000_000))
    return tuple(found)


def read_presses(root: TomlTable, fleet: FleetReader) -> tuple[Press, ...]:
    """What a person does to vehicles by hand (row M38)."""
    found = []
    vehicles = {one.name: one for one in fleet.by_node.values() if one.kind is KindCode.VEHICLE}
    for table in root.tables("manual"):
        at_s, name = table.integer("at_s", 0, _DAY_S), table.text("vehicle")
        what = table.text("do")
        if "do" not in table.wrong and what not in PRESSES:
            table.bad("do", what, "nothing that one can do by hand", f"write {', '.join(PRESSES)}")
        if "vehicle" in table.wrong or (name not in vehicles and fleet.is_odd(name)):
            continue
        if name not in vehicles:
            table.bad("vehicle", name, "no vehicle of this name", nearest(name, list(vehicles)))
        else:
            found.append(Press(at_s * 1_000_000, vehicles[name].node_id, what))
    return tuple(found)
