"""Doors, interlock, safety edge, desk and sensors of a compartment."""

import pytest

from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    LightColour,
    ShuttleAction,
    Side,
)
from onboard.contract.messages import (
    BayState,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    Reference,
    TicketPrint,
    TicketRead,
)
from onboard.core.site import Station
from onboard.systems.car_park.tickets import Ticket
from tests.plant.support import CAR, COMPARTMENT, ROBOT, SECOND, Bench

BAY = Station(1, 4, Side.NEAR)


def positions(bench: Bench) -> tuple[DoorPosition, DoorPosition]:
    state = bench.links[COMPARTMENT].last(DoorState)
    return state.input_door, state.output_door


def test_a_door_travels_closes_and_is_bolted_in_time() -> None:
    bench = Bench()
    bench.door(DoorName.INPUT, DoorAction.OPEN)
    bench.door(DoorName.INPUT, DoorAction.CLOSE)
    changes: list[tuple[int, DoorPosition]] = []
    for time_us, state in bench.links[COMPARTMENT].all(DoorState):
        if not changes or changes[-1][1] is not state.input_door:
            changes.append((time_us, state.input_door))
    assert changes == [
        (0, DoorPosition.LOCKED),
        (0, DoorPosition.OPENING),
        (3_000_000, DoorPosition.OPEN),
        (4_000_000, DoorPosition.CLOSING),
        (7_000_000, DoorPosition.CLOSED),
        (7_300_000, DoorPosition.LOCKED),
    ]


def test_a_door_turned_back_half_way_needs_half_the_time() -> None:
    bench = Bench()
    for action in (DoorAction.OPEN, DoorAction.CLOSE):
        bench.links[COMPARTMENT].order(DoorOrder(COMPARTMENT, 1, DoorName.INPUT, action))
        bench.timers.run_for(1_000_000)
    assert positions(bench)[0] is DoorPosition.CLOSED


@pytest.mark.parametrize(("first", "second"), [(DoorName.INPUT, DoorName.OUTPUT), (DoorName.OUTPUT, DoorName.INPUT)])
@pytest.mark.parametrize("moment_us", [0, 1_000_000, 4_000_000, 8_500_000, 8_800_000])
def test_the_second_door_ignores_orders_unless_the_first_is_locked(
    first: DoorName, second: DoorName, moment_us: int
) -> None:
    bench = Bench()
    bench.links[COMPARTMENT].order(DoorOrder(COMPARTMENT, 1, first, DoorAction.OPEN))
    bench.timers.call_at(5_600_000, lambda: bench.compartments[COMPARTMENT].doors[first].order(DoorAction.CLOSE))
    bench.timers.run_until(moment_us)
    bench.door(second, DoorAction.OPEN)
    assert bench.world.bays[COMPARTMENT].doors[second] is DoorPosition.LOCKED
    assert bench.compartments[COMPARTMENT].doors[second].interlock_refusals == 1
    bench.timers.run_until(8_900_000)
    bench.door(second, DoorAction.OPEN)
    assert bench.world.bays[COMPARTMENT].doors[second] is DoorPosition.OPEN
    assert bench.rules == []


def test_a_forced_input_door_keeps_the_output_door_shut() -> None:
    bench = Bench()
    bench.compartments[COMPARTMENT].doors[DoorName.INPUT].force()
    bench.door(DoorName.OUTPUT, DoorAction.OPEN)
    assert positions(bench) == (DoorPosition.FORCED, DoorPosition.LOCKED)
    bench.door(DoorName.INPUT, DoorAction.CLOSE)
    assert positions(bench)[0] is DoorPosition.LOCKED
    bench.door(DoorName.OUTPUT, DoorAction.OPEN)
    assert positions(bench)[1] is DoorPosition.OPEN


def test_p60_the_input_door_opens_again_for_a_person_and_closes_when_they_left() -> None:
    bench = Bench()
    bench.door(DoorName.INPUT, DoorAction.OPEN)
    bench.links[COMPARTMENT].order(DoorOrder(COMPARTMENT, 2, DoorName.INPUT, DoorAction.CLOSE))
    bench.timers.run_for(500_000)
    bench.world.person_enters(COMPARTMENT)  # jumps in between the closing leaves
    assert positions(bench)[0] is DoorPosition.OPENING
    bench.timers.run_for(30 * SECOND)
    assert positions(bench)[0] is DoorPosition.OPEN
    bench.world.person_leaves(COMPARTMENT)
    bench.timers.run_for(6 * SECOND)
    assert positions(bench)[0] is DoorPosition.LOCKED
    # The oracle saw the jump, and nothing else.
    assert bench.rules == ["PERSON_BY_OPEN_DOOR"]


def test_p60_the_input_door_does_not_close_on_a_car_not_fully_in() -> None:
    bench = Bench()
    bench.door(DoorName.INPUT, DoorAction.OPEN)
    bench.world.begin_crossing(COMPARTMENT)
    assert bench.links[COMPARTMENT].last(BayState).person_inside
    bench.door(DoorName.INPUT, DoorAction.CLOSE)
    assert positions(bench)[0] is DoorPosition.OPEN
    bench.world.car_enters(COMPARTMENT, CAR)
    bench.timers.run_for(6 * SECOND)
    assert positions(bench)[0] is DoorPosition.LOCKED


def test_p60_the_output_door_stays_shut_while_a_person_is_inside() -> None:
    bench = Bench()
    bench.world.person_enters(COMPARTMENT)  # through the wall: only the light curtain knows
    bench.door(DoorName.OUTPUT, DoorAction.OPEN)
    assert positions(bench)[1] is DoorPosition.LOCKED
    assert bench.compartments[COMPARTMENT].doors[DoorName.OUTPUT].interlock_refusals == 1


def test_the_output_door_does_not_close_on_the_shuttle() -> None:
    bench = Bench()
    bench.drive_to_index(4, 1)
    bench.door(DoorName.OUTPUT, DoorAction.OPEN)
    bench.shuttle(ShuttleAction.REACH, 1, Side.NEAR)
    bench.door(DoorName.OUTPUT, DoorAction.CLOSE)
    assert positions(bench)[1] is DoorPosition.OPEN
    bench.shuttle(ShuttleAction.RETRACT, 2, Side.NEAR)
    assert positions(bench)[1] is DoorPosition.LOCKED
    assert bench.rules == []


def test_the_bay_senses_car_and_carrier() -> None:
    bench = Bench()
    assert bench.links[COMPARTMENT].last(BayState) == BayState(COMPARTMENT, 0, 0, 0, 0, False, False, 0)
    bench.world.car_enters(COMPARTMENT, CAR)
    assert bench.links[COMPARTMENT].last(BayState) == BayState(COMPARTMENT, 1400, 4300, 1500, 2700, False, False, 0)
    bench.drive_to_index(4, 1)
    seen = bench.links[COMPARTMENT].all(BayState)
    # Not while the carrier only passes or is still moving: 8 segments at 1500 mm/s take 12.8 + 3 s.
    assert next(time_us for time_us, state in seen if state.carrier_in_front) == 15_800_000
    assert bench.links[COMPARTMENT].last(BayState).carrier_in_front
    bench.drive_to_index(3, 2)
    assert not bench.links[COMPARTMENT].last(BayState).carrier_in_front


def test_doors_and_bay_are_told_slowly_while_nothing_changes() -> None:
    bench = Bench()
    bench.timers.run_until(60 * SECOND)
    assert len(bench.links[COMPARTMENT].all(DoorState)) == len(bench.links[COMPARTMENT].all(BayState)) == 7


def test_light_is_told_back() -> None:
    bench = Bench()
    bench.light(LightColour.GREEN)
    assert bench.links[COMPARTMENT].last(DoorState).light is LightColour.GREEN


def test_the_desk_says_each_act_three_times_under_one_sequence() -> None:
    bench = Bench()
    bench.compartments[COMPARTMENT].press_key()
    bench.timers.run_for(SECOND)
    code = 3 << 40 | 5
    bench.compartments[COMPARTMENT].insert_ticket(Ticket(Reference(1, 7), code))
    bench.timers.run_for(SECOND)
    said = [(t, e.sequence, e.event, e.car) for t, e in bench.links[COMPARTMENT].all(DeskEvent)]
    none, ticket = Reference(0, 0), Reference(1, 7)
    assert said == [
        *[(time_us, 1, DeskInput.KEY, none) for time_us in (0, 50_000, 100_000)],
        *[(SECOND + time_us, 2, DeskInput.TICKET, ticket) for time_us in (0, 50_000, 100_000)],
    ]
    read = [(t, e.sequence, e.half, e.code) for t, e in bench.links[COMPARTMENT].all(TicketRead)]
    assert read == [
        (SECOND + time_us, 2, half, code) for time_us in (0, 50_000, 100_000) for half, code in enumerate((5, 3))
    ]


def test_the_desk_prints_one_ticket_for_an_order_repeated() -> None:
    bench = Bench()
    for sequence in (1, 1, 2):
        bench.links[COMPARTMENT].order(TicketPrint(COMPARTMENT, sequence, 0, 7))
        bench.links[COMPARTMENT].order(TicketPrint(COMPARTMENT, sequence, 1, sequence))
        order = DeskOrder(COMPARTMENT, sequence, DeskText.TAKE_TICKET, Reference(1, 9 + sequence))
        bench.links[COMPARTMENT].order(order)
    printed = [Ticket(Reference(1, 10), 1 << 40 | 7), Ticket(Reference(1, 11), 2 << 40 | 7)]
    assert bench.compartments[COMPARTMENT].tickets_printed == printed


def test_no_ticket_is_printed_without_its_whole_code() -> None:
    bench, order = Bench(), DeskOrder(COMPARTMENT, 1, DeskText.TAKE_TICKET, Reference(1, 9))
    desk = bench.compartments[COMPARTMENT]
    for lost in (TicketPrint(COMPARTMENT, 1, 1, 7), TicketPrint(COMPARTMENT, 2, 0, 7)):
        bench.links[COMPARTMENT].order(lost)
        bench.links[COMPARTMENT].order(order)
        assert (desk.tickets_printed, desk.text) == ([], DeskText.WELCOME)
    for half in (0, 1):
        bench.links[COMPARTMENT].order(TicketPrint(COMPARTMENT, 1, half, 7))
    bench.links[COMPARTMENT].order(order)
    assert [one.car for one in desk.tickets_printed] == [Reference(1, 9)], "the order comes again with its code"


def test_a_car_lifted_by_the_shuttle_weighs_nothing_on_the_bay() -> None:
    bench = Bench()
    bench.world.car_enters(COMPARTMENT, CAR)
    bench.drive_to_index(4, 1)
    bench.door(DoorName.OUTPUT, DoorAction.OPEN)
    bench.shuttle(ShuttleAction.REACH, 1, Side.NEAR)
    bench.shuttle(ShuttleAction.GRIP, 2, Side.NEAR)
    assert bench.links[COMPARTMENT].last(BayState).load_kg == 0
    assert bench.world.car_aboard(ROBOT) == CAR
