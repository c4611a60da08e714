"""What a pick-up and delivery site is, in lines for a person: its floor, its machines, and what was proved of them."""

from onboard.config.site_report import counted, machines_line
from onboard.contract.codes import KindCode
from onboard.systems.mapd.site import Mapd

_KINDS = {KindCode.VEHICLE: "robot", KindCode.DESK: "order desk"}


def lines(site: Mapd) -> list[str]:
    """The floor, machines; whether each endpoint is reached from each home and back; how many robots can rest."""
    homes = site.homes.values()
    ground = site.floor.network.ground([*homes][:1])
    lost = [site.floor.names[cell] for cell in (*site.endpoints, *homes) if cell not in ground]
    reached = "every endpoint from every home, and every home from every endpoint"
    rests = f"{counted(len(site.rests), 'robot')} at the same time, and the others still get everywhere"
    return [
        _floor_line(site),
        machines_line(site, _KINDS),
        f"endpoints: {len(site.endpoints)}, {counted(len(site.tasks), 'task')}",
        f"reached: {reached if not lost else 'all but ' + ', '.join(lost)}",
        f"rests: {rests}; {counted(len(homes), 'robot')} here",
    ]


def _floor_line(site: Mapd) -> str:
    if site.rows:
        free = sum(1 for ways in site.floor.ways if ways)
        return f"floor: {len(site.rows[0])} by {len(site.rows)} cells, {free} free"
    zones = f", {counted(len(site.zones), 'zone')}" if site.zones else ""
    points, count = counted(len(site.points), "point"), counted(len(site.lines), "line")
    return f"floor: {points}, {count}, {site.floor.size} cells{zones}"
