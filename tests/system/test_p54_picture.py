"""The picture of the site is fed by the bus alone (row P54): drawn from a log, it is the one drawn while it ran."""

import asyncio
import io
from datetime import UTC, datetime
from pathlib import Path

import pytest
from rich.console import Console

from bus_sim.options import RunOptions
from bus_sim.run import FLEET, run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.plant.bodies import Aboard
from bus_sim.systems.car_park.show import DayClock, draw
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import KindCode, MachineState
from onboard.core.site import Station
from onboard.systems.car_park.site import car_park
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.view import SiteView
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.system.scene import ORIGIN_US, stays

SITE = car_park(find_site("small"))
EPOCH_US = 1_563_926_400_000_000
#: Pictures are compared at these times, s: a car is driven in, one is fetched, all stands still.
LOOKS_S = (40, 90, 160, 300, 640, 1_100)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulation, list[str], Path]:
    """Two cars stay, one goes again: the simulation, its pictures and its log."""
    log = tmp_path_factory.mktemp("picture") / "fleet.log"
    loop = VirtualTimeLoop()
    pictures: list[str] = []

    async def play() -> Simulation:
        simulation = build(SITE, RunOptions(epoch_us=EPOCH_US, trace=log), loop)
        simulation.plant.street.add_all(stays((0, None), (45, 600), (90, None)), ORIGIN_US)
        simulation.start()
        for look_s in LOOKS_S:
            await run_until(simulation, lambda: False, look_s * 1_000_000, 1_000_000)
            pictures.append(picture(simulation.view))
        await asyncio.sleep(0)
        simulation.close()
        return simulation

    try:
        return loop.run_until_complete(play()), pictures, log
    finally:
        loop.close()


def picture(view: SiteView) -> str:
    console = Console(width=110, file=io.StringIO())
    with console.capture() as printed:
        console.print(draw(SITE, view, DayClock(datetime.fromtimestamp(EPOCH_US / 1e6, UTC)), ""))
    return printed.get()


def read_again(log: Path) -> list[str]:
    """The pictures of the same moments by somebody who has the log, the site file and the DBC, and nothing else."""
    view, decoder, pictures = SiteView(SITE), Decoder(fleet_codec()), []
    looks_us = [look_s * 1_000_000 for look_s in LOOKS_S]
    with log.open("rb") as lines:
        for record in CandumpReader(lines):
            assert record.channel == FLEET
            time_us = record.time_us - EPOCH_US
            while looks_us and time_us > looks_us[0]:
                pictures.append(picture(view))
                looks_us.pop(0)
            message = decoder.feed(record.frame, time_us)
            if message is not None:
                view.feed(message, time_us)
    return pictures + [picture(view)] * len(looks_us)


def test_p54_the_pictures_drawn_from_the_log_are_those_of_the_run(run: tuple[Simulation, list[str], Path]) -> None:
    _, pictures, log = run
    assert len(set(pictures)) == len(LOOKS_S), "something happens between any two of them"
    assert read_again(log) == pictures


def test_p54_the_picture_shows_the_plant_as_it_is(run: tuple[Simulation, list[str], Path]) -> None:
    simulation, pictures, _ = run
    world, view = simulation.plant.world, simulation.view
    standing = {where.number for where in world.where.values() if isinstance(where, Station)}
    assert set(view.history.loads.standing()) == standing and len(standing) == 2
    assert not any(isinstance(where, Aboard) for where in world.where.values())
    for node, machine in SITE.machines.items():
        if machine.kind is KindCode.ROBOT:
            place = view.history.places.by_node[node]
            body = world.robots[node]
            assert place.segment == world.standing_position(node)
            assert place.offset_mm == 0 and body.track == place.segment.track
            assert place.passed >= abs(place.segment.index - machine.home.index), (
                "segments left behind since it was there"
            )
        if machine.kind is KindCode.LIFT:
            index = view.history.places.by_node[node].segment.index
            assert SITE.tracks[machine.home.track].joins[index - 1].track == world.platform_floor(node)
    assert max(place.passed for place in view.history.places.by_node.values()) > 10
    last = pictures[-1]
    for car in view.history.loads.stations:
        assert f"|{car.number:^3}|" in last
    assert last.count("MR1") >= 2 and "idle" in last


@pytest.mark.parametrize("name", ["level1", "small", "standard", "large"])
@pytest.mark.parametrize("size", [(80, 24), (80, 40), (120, 40), (60, 12), (40, 7)])
def test_p54_the_picture_fits_the_terminal_with_the_newest_event_the_figures_and_the_address(
    name: str, size: tuple[int, int]
) -> None:
    site, (width, height) = car_park(find_site(name)), size
    view = SiteView(site)
    view.history.lives.states = dict.fromkeys(site.machines, MachineState.STARTING)
    for number in range(40):
        view.say(number * 1_000_000, f"event {number}")
    console = Console(width=width, height=height, file=io.StringIO())
    with console.capture() as printed:
        clock = DayClock(datetime.fromtimestamp(EPOCH_US / 1e6, UTC))
        console.print(draw(site, view, clock, "cars in 31", width, height, "http://127.0.0.1:41234/"))
    lines = printed.get().splitlines()
    assert len(lines) == height, "no line too many, and what is there is used"
    assert lines[-3].endswith("event 39") and lines[-2] == "cars in 31"
    assert lines[-1] == "picture at http://127.0.0.1:41234/"
    shown = sum(" event " in line for line in lines)
    assert shown >= (3 if height >= 24 else 1)


def test_p54_what_is_not_on_the_bus_is_not_in_the_picture(run: tuple[Simulation, list[str], Path]) -> None:
    """A bus on which one robot is not heard shows that robot where it was at first."""
    _, pictures, log = run
    kept = log.with_name("without.log")
    kept.write_bytes(b"".join(line for line in log.read_bytes().splitlines(keepends=True) if b"0B#" not in line))
    again = read_again(kept)
    assert again != pictures
    assert "MR1 idle" in pictures[-1] and "MR1 idle" not in again[-1]
