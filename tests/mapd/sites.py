"""Small pick-up and delivery sites made for tests."""

import random
from typing import Any

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.systems.mapd.plant import UnitPlant
from bus_sim.systems.stage import SystemStage
from onboard.config.site import parse_site
from onboard.systems.mapd.site import Mapd

#: A small warehouse: homes in the left and right columns, shelves between, endpoints beside them.
ROWS = (
    "r........r",
    "..e@@e@@..",
    "r........r",
    "..e@@e@@..",
    "r........r",
)
HOMES = ("0,0", "0,9", "2,0", "2,9", "4,0", "4,9")
ENDPOINTS = ("1,2", "1,5", "3,2", "3,5", "2,4", "0,6")


def site_text(robots: int, tasks: list[tuple[int, str, str]], step_ms: int = 1000) -> str:
    """A site file: robots R1, R2, ... have node-IDs from 11 on, the desk 1."""
    text = f'[site]\nsystem = "mapd"\nname = "made"\n\n[steps]\nstep_ms = {step_ms}\n\n[map]\nrows = {list(ROWS)}\n\n'
    text += '[[desks]]\nname = "Desk"\nnode = 1\n\n'
    for number, home in enumerate(HOMES[:robots], start=1):
        text += f'[[robots]]\nname = "R{number}"\nnode = {10 + number}\nhome = "{home}"\n\n'
    lines = ", ".join(f'[{release}, "{start}", "{end}"]' for release, start, end in tasks)
    return f"{text}[demand]\nendpoints = {list(ENDPOINTS)}\ntasks = [{lines}]\n".replace("'", '"')


def drawn(count: int, seed: int, every: int = 1) -> list[tuple[int, str, str]]:
    """Tasks between endpoints, drawn."""
    chance = random.Random(f"mapd:{seed}")
    ways = [chance.sample(ENDPOINTS, 2) for _ in range(count)]
    return [(number * every, start, end) for number, (start, end) in enumerate(ways)]


def made(robots: int, tasks: list[tuple[int, str, str]]) -> Mapd:
    """The site of such a file."""
    site = parse_site(site_text(robots, tasks), "made.toml")
    assert isinstance(site, Mapd)
    return site


def played(site: Mapd, **options: object) -> tuple[SystemStage[Any], UnitPlant]:
    """A run to its end, quiet and judged, and its plant."""
    run = play(site, RunOptions(quiet=True, **options))  # type: ignore[arg-type]  # options by name
    assert isinstance(run.plant, UnitPlant)
    return run, run.plant
