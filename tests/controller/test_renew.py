"""A journal that is short takes one write only: to begin anew, before anything is said that rests on it."""

import pytest

from bus_sim.faults.journals import hurt
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import build
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.messages import Message, SyncRequest
from onboard.controller.shell import Controller
from onboard.core.effects import Effect, Record, Renew, Send
from onboard.core.journal_state import JournalState
from onboard.core.records import BootRecord
from onboard.ports.journal import Entry

ROBOT = 11
ENTRIES: tuple[Entry, ...] = (BootRecord(9).entry,)


@pytest.mark.parametrize("renews", [True, False])
def test_a_short_journal_begins_anew_before_what_follows_is_said(renews: bool) -> None:
    site, loop, said = find_site("level1"), VirtualTimeLoop(), list[Message]()
    simulation = build(site, RunOptions(), loop)

    def start(local_us: int) -> list[Effect]:
        first = Renew(ENTRIES) if renews else Record(BootRecord(9))
        return [first, Send(SyncRequest(ROBOT, 0))]

    def prepare(controller: Controller) -> None:
        if controller.holon.node_id == ROBOT and not controller.holon.journal.is_reliable:
            controller.holon.start = start  # type: ignore[method-assign]  # what regeneration will decide

    async def play() -> None:
        simulation.before_start.append(prepare)
        simulation.start()
        await run_until(simulation, lambda: False, 5_000_000, 1_000_000)
        simulation.crash(site.machines[ROBOT])
        hurt(simulation.journals[ROBOT], "unsealed", 1)
        simulation.observers.append(lambda message, _: said.append(message))
        simulation.start_controller(site.machines[ROBOT])
        await run_until(simulation, lambda: False, 5_500_000, 100_000)

    run_on(loop, play())
    journal = simulation.journals[ROBOT]
    assert any(message.sender == ROBOT and isinstance(message, SyncRequest) for message in said) is renews
    assert (journal.entries[:1] == list(ENTRIES)) is renews
    assert (journal.condition.state is JournalState.INTACT) is renews
    assert ("cannot be written" in str(simulation.controllers[ROBOT].holon.halted)) is not renews
