"""Pick-up and delivery under faults drawn by seed: every task is served, and neither plant nor rules find anything."""

import pytest

from bus_sim.systems.mapd.importers.command import import_files
from bus_sim.systems.mapd.importers.draft import site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand
from onboard.config.site import parse_site
from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState
from onboard.contract.messages import Bid, Message
from onboard.systems.mapd.auction import TransportTask
from onboard.systems.mapd.calls import award_of, call_of
from onboard.systems.mapd.fields import NO_TASK
from tests.faults.systems import PLANTS, judged, withstands
from tests.mapd.sites import drawn, made

SITE = made(6, drawn(16, 1))


@pytest.mark.parametrize("seed", range(16))
def test_pick_up_and_delivery_under_faults(seed: int) -> None:
    assert withstands(SITE, seed, (4.0, 28.64), 300).served == len(SITE.tasks)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("plant_file", ["hotel.building.yaml", "Demo-01.xml"])
def test_an_imported_plant_under_faults(plant_file: str, seed: int) -> None:
    draft = import_files([PLANTS / plant_file], DrawnDemand(tasks=3, seed=7))
    site = parse_site(site_text(draft), plant_file)
    assert withstands(site, seed, (4.0, 28.64), 900).served == 3


def _at(
    robot: int, step: int, cell: int, task: int = NO_TASK, *, loaded: bool = False, served: bool = False
) -> Message:
    return StepState(robot, step, cell, task, loaded, served)


def _path(robot: int, cell: int, *codes: int, step: int = 0) -> list[Message]:
    told = sum(code << 4 * place for place, code in enumerate(codes))
    moves: list[Message] = [PathMoves(robot, 1, 0, told)] if codes else []
    return [PathHead(robot, step, cell, len(codes), 1, False), *moves]


_CALL = call_of(1, TransportTask(3, 0, 12, 15), 0)


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("one-a-cell", [_at(11, 0, 5), _at(12, 0, 5)]),
        ("one-a-cell", [_at(11, 0, 5), _at(12, 0, 6), _at(11, 1, 6), _at(12, 1, 5)]),
        ("one-a-cell", [_at(11, 0, 5), _at(11, 1, 7)]),
        ("one-a-cell", [_at(11, 0, 5), _at(12, 0, 8), _at(11, 1, 5), _at(11, 2, 5)]),
        ("task-once", [_CALL, _at(11, 0, 12, 3, loaded=True), _at(12, 0, 11, 3, loaded=True)]),
        ("task-once", [_CALL, _at(11, 0, 11, 3, loaded=True)]),
        ("task-once", [_CALL, _at(11, 4, 15, 3, served=True), _at(12, 5, 15, 3, served=True)]),
        ("task-once", [_CALL, _at(11, 4, 16, 3, served=True)]),
        (
            "rounds-go-down",
            [StepRound(1, 0, 1, 0, True), Bid(11, 1, 4, 50, 0), Bid(12, 1, 4, 70, 0)],
        ),
        (
            "rounds-go-down",
            [StepRound(1, 0, 1, 0, True), Bid(11, 1, 4, 50, 0), award_of(1, 0, 12, 3)],
        ),
        ("rounds-go-down", [StepRound(1, 0, 1, 0, True), Bid(11, 1, 4, 50, 1)]),
        ("paths-apart", [*_path(11, 0, 1, 2), *_path(12, 2)]),
        ("paths-apart", [*_path(11, 0, 1), *_path(12, 1, 1)]),
        ("paths-apart", [*_path(11, 9, 3)]),
    ],
)
def test_each_checker_finds_what_it_is_for(rule: str, said: list[Message]) -> None:
    verdict = judged(SITE, [(1_000_000 * number, one) for number, one in enumerate(said, 1)])
    assert verdict.counts[rule] == 1, verdict.lines()


def test_what_is_aboard_where_a_log_begins_is_taken_for_granted() -> None:
    """Also where the time of the bus began anew in the middle, as after the stale frames of a node that was off."""
    said = [_at(11, 90, 13, 3, loaded=True), _CALL, _at(11, 91, 14, 3, loaded=True)]
    assert judged(SITE, [(1_000_000 * number, one) for number, one in enumerate(said, 1)]).counts["task-once"] == 0
