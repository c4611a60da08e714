"""The site file of a polishing shop."""

from onboard.config.fleet import FleetReader
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.core.site import Segment
from polishing_shop.site import Shop

_NOWHERE = Segment(0, 0)


def read(root: TomlTable, common: Common) -> Shop:
    """One desk, polishers, and when parts come; every mistake is one line."""
    fleet, polishing_us = FleetReader(), dict[int, int]()
    fleet.add(root.table("desk"), KindCode.DESK, _NOWHERE)
    desk = next(iter(fleet.by_node), 0)
    for table in root.tables("polishers"):
        known = set(fleet.by_node)
        fleet.add(table, KindCode.LATHE, _NOWHERE)
        takes_s = table.integer("takes_s", 1, 3_600)
        polishing_us |= dict.fromkeys(set(fleet.by_node) - known, takes_s * 1000000)
    parts_ms = tuple(table.integer("at_ms", 0, 3_600_000, 0) for table in root.tables("parts"))
    timing = read_timing(root.table("timing"), max(1, len(polishing_us)), len(fleet.by_node), common.bitrate)
    return Shop(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        machines=dict(sorted(fleet.by_node.items())),
        timing=timing,
        desk=desk,
        polishing_us=polishing_us,
        parts_ms=parts_ms,
    )
