"""Plans of the systems that are no car park: what is drawn from the fleet bus is what the bodies themselves say."""

import json
from collections.abc import Iterator
from itertools import pairwise
from statistics import median
from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.contract.cell import PartAt
from onboard.contract.cell_device import ArmState
from onboard.contract.codes import TaskPhase
from onboard.contract.graph import BodyPlace
from onboard.contract.graph_device import BodyState
from onboard.contract.mapd import StepState
from onboard.contract.messages import Message, TaskReport
from onboard.contract.terminal_device import MoveState
from onboard.contract.turning_device import NcState
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.scene.arrange import arrange
from onboard.trace.scene.scene import along, part, spot_on
from onboard.web.film import Film
from tests.web.logs import film_of, said_in

Snapshot = dict[str, Any]


def moments(film: Film, step_us: int) -> Iterator[tuple[int, Snapshot]]:
    """Snapshots of a whole film, one each ``step_us``."""
    for time_us in range(film.first_us, film.last_us, step_us):
        yield time_us, film.show(time_us).snapshot()


def last(said: list[tuple[int, bool, Message]], kind: type[Message], sender: int, time_us: int) -> Any:
    """The last message of a kind that a sender had said by then, None before the first."""
    return next(
        (one for at_us, _, one in reversed(said) if at_us <= time_us and type(one) is kind and one.sender == sender),
        None,
    )


def at(path: list[list[float]], time_us: int) -> tuple[float, float]:
    """Where the page draws a machine: the arithmetic of plan.js."""
    for (x0, y0, begin), (x1, y1, end) in pairwise(path):
        if time_us < end:
            share = max(0.0, min(1.0, (time_us - begin) / max(1, end - begin)))
            return x0 + (x1 - x0) * share, y0 + (y1 - y0) * share
    return path[-1][0], path[-1][1]


def test_vehicles_of_a_terminal_are_where_their_drives_say() -> None:
    """Their plans and reports alone tell it, but for the moment between a movement and its report."""
    site, said, right, wrong = find_site("terminal"), said_in("terminal"), 0, 0
    assert isinstance(site, Terminal)
    with film_of("terminal", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 5_000_000):
            for node in site.vehicles:
                state = last(said, MoveState, node, time_us)
                if state is None:
                    continue
                shown = site.by_name[snapshot["machines"][node]["where"].partition(",")[0]]
                there = site.entities[state.entity]
                # A drive knows areas, not the stations in them.
                is_right = there.number in (shown.number, shown.area)
                right, wrong = right + is_right, wrong + (not is_right)
    assert right > 100 and wrong <= right // 100


def test_boxes_of_a_terminal_end_where_its_missions_want_them() -> None:
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    with film_of("terminal", fleet_only=True) as film:
        first, end = film.show(film.first_us).snapshot(), film.show(film.last_us).snapshot()
    names = {str(one.number): one.name for one in site.entities.values() if one.kind is EntityKind.STATION}

    def counts(snapshot: Snapshot) -> dict[str, int]:
        return {name: snapshot["marks"][number]["count"] for number, name in names.items()}

    assert counts(first) == {"S2": 4, "S3": 3, "S5": 4, "S1": 0, "S4": 0, "S10": 0}
    stands = counts(end)
    # Four of type T1 to S10, B11 to B13 to S4, B14 to S1 (bus_sim/sites/terminal.toml).
    assert (stands["S10"], stands["S4"], stands["S1"], stands["S5"]) == (4, 3, 1, 0)
    assert end["figures"]["done"] == 8 and end["tasks"] == []


def test_a_blocked_lane_is_marked_as_long_as_its_desk_says_so() -> None:
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    (blockage,) = site.blockages
    with film_of("terminal", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 10_000_000):
            marked = str(blockage.lane) in snapshot["marks"]
            if min(abs(time_us - blockage.at_us), abs(time_us - blockage.until_us)) > 1_000_000:
                assert marked is (blockage.at_us < time_us < blockage.until_us)


def test_robots_of_a_graph_are_where_their_bodies_say_and_alone_on_their_edges() -> None:
    said = said_in("graph")
    with film_of("graph", fleet_only=True) as film:
        layout = film.show(film.first_us).layout()
        spots = {one["name"]: one["points"][0] for one in layout["plan"]["shapes"] if one["kind"] == "node"}
        for time_us, snapshot in moments(film, 2_000_000):
            held = [edge for one in snapshot["machines"].values() for edge, _ in one.get("held", [])]
            assert len(held) == len(set(held)), "an edge is one robot's"
            for node in (11, 12, 13):
                body, told = last(said, BodyState, node, time_us), snapshot["machines"][node]
                if body is None:
                    continue
                x, y = at(told["path"], time_us)
                if body.body_place is BodyPlace.IN_NODE:
                    assert told["where"].startswith(f"N{body.node}")
                    assert abs(x - spots[f"N{body.node}"][0]) <= 40 and y == spots[f"N{body.node}"][1]
                else:
                    assert told["where"].startswith(f"N{body.behind} to N{body.node}")
                    low, high = sorted((spots[f"N{body.behind}"][0], spots[f"N{body.node}"][0]))
                    assert low <= x <= high


def test_robots_of_a_cell_are_drawn_where_their_drives_are() -> None:
    """They tell their places every two seconds on the way and go 1 m/s: no more than that apart, mostly nothing."""
    site, said, gaps_mm = find_site("cell"), said_in("cell"), []
    with film_of("cell", fleet_only=True) as film:
        layout = film.show(film.first_us).layout()
        (left, top), (right, _) = next(one["points"] for one in layout["plan"]["shapes"] if one["id"] == "a1")
        area = vars(site)["arms"][1].area
        unit = (area.x1_mm - area.x0_mm) / (right - left)
        for time_us, snapshot in moments(film, 1_000_000):
            for node in range(1, 6):
                state = last(said, ArmState, node, time_us)
                if state is not None:
                    x, y = at(snapshot["machines"][node]["path"], time_us)
                    x_mm, y_mm = area.x0_mm + (x - left) * unit, area.y1_mm - (y - top) * unit
                    gaps_mm.append(((x_mm - state.x_mm) ** 2 + (y_mm - state.y_mm) ** 2) ** 0.5)
    assert median(gaps_mm) < 60 and max(gaps_mm) < 3_000


def test_parts_of_a_cell_lie_where_their_custodians_say() -> None:
    said = said_in("cell")
    with film_of("cell", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 5_000_000):
            told: dict[int, PartAt] = {}
            for at_us, _, one in said:
                if at_us <= time_us and isinstance(one, PartAt):
                    told[one.part.number] = one
            lying = {str(number) for number, one in told.items() if not one.aboard}
            assert {one["name"] for one in snapshot["things"] if one["kind"] == "part"} == lying
            aboard = {one.sender: str(number) for number, one in told.items() if one.aboard}
            assert {node: one["car"] for node, one in snapshot["machines"].items() if one["car"]} == aboard


def test_lathes_have_made_what_their_controls_count() -> None:
    said = said_in("turning")
    with film_of("turning", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 20_000_000):
            for node in (1, 2, 3):
                words, control = snapshot["machines"][node]["where"], last(said, NcState, node, time_us)
                if words.startswith("turning"):
                    assert control.parts == int(words.split()[1])


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


@pytest.mark.parametrize("name", ["terminal", "graph", "cell", "turning"])
def test_tasks_shown_as_done_are_those_that_were_reported(name: str) -> None:
    done = {
        one.task
        for _, is_fleet, one in said_in(name)
        if is_fleet and isinstance(one, TaskReport) and one.phase is TaskPhase.DONE
    }
    with film_of(name) as film:
        picture = film.show(film.last_us)
        snapshot = json.loads(json.dumps(picture.snapshot()))
    assert snapshot["figures"]["done"] == len(done)
    assert not {one["task"] for one in snapshot["tasks"]} & {picture.view.words.reference(task) for task in done}


def test_a_network_is_arranged_by_its_lengths_and_always_the_same() -> None:
    ring = {(number, (number + 1) % 6): 1.0 for number in range(6)}
    spots = arrange(ring, list(range(6)), 100)
    assert spots == arrange(ring, list(range(6)), 100)
    sides = [((spots[one][0] - spots[two][0]) ** 2 + (spots[one][1] - spots[two][1]) ** 2) ** 0.5 for one, two in ring]
    assert min(sides) == pytest.approx(100) and max(sides) < 115
    apart = arrange({(1, 2): 1.0, (3, 4): 1.0}, [1, 2, 3, 4], 50)
    assert len(set(apart.values())) == 4, "what no way joins is drawn all the same"
    assert arrange({}, [7], 50) == {7: (0.0, 0.0)}


def test_a_machine_goes_evenly_along_its_line_and_never_beyond_it() -> None:
    corner = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]
    assert spot_on(corner, 0.75) == (10.0, 5.0) and part(corner, 0.25, 1.0)[0] == (5.0, 0.0)
    path = along(corner, 1_000, 3_000)
    assert [at(path, time_us) for time_us in (0, 1_000, 2_000, 2_500, 9_000)] == [
        (0, 0),
        (0, 0),
        (10, 0),
        (10, 5),
        (10, 10),
    ]
    assert at(along(corner, 0, 1_000, 0.5), 5_000) == (10, 0)
