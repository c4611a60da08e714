"""A short day at the terminal, and what a seed brings upon it."""

import random
from functools import partial

from bus_sim.faults.arm import frame_faults
from bus_sim.faults.injection import Injection
from bus_sim.run import RunOptions
from bus_sim.sites import site_text
from bus_sim.systems.terminal.run import Outcome, TerminalRun, play
from onboard.config.site import parse_site
from onboard.kinds.terminal.site import Terminal
from onboard.kinds.terminal.vehicle import terminal

#: "Load S10 with 2 of T1 from A4", "tranship B11 and B12 to S4", and a blocked lane.
SHORT = """
[[missions]]
at_s = 5
load = 2
type = "T1"
from = "A4"
to = "S1"

[[missions]]
at_s = 15
desk = "Quay"
tranship = ["B11", "B12"]
to = "S4"

[[blockages]]
lane = "L11"
at_s = 45
for_s = 60
"""


def short(missions: str = SHORT) -> Terminal:
    """The shipped network with other missions."""
    text = site_text("terminal")
    return terminal(parse_site(text[: text.index('# "Load station')] + missions, "short.toml"))


def faults_of(seed: int) -> list[Injection]:
    """Frames that get lost, late or broken on the fleet bus for up to a minute; the kind goes by the seed."""
    chance = random.Random(f"terminal:{seed}")
    at_s = round(chance.uniform(4, 60), 3)
    names = ["Desk", "Quay", "R1", "R2", "R3", "R4"]
    some = "|".join(sorted(chance.sample(names, chance.randint(1, 4))))
    number = chance.randrange(1_000_000)
    kinds = [
        Injection("lossy", {"at_s": at_s, "for_s": 60.0, "receivers": some, "probability": 0.1, "seed": number}),
        Injection("bit_errors", {"at_s": at_s, "for_s": 60.0, "probability": 0.05, "seed": number}),
        Injection("reorder", {"at_s": at_s, "for_s": 60.0, "receivers": some, "delay_ms": 20, "seed": number}),
        Injection("partition", {"at_s": at_s, "for_s": 5.0, "members": some, "way": "both"}),
    ]
    return [kinds[seed % len(kinds)]]


def crash_of(seed: int) -> tuple[str, float, float]:
    """Whose power is cut, when, and for how long."""
    chance = random.Random(f"crash:{seed}")
    name = chance.choice(["Desk", "Quay", "R1", "R2", "R3", "R4"])
    return name, round(chance.uniform(16, 80), 3), round(chance.uniform(0.5, 10), 3)


def crash(run: TerminalRun, name: str, at_s: float, for_s: float) -> None:
    """Cut one controller's power for a time."""
    machine = run.site.machine(name)
    run.plant.timers.call_at(round(at_s * 1e6), partial(run.crash, machine))
    run.plant.timers.call_at(round((at_s + for_s) * 1e6), partial(run.start_controller, machine))


def prepare(run: TerminalRun, seed: int) -> None:
    """Device buses have a second node, so that frames are acknowledged while the controller is off."""
    for medium in run.devices.values():
        medium.attach("terminal block", None)
    crash(run, *crash_of(seed))


def play_seed(seed: int, *, crashes: bool = True, limit_s: int = 900) -> Outcome:
    """One seed's day."""
    site = short()
    options = RunOptions(seed=seed, faults=frame_faults(faults_of(seed), site))
    prepared = partial(prepare, seed=seed) if crashes else None
    return play(site, options, limit_us=limit_s * 1_000_000, prepare=prepared)
