"""Row P50: a car comes in, in the order of the 21 steps of Fig. 9; those that need no lift, with flag 5 put right."""

import pytest

from onboard.contract.codes import (
    CallResult,
    DeskInput,
    DeskText,
    DoorPosition,
    DriveMode,
    Grade,
    LegAction,
    LightColour,
    Operation,
    ShuttleMode,
    TaskPhase,
    TokenKind,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    BayState,
    Bid,
    CallForProposals,
    CarAt,
    DeskEvent,
    DeskOrder,
    DoorState,
    DriveState,
    Itinerary,
    ShuttleState,
    TaskReport,
    TokenGrant,
)
from onboard.ways.mirror import way_mirror
from onboard.ways.site import way_site
from tests.sites import at_the_key, one_floor, telling
from tests.system.scene import Scene, play, stays


@pytest.fixture(scope="module")
def scene() -> Scene:
    found = play(at_the_key(telling(one_floor())), stays((0, None)), extra_s=300)
    found.assert_sound()
    return found


def test_p50_the_steps_come_in_their_order(scene: Scene) -> None:
    bay = way_site(scene.simulation.site).compartments[1]
    left, _ = scene.first(BayState, lambda m: m.load_kg > 0)
    key, _ = scene.first(DeskEvent, lambda m: m.event is DeskInput.KEY)
    ticket, printed = scene.first(DeskOrder, lambda m: m.text is DeskText.TAKE_TICKET)
    call_us, call = scene.first(CallForProposals)
    red, _ = scene.first(DoorState, lambda m: m.light is LightColour.RED, after_us=call_us)
    locked, _ = scene.first(DoorState, lambda m: m.input_door is DoorPosition.LOCKED, after_us=call_us)
    bid_us, bid = scene.first(Bid)
    tentative, _ = scene.first(Itinerary, lambda m: m.grade is Grade.TENTATIVE)
    award_us, award = scene.first(Award)
    firm, _ = scene.first(Itinerary, lambda m: m.grade is Grade.FIRM and len(m.legs) > 1)
    moving, _ = scene.first(DriveState, lambda m: m.mode is DriveMode.MOVING)
    front, _ = scene.first(BayState, lambda m: m.carrier_in_front, after_us=moving)
    opened, _ = scene.first(DoorState, lambda m: m.output_door is DoorPosition.OPEN, after_us=call_us)
    granted, _ = scene.first(TokenGrant, lambda m: m.token_kind is TokenKind.STATION and m.token == bay.number)
    reached, _ = scene.first(ShuttleState, lambda m: m.mode is ShuttleMode.REACHED)
    loaded, _ = scene.first(TaskReport, lambda m: m.phase is TaskPhase.LOADED)
    closed, _ = scene.first(DoorState, lambda m: m.output_door is DoorPosition.LOCKED, after_us=loaded)
    reopened, _ = scene.first(DoorState, lambda m: m.input_door is DoorPosition.OPEN, after_us=loaded)
    green, _ = scene.first(DoorState, lambda m: m.light is LightColour.GREEN, after_us=loaded)
    parked, done = scene.first(TaskReport, lambda m: m.phase is TaskPhase.DONE)
    order = [left, key, call_us, bid_us, tentative, award_us, firm, moving, front, opened, granted, reached, loaded]
    assert order == sorted(order)
    assert key < ticket < red < locked < opened, "the output door waits for the locked input door (flag 5)"
    assert loaded < closed < reopened < green < parked
    assert printed.car == call.car
    assert (call.operation, call.from_station, call.to_station) == (Operation.PARK, bay.number, ANY_STATION)
    assert (award.winner, award.result) == (bid.sender, CallResult.AWARDED)
    assert done.task == call.task


def test_p50_never_are_both_doors_unlocked(scene: Scene) -> None:
    for time_us, state in scene.all(DoorState):
        assert DoorPosition.LOCKED in (state.input_door, state.output_door), f"at {time_us / 1e6:.3f} s"


def test_p10_p47_a_bid_comes_with_a_tentative_itinerary_and_the_award_makes_it_firm(scene: Scene) -> None:
    _, call = scene.first(CallForProposals)
    bid_us, bid = scene.first(Bid)
    award_us, _ = scene.first(Award)
    tentative_us, tentative = scene.first(Itinerary, lambda m: m.grade is Grade.TENTATIVE)
    firm_us, firm = scene.first(Itinerary, lambda m: m.grade is Grade.FIRM and len(m.legs) > 1)
    assert bid_us < tentative_us < award_us < firm_us
    assert bid.itinerary_version == tentative.version
    assert (firm.stamp.initiator, firm.stamp.call) == (call.sender, call.call & 0xFF)
    works = [(leg.track, leg.to_index, leg.side) for leg in firm.legs if leg.action is LegAction.WORK]
    assert works == [(leg.track, leg.to_index, leg.side) for leg in tentative.legs if leg.action is LegAction.WORK]
    assert len(works) == 2


def test_p05_p11_one_call_one_award_and_nothing_after_the_deadline(scene: Scene) -> None:
    ((call_us, call),) = scene.all(CallForProposals)
    ((award_us, _),) = scene.all(Award)
    assert call.deadline_ms * 1000 <= award_us <= call.deadline_ms * 1000 + 10_000
    assert all(call_us < time_us < call.deadline_ms * 1000 for time_us, _ in scene.all(Bid))


def test_p20_the_promise_is_kept(scene: Scene) -> None:
    _, bid = scene.first(Bid)
    done_us, _ = scene.first(TaskReport, lambda m: m.phase is TaskPhase.DONE)
    assert done_us <= bid.cost * 1000, "nothing intervened, so the robot is no later than its bid"
    assert done_us >= bid.cost * 1000 - 15_000_000, "and the bid was not a lie on the safe side"


def test_p42_the_car_stands_where_the_itinerary_said_and_everybody_knows(scene: Scene) -> None:
    _, firm = scene.first(Itinerary, lambda m: m.grade is Grade.FIRM and len(m.legs) > 1)
    place = [leg for leg in firm.legs if leg.action is LegAction.WORK][-1]
    _, statement = scene.all(CarAt, "fleet")[-1]
    assert statement.station == place.track << 8 | place.side << 7 | place.to_index
    assert statement.sender == 1, "the steward has custody of a parked car"
    world = scene.simulation.plant.world
    (station,) = world.where.values()
    assert station is not None and getattr(station, "number", None) == statement.station


def test_p35_every_machine_holds_the_same_model_of_the_park(scene: Scene) -> None:
    mirrors = [controller.holon.mirror for controller in scene.simulation.controllers.values()]
    assert len({mirror.digest() for mirror in mirrors}) == 1
    assert way_mirror(mirrors[0]).cars and mirrors[0].itineraries
