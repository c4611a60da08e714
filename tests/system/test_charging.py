"""A driver who asks for a place to charge, from the page's button to the place where the car stands."""

import asyncio

import pytest

from bus_sim.options import RunOptions
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from bus_sim.systems.car_park.page import CarParkSource
from bus_sim.systems.registry import simulated_of
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.systems.car_park.site import car_park
from onboard.web.app import CommandError


def source_of(name: str, loop: VirtualTimeLoop) -> CarParkSource:
    site = find_site(name)
    stage = simulated_of(site).stage(site, RunOptions(demand=ParkingDay(by_hand=True)), loop)
    stage.run.start()
    source = stage.source()
    assert isinstance(source, CarParkSource)
    return source


def test_a_car_that_comes_to_charge_by_the_page_stands_where_one_can() -> None:
    async def play(loop: VirtualTimeLoop) -> set[int]:
        source = source_of("sizes", loop)
        await asyncio.sleep(5)
        await source.command("car_in_charging", {})
        await asyncio.sleep(300)
        return {int(station) for station in source.snapshot()["cars"]}

    loop = VirtualTimeLoop()
    (place,) = run_on(loop, play(loop))
    site = car_park(find_site("sizes"))
    assert site.classes[site.place_class[place] - 1].charging


def test_a_site_without_places_to_charge_offers_none() -> None:
    async def play(loop: VirtualTimeLoop) -> None:
        source = source_of("level1", loop)
        assert "car_in_charging" not in source.acts
        with pytest.raises(CommandError):
            await source.command("car_in_charging", {})

    loop = VirtualTimeLoop()
    run_on(loop, play(loop))
