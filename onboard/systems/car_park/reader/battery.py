"""``[battery]`` of a site file: the robots' batteries, and where robots are charged."""

from onboard.config.reader import TomlTable
from onboard.core.site import Segment
from onboard.systems.car_park.battery import Battery
from onboard.systems.car_park.reader.layout import Layout, one_position
from onboard.systems.car_park.room import refuge_tracks, robots_text
from onboard.ways.refuges import open_refuges
from onboard.ways.site import WaySite

_FORM = 'a list of positions such as ["p(2,3)", "p(3,8)"]'


def read_battery(table: TomlTable, layout: Layout, homes: list[Segment]) -> Battery | None:
    """The robots' batteries; None where the table is empty. Without ``chargers`` robots are charged at ``homes``."""
    drive_w = table.integer("drive_w", 1, 100_000, 600)
    floor = table.integer("floor_percent", 1, 90, 25)
    ready = table.integer("ready_percent", 2, 99, max(50, floor + 1))
    seek = table.integer("seek_percent", 2, 100, max(80, ready))
    rest_w, charge_w = table.integer("rest_w", 0, 100_000, 80), table.integer("charge_w", 1, 1_000_000, 500)
    if ready <= floor:
        table.bad("ready_percent", ready, f"no more than floor_percent, {floor}", "make it more")
    if seek < ready:
        table.bad("seek_percent", seek, f"less than ready_percent, {ready}", "make it as much, or more")
    if charge_w <= rest_w:
        table.bad("charge_w", charge_w, f"no more than what a robot draws at rest, rest_w {rest_w}", "make it more")
    battery = Battery(
        table.integer("capacity_wh", 1, 1_000_000, 500),
        drive_w,
        table.integer("loaded_drive_w", 1, 100_000, drive_w),
        table.integer("shuttle_w", 0, 100_000, 400),
        rest_w,
        charge_w,
        floor,
        ready,
        seek,
        _read_chargers(table, layout, homes),
    )
    return battery if table.values else None


def _read_chargers(table: TomlTable, layout: Layout, homes: list[Segment]) -> tuple[Segment, ...]:
    texts = table.items("chargers", _FORM)
    if texts is None:
        return tuple(homes)
    found: list[Segment] = []
    for item, text in enumerate(texts):
        written = one_position(text) if isinstance(text, str) else None
        if written is None:
            table.bad("chargers", text, "not a position", f"write {_FORM}", item=item)
            continue
        segment = layout.judged(table, "chargers", written, item=item, spurs=True)
        if segment in found:
            table.bad("chargers", text, "named twice", "name it once", item=item)
        elif segment is not None:
            found.append(segment)
    return tuple(found)


def check_chargers(table: TomlTable, site: WaySite, battery: Battery) -> None:
    """Note chargers where no robot may stand for ever, and too few: then one would have to drive another away."""
    open_ones, robots = open_refuges(site, ()), len(site.robots)
    closed = [segment for segment in battery.chargers if segment not in open_ones]
    if closed:
        what = f"no robot may stand for ever at {', '.join(map(str, closed))}"
        table.bad("chargers", None, what, "name positions such as robots' homes")
    together = {one.track for one in battery.chargers} & set(refuge_tracks(site, robots))
    if not closed and len(together) < robots:
        what = f"{robots_text(robots)}, of which {len(together)} can be charged at the same time"
        table.bad("chargers", None, what, "name one for each, each on an alley or spur of its own")
