"""Pick-up and delivery under faults drawn by seed: every task is served, and neither plant nor rules find anything."""

from pathlib import Path

import pytest

import bus_sim
from bus_sim.campaign.profiles import draw_faults
from bus_sim.faults.injection import Injection
from bus_sim.importers.command import import_files
from bus_sim.importers.draft import site_text
from bus_sim.importers.mapf import Wanted
from onboard.config.site import parse_site
from onboard.core.messages import Message
from onboard.kinds.mapd.messages import (
    NO_TASK,
    PathHead,
    PathMoves,
    StepAward,
    StepRound,
    StepState,
    TransportBid,
    TransportCall,
)
from onboard.kinds.mapd.site import Mapd
from onboard.trace.check.checks import Checks, Verdict
from onboard.trace.check.mapd import RULES
from tests.mapd.sites import drawn, made, played

SITE = made(6, drawn(16, 1))
#: Faults are drawn for a day; here they strike while robots are under way, from 4 s to 30 s.
BEGIN_S, SHARE = 4.0, 0.028


PLANTS = Path(bus_sim.__file__).parent / "data" / "plants"


def _faults(seed: int, site: Mapd = SITE) -> tuple[Injection, ...]:
    found = []
    for fault in draw_faults(("bus", "crash")[seed % 2], seed, site):
        given = dict(fault.given)
        at_s = given["at_s"]
        assert not isinstance(at_s, str)
        given["at_s"] = round(BEGIN_S + (at_s - 20) * SHARE, 6)
        found.append(Injection(fault.kind, given))
    return tuple(found)


@pytest.mark.parametrize("seed", range(16))
def test_pick_up_and_delivery_under_faults(seed: int) -> None:
    faults = _faults(seed)
    run, plant = played(SITE, seed=seed, limit_s=300, faults=faults)
    assert plant.violations == [], [str(fault) for fault in faults]
    assert run.halted == []
    assert run.is_over, [str(fault) for fault in faults]
    assert len(plant.served) == len(SITE.tasks)
    verdict = _verdict(run.messages, disturbed=True)
    assert verdict.is_good, verdict.lines()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("plant_file", ["hotel.building.yaml", "Demo-01.xml"])
def test_an_imported_plant_under_faults(plant_file: str, seed: int) -> None:
    draft = import_files([PLANTS / plant_file], Wanted(tasks=3, seed=7))
    site = parse_site(site_text(draft), plant_file)
    assert isinstance(site, Mapd)
    run, plant = played(site, seed=seed, limit_s=900, faults=_faults(seed, site))
    assert run.is_good
    assert len(plant.served) == 3
    verdict = _verdict(run.messages, site, disturbed=True)
    assert verdict.is_good, verdict.lines()


def _verdict(messages: list[tuple[int, Message]], site: Mapd = SITE, *, disturbed: bool = False) -> Verdict:
    checks = Checks(site, disturbed=disturbed, rules=RULES)
    for time_us, message in messages:
        checks.feed_message(time_us, message)
    return checks.finish()


def _at(
    robot: int, step: int, cell: int, task: int = NO_TASK, *, loaded: bool = False, served: bool = False
) -> Message:
    return StepState(robot, step, cell, task, loaded, served)


def _path(robot: int, cell: int, *codes: int, step: int = 0) -> list[Message]:
    told = sum(code << 4 * place for place, code in enumerate(codes))
    moves: list[Message] = [PathMoves(robot, 1, 0, told)] if codes else []
    return [PathHead(robot, step, cell, len(codes), 1, False), *moves]


_CALL = TransportCall(1, 3, 12, 15)


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
            [StepRound(1, 0, 1, 0, True), TransportBid(11, 0, 0, 3, 50), TransportBid(12, 0, 0, 3, 70)],
        ),
        (
            "rounds-go-down",
            [StepRound(1, 0, 1, 0, True), TransportBid(11, 0, 0, 3, 50), StepAward(1, 0, 0, 1, 12, 3)],
        ),
        ("rounds-go-down", [StepRound(1, 0, 1, 0, True), TransportBid(11, 1, 0, 3, 50)]),
        ("paths-apart", [*_path(11, 0, 1, 2), *_path(12, 2)]),
        ("paths-apart", [*_path(11, 0, 1), *_path(12, 1, 1)]),
        ("paths-apart", [*_path(11, 9, 3)]),
    ],
)
def test_each_checker_finds_what_it_is_for(rule: str, said: list[Message]) -> None:
    verdict = _verdict([(1_000_000 * number, one) for number, one in enumerate(said, 1)])
    assert verdict.counts[rule] == 1, verdict.lines()
