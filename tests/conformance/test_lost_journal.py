"""Where rights cannot be made anew a machine whose journal is lost or short holds by name too, and has a remedy."""

import pytest

from bus_sim.campaign.trial import stage_of
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.systems.orders import OrderArrivals
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.codes import MachineState, Reason
from onboard.contract.graph import NodeAnswer
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Halted,
    Heartbeat,
    Message,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRequest,
)
from onboard.core.site import Site
from onboard.operate.commands import CommandRequest, maker_of
from onboard.operate.names import OperateError
from onboard.operate.park import Park
from onboard.operate.status import Status
from tests.conformance.cases import CASES
from tests.conformance.runs import one_of_each_kind, site_of

AT_S, OFF_S, END_S = 30, 3, 60
#: What nobody says whose rights are not known.
OF_RIGHTS = (CallForProposals, Bid, Award, TokenRequest, TokenGrant, TokenHeld, TokenGiven, NodeAnswer)


#: One machine of each kind of every system whose rights nobody can make anew.
MACHINES = [(name, machine) for name in CASES if name != "car-park" for machine in one_of_each_kind(name)]


def said_by(site: Site, name: str, journal: str) -> tuple[list[tuple[int, Message]], Park]:
    """What a machine says after it came back with its journal so, and what an operator's station heard of all."""
    loop, said, park = VirtualTimeLoop(), list[tuple[int, Message]](), Park(site)
    faults = (parse_injection(f"crash:target={name},at_s={AT_S},restart_s={OFF_S},journal={journal}"),)
    orders = OrderArrivals(4, simulated_of(site).on(Occasion.FEW, site).apart_s)
    stage = stage_of(site, FaultScenario(site.name, 1, END_S, orders, faults), loop)

    async def play() -> None:
        arm(stage.run, faults)
        stage.run.observers.append(lambda message, time_us: said.append((time_us, message)))
        stage.run.observers.append(park.feed)
        stage.run.start()
        await run_until(stage.run, lambda: False, END_S * 1_000_000, 1_000_000)
        stage.run.close()

    run_on(loop, play())
    assert stage.violations() == []
    node, from_us = site.machine(name).node_id, (AT_S + OFF_S) * 1_000_000
    return [one for one in said if one[0] >= from_us and one[1].sender == node], park


@pytest.mark.parametrize(("system", "name"), MACHINES)
@pytest.mark.parametrize(("journal", "reason"), [("lost", Reason.JOURNAL_LOST), ("unsealed", Reason.JOURNAL_SHORT)])
def test_a_machine_of_any_system_holds_for_its_journal_and_tells_the_remedy(
    system: str, name: str, journal: str, reason: Reason
) -> None:
    site = site_of(system)
    said, park = said_by(site, name, journal)
    at_us = next(time_us for time_us, one in said if isinstance(one, Halted))
    assert at_us < (AT_S + OFF_S + 4) * 1_000_000
    after = [one for time_us, one in said if time_us > at_us + 100_000]
    held = [one for one in after if isinstance(one, Halted)]
    assert {(one.reason, one.needs_person) for one in held} == {(reason, True)}
    assert len(held) >= (END_S - AT_S - OFF_S - 6) * 1_000_000 // site.timing.heartbeat_us
    assert {one.state for one in after if isinstance(one, Heartbeat)} == {MachineState.OBSTACLE}
    assert not [one for one in after if isinstance(one, OF_RIGHTS)]
    remedy = "put all their journals away together, start them, and give open orders again"
    with pytest.raises(OperateError, match=f"only a car park's rights can be made anew; .*{remedy}"):
        maker_of(site, CommandRequest("regenerate", machine=name), 1)
    order = Status(park, 251, 1)
    order.begin(END_S * 1_000_000)
    order.wake(END_S * 1_000_000 + 1)
    (line,) = [one for one in order.news() if one.startswith(f"{name} ") and "journal" in one]
    assert remedy in line and "regenerate" not in line
