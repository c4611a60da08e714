"""Imported plants under faults drawn by seed, and what a log that begins in the middle is taken to mean."""

import pytest

from bus_sim.systems.mapd.importers.command import import_files
from bus_sim.systems.mapd.importers.draft import site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand
from onboard.config.site import parse_site
from tests.faults.systems import PLANTS, judged, withstands
from tests.mapd.case import CALL, at
from tests.mapd.sites import drawn, made

SITE = made(6, drawn(16, 1))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("plant_file", ["hotel.building.yaml", "Demo-01.xml"])
def test_an_imported_plant_under_faults(plant_file: str, seed: int) -> None:
    draft = import_files([PLANTS / plant_file], DrawnDemand(tasks=3, seed=7))
    site = parse_site(site_text(draft), plant_file)
    assert withstands(site, seed, (4.0, 28.64), 900).served == 3


def test_what_is_aboard_where_a_log_begins_is_taken_for_granted() -> None:
    """Also where the time of the bus began anew in the middle, as after the stale frames of a node that was off."""
    said = [at(11, 90, 13, 3, loaded=True), CALL, at(11, 91, 14, 3, loaded=True)]
    assert judged(SITE, [(1_000_000 * number, one) for number, one in enumerate(said, 1)]).counts["task-once"] == 0
