"""A pick-up and delivery site in a terminal: the map with its robots, or one line a robot where there is no map."""

from bus_sim.systems.mapd.plant import UnitPlant
from onboard.systems.mapd.fields import NO_TASK

_MARKS = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"


def picture(plant: UnitPlant) -> str:
    """Loaded robots are letters and numbers, by node-ID; empty ones ``*``; goods that wait ``+``."""
    site = plant.site
    done = sum(one.served_step is not None for one in plant.goods.values())
    last = f"{plant.timers.now_us() / 1e6:8.1f} s  {done} of {len(site.tasks)} served"
    if not site.rows:
        lines = [
            f"{body.machine.name:12} {site.floor.names[body.cell]:24} {_load(body.task)}"
            for body in plant.bodies.values()
        ]
        return "\n".join([*lines, last])
    rows = [["#" if mark in "@TO#W" else " " for mark in row] for row in site.rows]
    width = len(site.rows[0])
    for goods in plant.goods.values():
        if not goods.aboard:
            rows[goods.task.pickup // width][goods.task.pickup % width] = "+"
    for number, body in enumerate(plant.bodies.values()):
        mark = "*" if body.task == NO_TASK else _MARKS[number % len(_MARKS)]
        rows[body.cell // width][body.cell % width] = mark
    return "\n".join(["".join(row) for row in rows] + [last])


def _load(task: int) -> str:
    return "" if task == NO_TASK else f"carries task {task}"
