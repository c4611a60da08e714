"""Planted bugs are found by running the simulator: each by the rule that it is for, or by the plant's oracle as told.

A run ends with the first finding of that rule, so that it takes no longer than it must.
"""

import asyncio
from functools import cache

import pytest

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.options import RunOptions
from bus_sim.run import FLEET, run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.planted.registry import BUGS
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.systems.car_park.checks import RULES
from onboard.trace.check import holds
from onboard.trace.check.checks import Checks, LogVerdict
from tests.sites import one_floor
from tests.system.scene import ORIGIN_US, stays

#: Runs end here, s of simulated time: an hour's patience with a customer, and a little more.
LIMIT_S = 5_000
#: Bugs that show where two robots share an alley; all others show on the small site.
ON_ONE_ALLEY = {
    "never-given",
    "steward-for-ever",
    "keeps-what-it-gives",
    "all-is-mine",
    "drives-through",
    "segments-kept",
}


#: A held machine is forgotten after so long here, us: the rule's own hour is in ``tests/conformance/test_rules.py``.
FORGOTTEN_US = 300_000_000


@pytest.fixture(autouse=True)
def _soon_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(holds, "FORGOTTEN_US", FORGOTTEN_US)


@cache
def site_for(bug: str) -> Site:
    """Where a bug is looked for."""
    return one_floor(2) if bug in ON_ONE_ALLEY else find_site("small")


def hunt(site: Site, bug: str, rule: str, limit_s: int = LIMIT_S) -> tuple[LogVerdict, Simulation]:
    """Run three cars in and out until the rule, or without one the oracle, finds something, or to the limit."""
    loop = VirtualTimeLoop()
    try:
        return loop.run_until_complete(_hunt(site, bug, rule, limit_s, loop))
    finally:
        loop.close()


async def _hunt(site: Site, bug: str, rule: str, limit_s: int, loop: VirtualTimeLoop) -> tuple[LogVerdict, Simulation]:
    simulation = build(site, RunOptions(), loop)
    checks = Checks(site)

    def listen(channel: str) -> None:
        medium = simulation.fleet if channel == FLEET else simulation.devices[site.machine(channel).node_id]

        def on_frame(frame: Frame, time_us: int, _: str) -> None:
            checks.feed(time_us, channel, frame)

        medium.tap(on_frame, errors=ErrorsHeard.NONE)

    for channel in (FLEET, *(machine.name for machine in site.machines.values())):
        listen(channel)
    simulation.plant.street.add_all(stays(*[(40.0 * number, 500.0 + 60.0 * number) for number in range(3)]), ORIGIN_US)
    if bug:
        BUGS[bug].plant(simulation)
    simulation.start()
    oracle, street = simulation.plant.oracle, simulation.plant.street

    def over() -> bool:
        found = checks.verdict.counts[rule] > 0 if rule else bool(oracle.violations)
        return found or (not bug and street.is_over)

    await run_until(simulation, over, limit_s * 1_000_000, 1_000_000)
    await asyncio.sleep(0)
    return checks.finish(), simulation


@pytest.mark.parametrize("name", BUGS)
def test_a_planted_bug_is_found_by_its_rule(name: str) -> None:
    bug = BUGS[name]
    verdict, _ = hunt(site_for(name), name, bug.finds)
    assert verdict.counts[bug.finds], f"{bug.what}: not found\n" + "\n".join(verdict.lines())


def test_without_a_bug_nothing_is_found() -> None:
    for site in (one_floor(2), find_site("small")):
        verdict, simulation = hunt(site, "", "any")
        assert verdict.is_good, "\n".join(verdict.lines())
        assert simulation.plant.oracle.finish() == []


def test_every_rule_has_two_planted_bugs() -> None:
    finds = [bug.finds for bug in BUGS.values()]
    assert {rule.name: finds.count(rule.name) for rule in RULES if finds.count(rule.name) < 2} == {}
    assert set(finds) <= {rule.name for rule in RULES}


@pytest.mark.parametrize("name", ["drives-through", "no-light-curtain", "no-door-interlock"])
def test_the_oracle_in_the_plant_finds_what_really_happens(name: str) -> None:
    _, simulation = hunt(site_for(name), name, "", limit_s=600)
    assert simulation.plant.oracle.finish()
