"""While no robot can come who waits is told so once, at the desk where he stands, and not sent from desk to desk."""

from functools import cache
from itertools import pairwise

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.plant.customer import VisitOutcome
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import DeskText
from onboard.contract.messages import DeskOrder
from tests.system.scene import Scene, play, stays
from tests.system.test_desks import two

#: When the only robot is held by a person, who lets it go so much later, s.
HELD_S, FOR_S = 180, 400
#: Two cars are parked, whose owners come then; a third comes in while the robot is held, and turns back.
STAYS = ((0, 200), (60, 215), (250, None))


@cache
def held(desk: str) -> Scene:
    def hold(simulation: Simulation) -> None:
        arm(simulation, (parse_injection(f"held:target=MR1,at_s={HELD_S},for_s={FOR_S}"),))

    return play(two(desk), stays(*STAYS), before=hold, limit_s=1_200)


def words(scene: Scene, number: int) -> list[DeskOrder]:
    """What desks say to the owner of a car from when he asks until the robot is let go; ``number``: as they arrived."""
    ticket = scene.simulation.plant.street.customers[number - 1].ticket
    assert ticket is not None
    asked_us, _ = scene.first(DeskOrder, lambda one: (one.car, one.text) == (ticket.car, DeskText.PLEASE_WAIT))
    until_us = round((HELD_S + FOR_S) * 1e6)
    return [one for at_us, one in scene.all(DeskOrder) if asked_us <= at_us < until_us and one.car == ticket.car]


@pytest.mark.parametrize("desk", ["own", "nearest"])
def test_who_waits_reads_once_that_nobody_comes_and_is_sent_nowhere(desk: str) -> None:
    """Drawn car park 5795: four of fourteen were sent to three desks each, and read in turn that they were to wait."""
    scene = held(desk)
    for number in (1, 2):
        said = words(scene, number)
        assert len({one.compartment for one in said if one.text is DeskText.GO_TO}) == 1, "which suits its place"
        texts = [one.text for one in said if one.text is not DeskText.GO_TO]
        assert [text for text, before in pairwise([*texts, None]) if text is not before] == [
            DeskText.PLEASE_WAIT,
            DeskText.OUT_OF_ORDER,
        ]


@pytest.mark.parametrize("desk", ["own", "nearest"])
def test_once_somebody_comes_again_all_are_served(desk: str) -> None:
    outcomes = [one.visit.outcome for one in held(desk).simulation.plant.street.customers]
    assert outcomes[:2] == [VisitOutcome.SERVED] * 2
