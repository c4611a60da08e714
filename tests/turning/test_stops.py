"""A control works only while its lathe says so: it stands while the board is off, and goes on with the part in hand."""

from typing import Any

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.stage import SystemStage
from onboard.contract.codes import OrderResult


def played(*faults: str) -> SystemStage[Any]:
    def before(run: BusRun[Any]) -> None:
        arm(run, [parse_injection(one) for one in faults])

    return play(find_site("turning"), RunOptions(limit_s=20_000), prepare=before)


def ended_s(stage: SystemStage[Any], number: int) -> float:
    """When the order was over, s."""
    entry = stage.plant.entries[number - 1]
    assert entry.result is OrderResult.DONE
    return float(entry.ended_us / 1e6)


def test_a_board_that_is_off_for_minutes_delays_its_part_by_so_long_and_spoils_nothing() -> None:
    """Order 1 is with L3, as all lathes are."""
    usual, struck = played(), played("crash:target=L3,at_s=600,restart_s=300")
    assert struck.plant.violations == [] and struck.halted == [] and struck.is_over
    assert 295 < ended_s(struck, 1) - ended_s(usual, 1) < 330
    assert ended_s(struck, 2) == ended_s(usual, 2), "and nobody else's"


def test_an_emergency_stop_delays_all_that_is_being_made_and_it_is_made() -> None:
    usual, struck = played(), played("emergency_stop:at_s=600")
    assert struck.plant.violations == [] and struck.halted == [] and struck.is_over
    for number in range(1, len(usual.plant.entries) + 1):
        assert 25 < ended_s(struck, number) - ended_s(usual, number) < 40
