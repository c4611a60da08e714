"""Whoever can be held by hand stands until it is let go, in every system (row M38; onboard/work/manual.py)."""

from pathlib import Path

import pytest

from bus_sim.cli import main
from onboard.contract.codes import ManualMode
from onboard.contract.messages import ManualOrder, ManualState, Message
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log
from tests.conformance.cases import CASES
from tests.conformance.runs import can_be_held, site_file, site_of
from tests.thinned import some
from tests.web.logs import contract

AT_S, FOR_S = 20, 50
#: Where a site's own day is long.
_DEMAND = {"car-park": ("--one-car", "60")}


#: The first and the last of each system: the others are the same kind with other orders.
HELD = [(system, name) for system in CASES for name in some(can_be_held(system), 2)]


def played(system: str, name: str, folder: Path) -> list[tuple[int, Message]]:
    """All messages of a run in which one machine is held, with times, us; orders to devices included.

    Everybody is served in it, and nothing unsafe happens: else its exit status is not 0.
    """
    log, listener = folder / "run.log", Listener(contract(site_of(system)))
    words = [*_DEMAND.get(system, ()), "--speed", "max", "--no-web", "--for", "1200", "--devices", "--trace", str(log)]
    assert main(["run", site_file(system), *words, "--fault", f"held:target={name},at_s={AT_S},for_s={FOR_S}"]) == 0
    with Log(str(log)) as lines:
        heard = [(raw.time_us, listener.hear(raw).message) for raw in lines]
    return [(time_us, message) for time_us, message in heard if message is not None]


def test_there_are_such_machines_in_four_systems() -> None:
    assert {system for system, _ in HELD} >= {"car-park", "cell", "graph", "terminal"}


@pytest.mark.parametrize(("system", "name"), HELD, ids=[f"{system}-{name}" for system, name in HELD])
def test_a_machine_that_is_held_comes_to_rest_and_orders_nothing_until_it_is_let_go(
    system: str, name: str, tmp_path: Path
) -> None:
    said = played(system, name, tmp_path)
    machine, moved_by = site_of(system).machine(name), site_of(system).moved_by
    answers = [(t, m) for t, m in said if isinstance(m, ManualState) and m.sender == machine.node_id]
    rests_us = next(t for t, m in answers if m.manual_mode is ManualMode.HELD and m.at_rest)
    goes_us = next(t for t, m in said if isinstance(m, ManualOrder) and m.manual_mode is ManualMode.AUTOMATIC)
    assert rests_us < goes_us
    orders = [(t, m) for t, m in said if m.sender == machine.node_id and type(m).__name__ in moved_by]
    assert [m for t, m in orders if rests_us < t < goes_us] == []
    assert answers[-1][1].manual_mode is ManualMode.AUTOMATIC
