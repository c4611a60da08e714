"""Row P51: retrieval mirrors entry, with the ticket."""

import pytest

from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorPosition,
    LightColour,
    Operation,
    ShuttleAction,
    TaskPhase,
    TokenKind,
)
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import (
    Award,
    BayState,
    CallForProposals,
    CarAt,
    DeskEvent,
    DeskOrder,
    DoorState,
    ShuttleOrder,
    ShuttleState,
    TaskReport,
    TokenGrant,
)
from onboard.ways.mirror import way_mirror
from onboard.ways.site import way_site
from tests.sites import at_the_key, one_floor
from tests.system.scene import Scene, play, stays


@pytest.fixture(scope="module")
def scene() -> Scene:
    found = play(at_the_key(one_floor()), stays((0, 300)))
    found.assert_sound()
    return found


def test_p51_a_ticket_brings_the_car_back(scene: Scene) -> None:
    bay = way_site(scene.simulation.site).compartments[1]
    ticket_us, ticket = scene.first(DeskEvent, lambda m: m.event is DeskInput.TICKET)
    waiting, _ = scene.first(DeskOrder, lambda m: m.text is DeskText.PLEASE_WAIT)
    red, _ = scene.first(DoorState, lambda m: m.light is LightColour.RED, after_us=ticket_us)
    locked, _ = scene.first(DoorState, lambda m: m.input_door is DoorPosition.LOCKED, after_us=ticket_us)
    call_us, call = scene.first(CallForProposals, lambda m: m.operation is Operation.RETRIEVE)
    award_us, _ = scene.first(Award, after_us=call_us)
    loaded, _ = scene.first(TaskReport, lambda m: m.phase is TaskPhase.LOADED, after_us=award_us)
    opened, _ = scene.first(DoorState, lambda m: m.output_door is DoorPosition.OPEN, after_us=loaded)
    granted, _ = scene.first(
        TokenGrant, lambda m: m.token_kind is TokenKind.STATION and m.token == bay.number, after_us=loaded
    )
    brought, _ = scene.first(BayState, lambda m: m.load_kg > 0, after_us=loaded)
    done, _ = scene.first(TaskReport, lambda m: m.phase is TaskPhase.DONE, after_us=loaded)
    closed, _ = scene.first(DoorState, lambda m: m.output_door is DoorPosition.LOCKED, after_us=done)
    ready, shown = scene.first(DeskOrder, lambda m: m.text is DeskText.CAR_READY)
    gone, _ = scene.first(CarAt, lambda m: m.station == OUTSIDE)
    green, _ = scene.first(DoorState, lambda m: m.light is LightColour.GREEN, after_us=done)
    order = [ticket_us, waiting, locked, call_us, award_us, loaded, opened, granted, brought, done, closed, gone, green]
    assert order == sorted(order)
    assert ticket_us < red < call_us and closed < ready < gone
    assert call.car == ticket.car == shown.car
    assert call.to_station == bay.number


def test_p51_the_customer_is_served_and_the_park_is_empty(scene: Scene) -> None:
    summary = scene.simulation.plant.street.summary()
    assert (summary.parked, summary.served, summary.inside) == (1, 1, 0)
    assert set(scene.simulation.plant.world.where.values()) == {None}
    for controller in scene.simulation.controllers.values():
        assert len(way_mirror(controller.holon.mirror).free_places()) == len(way_site(scene.simulation.site).places)


def test_p32_p33_the_shuttle_sets_itself_to_the_cars_wheelbase(scene: Scene) -> None:
    grips = [order for _, order in scene.all(ShuttleOrder) if order.action is ShuttleAction.GRIP]
    assert [order.wheelbase_mm for order in grips] == [2700, 2700]
    assert {state.wheelbase_mm for _, state in scene.all(ShuttleState) if state.load_kg} == {2700}


def test_p60_nobody_is_inside_while_the_output_door_is_not_locked(scene: Scene) -> None:
    output, person = DoorPosition.LOCKED, False
    for said in scene.said:
        if isinstance(said.message, DoorState):
            output = said.message.output_door
        elif isinstance(said.message, BayState):
            person = said.message.person_inside
        assert output is DoorPosition.LOCKED or not person, f"at {said.time_us / 1e6:.3f} s"
