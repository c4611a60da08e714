"""The network of Fig. 3 as a site that is played, and what somebody who only listens knows of its plans."""

from collections.abc import Sequence
from functools import cache

from bus_sim.options import RunOptions
from bus_sim.systems.terminal.playing import play
from onboard.config.site import parse_site
from onboard.contract.terminal import PlanHead, PlanStep, StepReport, StepResult
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import terminal
from onboard.ways.cars import CarMirror
from tests.cut import Timed

SECOND = 1_000_000
ROBOTS = (11, 12, 13)


@cache
def site(capacity: int, more: str, kind: str = "stacker", near: str = "A1", crossing: int = 0) -> Terminal:
    """Lanes for so many robots, three robots in area 1, R1 in ``near``, three desks; durations as printed.

    The crossing holds as many as a lane; ``crossing`` 1 leaves that to the site file's default.
    """
    holds = "" if crossing else f"capacity = {capacity}"
    lanes = [("L3", 50, "C1"), ("L2", 60, "A4"), ("L11", 100, "C1"), ("L4", 50, "A1")]
    told = ", ".join(
        f'{{name = "{name}", length_mm = {metres}_000, capacity = {capacity}, leads_to = ["{to}"]}}'
        for name, metres, to in lanes
    )
    text = f"""
    site = {{name = "fig3", system = "terminal"}}
    planning = {{begins = "16:00"}}
    desks = [{{name = "D1", node = 1}}, {{name = "D2", node = 2}}, {{name = "D3", node = 3}}]
    vehicles = [
        {{name = "R1", node = 11, home = "{near}"}},
        {{name = "R2", node = 12, home = "A1"}},
        {{name = "R3", node = 13, home = "A1"}},
    ]
    lanes = [{told}]
    stations = [
        {{name = "S2", area = "A4", room = 20, kind = "{kind}"}},
        {{name = "S1", area = "A2", room = 20, kind = "stacker"}},
    ]
    boxes = [{{station = "S2", type = "T1", names = ["B1", "B2", "B3", "B4"]}}]

    [[areas]]
    name = "A1"
    duration_ms = 30_000
    leads_to = ["L3"]
    [[areas]]
    name = "A2"
    duration_ms = 6_000
    leads_to = ["C1"]
    [[areas]]
    name = "A4"
    duration_ms = 10_000
    leads_to = ["L11"]

    [[crossings]]
    name = "C1"
    duration_ms = 5_000
    {holds}
    leads_to = ["L2", "A2", "L4"]
    [[crossings.turns]]
    from = "L11"
    to = "A2"
    duration_ms = 6_000
    """
    return terminal(parse_site(text + more, "fig3.toml"))


def missions(*boxes: str, at_s: int = 5, before: str = "") -> str:
    """Each box to S1, each from a desk of its own in turn."""
    found = ""
    for number, box in enumerate(boxes):
        found += f'\n[[missions]]\nat_s = {at_s}\ndesk = "D{number % 3 + 1}"\ntranship = ["{box}"]\nto = "S1"\n'
        found += f'before = "{before}"\n' if before else ""
    return found


def held(vehicle: str, after_s: float, for_s: float) -> str:
    """A person holds a vehicle for a while."""
    keys = [(after_s, "hold"), (after_s + for_s, "release")]
    return "".join(f'\n[[manual]]\nat_s = {at_s}\nvehicle = "{vehicle}"\ndo = "{do}"\n' for at_s, do in keys)


@cache
def said(
    capacity: int, more: str, kind: str = "stacker", until_s: int = 900, near: str = "A1", crossing: int = 0
) -> tuple[Timed, ...]:
    """All that is said until every box is put down, or a time; drives and handlers take exactly their times."""
    found: list[Timed] = []
    outcome = play(
        site(capacity, more, kind, near, crossing),
        RunOptions(seed=1, quiet=True),
        limit_us=until_s * SECOND,
        noise=0,
        prepare=lambda run: run.observers.append(lambda message, at_us: found.append((at_us, message))),
    )
    assert not outcome.halted and not outcome.violations and (outcome.is_good or until_s < 900)
    return tuple(found)


def listener(where: Terminal, heard: Sequence[Timed], until_us: int) -> TerminalMirror:
    """What who only listens knows at a time."""
    mirror = TerminalMirror(where, 1, CarMirror(where, 1))
    for at_us, message in heard:
        if at_us <= until_us:
            mirror.hear(message, at_us)
    return mirror


Key = tuple[int, int, int]


def ended_ms(heard: Sequence[Timed]) -> dict[Key, int]:
    """When each step of each plan (robot, version, step) was over, by the robot's own word."""
    found: dict[Key, int] = {}
    for _, one in heard:
        if isinstance(one, StepReport) and one.result is StepResult.DONE:
            found.setdefault((one.sender, one.version, one.step), one.at_ms)
    return found


def steps(heard: Sequence[Timed], robot: int, version: int) -> list[PlanStep]:
    """The steps of one plan as they travelled."""
    return [m for _, m in heard if isinstance(m, PlanStep) and (m.sender, m.version) == (robot, version)]


def head(heard: Sequence[Timed], robot: int, version: int = 1) -> PlanHead:
    """The head of one plan; raises ``AssertionError`` where it did not travel."""
    found = [m for _, m in heard if isinstance(m, PlanHead) and (m.sender, m.version) == (robot, version)]
    assert found, f"no plan {version} of {robot}"
    return found[0]
