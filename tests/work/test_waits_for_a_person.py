"""A desk's operator is told once of each order that waits until a machine is let go, and of nothing else."""

from bus_sim.campaign.trial import stage_of
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.systems.orders import OrderArrivals
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.codes import KindCode
from tests.conformance.runs import site_of


def told(system: str, held: tuple[str, ...], at_s: int, for_s: int, end_s: int, *more: str) -> tuple[list[str], int]:
    """What desks said of orders that wait, and how many orders were carried out; ``more`` faults."""
    site, loop = site_of(system), VirtualTimeLoop()
    desks = {one.name for one in site.machines.values() if one.kind is KindCode.DESK}
    held_s = [f"held:target={name},at_s={at_s},for_s={for_s}" for name in held]
    faults = tuple(parse_injection(one) for one in (*held_s, *more))
    stage = stage_of(site, FaultScenario(site.name, 1, end_s, OrderArrivals(3, 10.0), faults), loop)

    async def play() -> None:
        arm(stage.run, faults)
        stage.run.start()
        await run_until(stage.run, lambda: False, end_s * 1_000_000, 1_000_000)
        stage.run.close()

    run_on(loop, play())
    assert stage.violations() == []
    lines = [text for _, source, text in stage.run.log.lines if source in desks and " waits: " in text]
    return lines, stage.tally().served


def test_an_order_whose_robot_is_held_is_told_of_once_and_carried_out_when_it_is_let_go() -> None:
    assert told("graph", ("R1",), 32, 100, 400) == (["order 3 waits: R1 has it, and is held"], 3)


def test_orders_that_nobody_can_do_while_all_are_held_are_told_of_once() -> None:
    lines, served = told("graph", ("R1", "R2", "R3"), 2, 60, 400)
    assert sorted(lines) == [
        "order 1 waits: R2 has it, and is held",
        "order 2 waits: nobody can do it while machines are held",
        "order 3 waits: nobody can do it while machines are held",
    ]
    assert served == 3


def test_where_another_does_it_nothing_is_told() -> None:
    assert told("graph", ("R1",), 2, 60, 400) == ([], 3)


def test_who_is_to_be_let_go_while_an_emergency_stop_holds_it_is_let_go_after_that() -> None:
    """The person of a run gave up there, and it was held to the end (drawn terminal 956)."""
    assert told("graph", ("R1", "R2", "R3"), 32, 30, 500, "emergency_stop:at_s=50")[1] == 3
