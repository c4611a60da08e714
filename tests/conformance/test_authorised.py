"""In every system nothing moves but as ``authorised`` lets it: not on a machine that is held, not without its right."""

from pathlib import Path

import pytest

from bus_sim.cli import main
from onboard.contract.codes import KindCode, Reason
from onboard.contract.mapd_device import CartOrder
from onboard.contract.messages import Halted, Message, Progress, TokenGrant
from onboard.contract.terminal_device import MoveOrder
from onboard.core.authority import TokenBook
from onboard.core.effects import Effect
from onboard.core.site import MotionNeeds, Site
from onboard.holon.taking_part import TakingPart
from onboard.systems.car_park.sill import SillProof
from onboard.systems.car_park.site import car_park
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log
from tests.conformance.cases import CASES
from tests.conformance.runs import site_file, site_of
from tests.web.logs import contract


def orders_in_a_run(name: str, folder: Path) -> list[Message]:
    """What was said to devices in a run by which something moves; no machine has stopped for an order of its own."""
    said, moved_by = said_in_a_run(name, folder), site_of(name).moved_by
    assert not any(isinstance(message, Halted) and message.reason is Reason.NOT_AUTHORISED for message in said)
    return [message for message in said if type(message).__name__ in moved_by]


def said_in_a_run(name: str, folder: Path) -> list[Message]:
    """All messages of a run, those between machines and their devices included."""
    log, listener = folder / "run.log", Listener(contract(site_of(name)))
    main(["run", site_file(name), *CASES[name].moving, "--speed", "max", "--no-web", "--devices", "--trace", str(log)])
    with Log(str(log)) as lines:
        heard = [listener.hear(raw).message for raw in lines]
    return [message for message in heard if message is not None]


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


def test_a06_what_is_done_in_a_cell_is_said_to_be_done_at_the_step_behind_the_way_there(tmp_path: Path) -> None:
    """Steps of one robot's orders never go back: none loads before it is where it is sent."""
    last = dict[int, int]()
    for order in orders_in_a_run("mapd", tmp_path):
        assert isinstance(order, CartOrder)
        assert order.step >= last.get(order.sender, 0)
        last[order.sender] = order.step
    assert last


def test_a01_without_the_word_of_a_lift_under_its_gate_no_robot_crosses_a_sill(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all rights, and the platform there: by what robots say nobody is aboard, but with the words some are."""
    site = car_park(site_of("car-park"))

    def aboard(folder: Path) -> list[Progress]:
        told = [one for one in said_in_a_run("car-park", folder) if isinstance(one, Progress)]
        by_robots = [one for one in told if site.machines[one.sender].kind is KindCode.ROBOT]
        return [one for one in by_robots if not 1 <= one.index <= site.tracks[one.track].length]

    assert aboard(tmp_path)
    monkeypatch.setattr(SillProof, "word", lambda proof, lift_track: None)
    assert aboard(tmp_path) == []


def is_shared(site: Site, order: MoveOrder) -> bool:
    """Whether a slot of the terminal is one that others may come to."""
    assert isinstance(site, Terminal)
    return site.entities[order.entity].kind is not EntityKind.AREA


def lost(book: TokenBook, grant: TokenGrant, now_us: int) -> list[Effect]:
    """As if it had not been heard."""
    return []
