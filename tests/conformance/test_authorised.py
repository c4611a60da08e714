"""In every system nothing moves but as ``authorised`` lets it: not on a machine that is held, not without its right."""

from pathlib import Path

import pytest

from bus_sim.cli import main
from onboard.contract.codes import KindCode, Reason
from onboard.contract.messages import Halted, Message, TokenGrant
from onboard.contract.terminal_device import MoveOrder
from onboard.core.authority import TokenBook
from onboard.core.effects import Effect
from onboard.core.site import MotionNeeds, Site
from onboard.holon.taking_part import TakingPart
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log
from tests.conformance.cases import CASES
from tests.conformance.runs import site_file, site_of
from tests.web.logs import contract


def orders_in_a_run(name: str, folder: Path) -> list[Message]:
    """What was said to devices in a run by which something moves; no machine has stopped for an order of its own."""
    log, site = folder / "run.log", site_of(name)
    main(["run", site_file(name), *CASES[name].moving, "--speed", "max", "--no-web", "--devices", "--trace", str(log)])
    orders, listener = list[Message](), Listener(contract(site))
    with Log(str(log)) as lines:
        for raw in lines:
            message = listener.hear(raw).message
            if message is not None and type(message).__name__ in site.moved_by:
                orders.append(message)
            assert not (isinstance(message, Halted) and message.reason is Reason.NOT_AUTHORISED)
    return orders


@pytest.mark.parametrize("name", CASES)
def test_a02_a04_what_moves_is_set_in_motion_under_its_right(name: str, tmp_path: Path) -> None:
    assert orders_in_a_run(name, tmp_path), "else the other tests show nothing"


@pytest.mark.parametrize("name", CASES)
def test_a05_a_machine_that_may_not_move_orders_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever its behaviour would do: it takes part, wins and plans, but the core says that it is to stand."""
    monkeypatch.setattr(TakingPart, "why_still", lambda part: Reason.EMERGENCY_STOP)
    assert orders_in_a_run(name, tmp_path) == []


@pytest.mark.parametrize("name", CASES)
def test_a01_a03_a06_without_the_rights_of_others_nothing_enters_what_is_shared(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every grant is lost: what still moves does so on open ground, within the machine, or in a shaft of its own."""
    monkeypatch.setattr(TokenBook, "on_grant", lost)
    site = site_of(name)
    orders = orders_in_a_run(name, tmp_path)
    open_ground = [one for one in orders if isinstance(one, MoveOrder) and not is_shared(site, one)]
    assert bool(open_ground) == isinstance(site, Terminal), "there nobody is asked for a right"
    for order in orders:
        is_lift = site.machines[order.sender].kind is KindCode.LIFT
        assert is_lift or site.moved_by[type(order).__name__] is not MotionNeeds.RIGHT
        assert not (isinstance(order, MoveOrder) and is_shared(site, order))


def is_shared(site: Site, order: MoveOrder) -> bool:
    """Whether a slot of the terminal is one that others may come to."""
    assert isinstance(site, Terminal)
    return site.entities[order.entity].kind is not EntityKind.AREA


def lost(book: TokenBook, grant: TokenGrant, now_us: int) -> list[Effect]:
    """As if it had not been heard."""
    return []
