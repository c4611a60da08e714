"""The pick-up and delivery on the page and over time: what is drawn is what machines and bodies say."""

from bus_sim.sites import find_site
from onboard.contract.mapd import StepState
from onboard.systems.mapd.diagram import MapdDiagram
from onboard.systems.mapd.site import Mapd
from tests.web.logs import file_of, film_of, said_in
from tests.web.pictures import last, moments, points_of, watched


def test_robots_of_a_floor_are_in_the_columns_and_rows_of_their_cells() -> None:
    site = find_site(str(file_of("mapd")))
    assert isinstance(site, Mapd)
    diagram, wide = watched(MapdDiagram(site, None, None), "mapd"), len(site.rows[0])
    for time_us, is_fleet, one in said_in("mapd"):
        if is_fleet and isinstance(one, StepState):
            assert (time_us, one.cell % wide) in points_of(diagram, one.sender)
            assert (time_us, one.cell // wide) in points_of(diagram, one.sender, panel=1)


def test_robots_of_a_floor_are_in_the_cells_that_they_tell_and_what_they_serve_is_done() -> None:
    said = said_in("mapd")
    with film_of("mapd", fleet_only=True) as film:
        layout = film.show(film.first_us).layout()
        names = {one["name"]: one["points"] for one in layout["plan"]["shapes"]}
        assert len(names) == 42, "cells of the map that are free"
        for time_us, snapshot in moments(film, 1_000_000):
            for node in (11, 12, 13, 14):
                state, told = last(said, StepState, node, time_us), snapshot["machines"][node]
                if state is None:
                    continue
                row, column = divmod(state.cell, 10)
                assert told["where"] == f"{row},{column}, step {state.step}"
                assert told["car"] == (str(state.task) if state.loaded else None)
                owners = [one["owner"] for one in snapshot["tasks"] if one["owner"]]
                assert len(owners) == len(set(owners)), "a robot has one task at a time"
                ((x0, y0), (x1, y1)) = names[f"{row},{column}"]
                assert x0 < told["path"][-1][0] < x1 and y0 < told["path"][-1][1] < y1
        end = film.show(film.last_us).snapshot()
    assert end["figures"]["done"] == sum(isinstance(one, StepState) and one.served for _, _, one in said) == 8
    assert end["tasks"] == [] and end["things"] == []
