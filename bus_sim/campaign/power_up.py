"""All machines of a site start at one moment: what they say, how full the bus is, and when everybody takes part.

A machine takes part once its state says so and its rights are its own: all that live have answered it.
"""

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bus_sim.campaign.recovery import ADMITTED
from bus_sim.campaign.trial import stage_of
from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.faults.arm import arm
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.sites import site_text
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.config.site import parse_site
from onboard.controller.shell import Controller
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.wire.codec import fleet_codec

#: Looked at for so long, us; between two looks, us.
SPAN_US = 20_000_000
LOOK_US = 20_000
#: Machines of the shipped site ``large``, and of each floor above the street how many more robots can be added there.
LARGE = 18
_FLOORS = 9
_MORE_ON_FLOOR = 10


@dataclass(frozen=True)
class PowerUp:
    """One start: frames of the fleet bus by message, its worst second, and when the last machine takes part, s.

    ``parts_s`` is by node-ID, and lacks who does not take part within the time.
    """

    frames: Counter[str]
    worst_second: float
    parts_s: dict[int, float]
    mirrors: int

    @property
    def longest_s(self) -> float:
        """When the last of those who take part does."""
        return max(self.parts_s.values(), default=0.0)


def large_with(machines: int, bitrate: int = 500_000, seals: str = "off") -> Site:
    """The site ``large`` with so many machines, 18 to 108: the more are robots, more than find refuges at work."""
    if not LARGE <= machines <= LARGE + _FLOORS * _MORE_ON_FLOOR:
        raise ValueError(f"{machines} machines: {LARGE} to {LARGE + _FLOORS * _MORE_ON_FLOOR} can start together here")
    more = (
        f'\n[[robots]]\nname = "MR{number + 13}"\nnode = {number + 23}\n'
        f'home = "p({2 + number % _FLOORS},{10 + 2 * (number // _FLOORS)})"\n'
        for number in range(machines - LARGE)
    )
    text = site_text("large").replace("bitrate = 500_000", f'bitrate = {bitrate}\nseals = "{seals}"')
    return parse_site(text + "".join(more), "large.toml", crowded=True)


def power_up(
    site: Site, loss: float = 0.0, seed: int = 1, within_us: int = 0, before: Callable[[Any], object] = id
) -> PowerUp:
    """Start all; each receiver misses each frame with the probability ``loss``, drawn from ``seed``.

    Computers boot within ``within_us``, drawn from ``seed`` too. ``before`` is given the run before it is switched on.
    """
    loop = VirtualTimeLoop()
    return run_on(loop, _power_up(site, loss, seed, within_us, before, loop))


async def _power_up(
    site: Site, loss: float, seed: int, within_us: int, before: Callable[[Any], object], loop: VirtualTimeLoop
) -> PowerUp:
    faults = (InjectedFault(FaultKind.OMISSION, probability=loss, seed=seed),) if loss else ()
    nobody = simulated_of(site).on(Occasion.BUSY, site)
    stage = stage_of(site, FaultScenario(site.name, seed, SPAN_US / 1e6, nobody, faults), loop)
    run, frames, parts_s = stage.run, Counter[str](), dict[int, float]()

    def on_fleet(frame: Frame, _time_us: int, _sender: str) -> None:
        frames[fleet_codec().name_of(frame) or "?"] += 1

    def all_take_part() -> bool:
        for node, controller in run.controllers.items():
            if node not in parts_s and _takes_part(controller):
                parts_s[node] = loop.now_us() / 1e6
        return False

    arm(run, faults)
    run.fleet.tap(on_fleet)
    before(run)
    chance = random.Random(f"boots:{seed}")
    run.start((lambda: chance.randrange(within_us)) if within_us else None)
    await run_until(run, all_take_part, SPAN_US + within_us, LOOK_US)
    run.close()
    mirrors = len({one.holon.mirror.digest() for one in run.controllers.values()})
    return PowerUp(frames, run.fleet.statistics().worst_second_load, parts_s, mirrors)


def _takes_part(controller: Controller) -> bool:
    holon = controller.holon
    return holon.part.begins and holon.behaviour.state in ADMITTED and holon.tokens.is_synced
