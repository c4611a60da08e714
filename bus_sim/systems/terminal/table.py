"""The plan table as in Fig. 3 of Le Page and Barras, and the picture of a terminal: both from the bus alone."""

from onboard.contract.terminal import Action
from onboard.systems.terminal.dates import StepDate
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.plan import NO_STEP, Load
from onboard.systems.terminal.site import Entity, EntityKind, Terminal
from onboard.systems.terminal.traffic import Traffic

_WORDS = {Action.GOTO: "GOTO", Action.DOCK: "DOCK", Action.UNDOCK: "UNDOCK"}
_LOADS = {Action.PICK_UP: "PICK UP", Action.PUT_DOWN: "PUTDOWN"}
#: Width of a line of the picture.
_WIDTH = 100


def plan_table(site: Terminal, traffic: Traffic, owner: int, now: int, tick: int = 1_000_000) -> list[str]:
    """What is left of a machine's plan: task, action, where, whereto, [st et] in whole ticks (us, 1 s by default)."""
    owned = traffic.plans.get(owner)
    if owned is None:
        return []
    dates, steps = traffic.dates(now).at, owned.plan.steps
    lines, task = [], ""
    for number in range(owned.current, len(steps)):
        step = steps[number]
        load = next((one for one in owned.plan.loads if number <= one.put or number == len(steps) - 1), None)
        name = "" if load is None else site.boxes[load.box - 1].name
        now_task = _task(owned.plan.loads, number)
        words = f"{_WORDS[step.action]} {site.entities[step.entity].name}" if step.action in _WORDS else ""
        if step.action in _LOADS:
            words = f"{_LOADS[step.action]} Box {name}"
        whereto = site.entities[steps[number + 1].entity].name if step.action is Action.GOTO else ""
        begin, end = dates[StepDate(owner, number)] // tick, dates[StepDate(owner, number + 1)] // tick
        shown = now_task if now_task != task else ""
        task = now_task
        lines.append(f"{shown:<15}{words:<20}{whereto:<12}[{begin} {end}]")
    return lines


def _task(loads: tuple[Load, ...], number: int) -> str:
    """A step belongs to the next handling that it leads to, or undocks from."""
    ends = [(load.pick + 1, "Loading Task") for load in loads if load.pick < NO_STEP]
    ends += [(load.put + 1, "Unloading Task") for load in loads]
    return min((end for end in ends if end[0] >= number), default=(0, "Unloading Task"))[1]


def picture(site: Terminal, mirror: TerminalMirror, now_us: int) -> list[str]:
    """Entities with the robots that are there by their reports, boxes at stations, and when each plan ends."""
    inside: dict[int, list[str]] = {}
    for node in site.vehicles:
        owned = mirror.traffic.plans.get(node)
        at = mirror.where[node] if owned is None else owned.plan.steps[owned.current].entity
        load = next((one for one in owned.plan.loads if one.pick < owned.current <= one.put), None) if owned else None
        name = site.machines[node].name + (f"[{site.boxes[load.box - 1].name}]" if load is not None else "")
        inside.setdefault(at, []).append(name)
    lines = []
    for kind in EntityKind:
        cells = [_cell(site, mirror, one, inside) for one in site.entities.values() if one.kind is kind]
        lines += _wrapped(f"{kind.value + 's':<10}", cells)
    for node in site.vehicles:
        lines.append(_line(site, mirror, node, now_us))
    return lines


def _cell(site: Terminal, mirror: TerminalMirror, entity: Entity, inside: dict[int, list[str]]) -> str:
    words = " ".join(inside.get(entity.number, []))
    if entity.kind is EntityKind.STATION:
        boxes = " ".join(site.boxes[box - 1].name for box in mirror.standing.get(entity.number, []))
        words = f"{boxes or '-'}{' <- ' + words if words else ''}"
    blocked = " BLOCKED" if entity.number in mirror.traffic.blocked else ""
    return f"{entity.name}: {words or '.'}{blocked}"


def _wrapped(head: str, cells: list[str]) -> list[str]:
    lines, line = [], head
    for cell in cells:
        if len(line) + len(cell) > _WIDTH:
            lines.append(line.rstrip())
            line = " " * len(head)
        line += f"{cell}   "
    return [*lines, line.rstrip()]


def _line(site: Terminal, mirror: TerminalMirror, node: int, now_us: int) -> str:
    owned = mirror.traffic.plans.get(node)
    name = site.machines[node].name
    if owned is None:
        return f"{name:<6}idle in {site.entities[mirror.where[node]].name}"
    step = owned.plan.steps[owned.current]
    end_s = mirror.traffic.end_of(node, now_us) / 1e6
    where = site.entities[step.entity].name
    left = len(owned.plan.steps) - owned.current
    return f"{name:<6}{step.action.name.replace('_', ' ')} {where}, {left} actions left, ends at {end_s:.0f} s"
