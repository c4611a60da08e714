"""The cell in a terminal: a plan of the areas, the obstacles, robots and parts."""

from bus_sim.systems.cell.plant import CellPlant
from bus_sim.systems.cell.view import CellView
from onboard.systems.cell.geometry import Area, Point

WIDTH, HEIGHT = 78, 24


class _CharacterSheet:
    """A sheet of characters over the span of all areas and obstacles."""

    def __init__(self, areas: list[Area]) -> None:
        self._x0, self._y0 = min(area.x0_mm for area in areas), min(area.y0_mm for area in areas)
        self._x1, self._y1 = max(area.x1_mm for area in areas), max(area.y1_mm for area in areas)
        self._rows = [[" "] * WIDTH for _ in range(HEIGHT)]

    def put(self, x_mm: float, y_mm: float, text: str) -> None:
        """Write a text that begins at a place."""
        column = round((x_mm - self._x0) * (WIDTH - len(text)) / (self._x1 - self._x0))
        row = HEIGHT - 1 - round((y_mm - self._y0) * (HEIGHT - 1) / (self._y1 - self._y0))
        self._rows[row][column : column + len(text)] = text

    def frame(self, area: Area) -> None:
        """Dots along the border."""
        for share in range(101):
            x_mm = area.x0_mm + (area.x1_mm - area.x0_mm) * share / 100
            y_mm = area.y0_mm + (area.y1_mm - area.y0_mm) * share / 100
            for x, y in ((x_mm, area.y0_mm), (x_mm, area.y1_mm), (area.x0_mm, y_mm), (area.x1_mm, y_mm)):
                self.put(x, y, ".")

    def fill(self, area: Area) -> None:
        """A filled rectangle."""
        for i in range(17):
            for j in range(9):
                x_mm = area.x0_mm + (area.x1_mm - area.x0_mm) * i / 16
                self.put(x_mm, area.y0_mm + (area.y1_mm - area.y0_mm) * j / 8, "#")

    def lines(self) -> list[str]:
        """The sheet, its top first."""
        return ["".join(row).rstrip() for row in self._rows]


def plan(plant: CellPlant, view: CellView) -> str:
    """Areas as dotted frames, obstacles as #, parts as o (O in a gripper), robots by their names."""
    site = plant.site
    sheet = _CharacterSheet([*(arm.area for arm in site.arms.values()), *site.obstacles])
    for arm in site.arms.values():
        sheet.frame(arm.area)
    for obstacle in site.obstacles:
        sheet.fill(obstacle)
    for place in plant.parts.lying.values():
        sheet.put(*place, "o")
    now_us = plant.timers.now_us()
    for node, device in plant.devices.items():
        sheet.put(*device.at(now_us), device.arm.name[:4] + ("O" if node in plant.parts.aboard.values() else ""))
    lines = [*sheet.lines(), ""]
    for entry in plant.entries:
        word = entry.result.name if entry.result is not None else "at the counter"
        lines.append(f"order {entry.number}: {_place(entry.demand.start)} to {_place(entry.demand.end)}: {word}")
    lines.append(f"{now_us / 1e6:8.1f} s   goal messages {view.goal_messages}")
    return "\n".join(lines)


def _place(point: Point) -> str:
    return f"({point.x_mm / 1000:g}, {point.y_mm / 1000:g})"
