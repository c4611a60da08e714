"""The custody of a car: its token and the word where it stands are passed on together, whatever fails in between."""

from collections.abc import Iterable
from dataclasses import replace

import pytest

from onboard.contract.codes import (
    CallResult,
    DeskInput,
    DeskText,
    DoorPosition,
    DriveMode,
    LightColour,
    Operation,
    Reason,
    ShuttleMode,
    Side,
    TaskPhase,
    TokenKind,
)
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import (
    Award,
    BayState,
    BusTime,
    CallForProposals,
    CarAt,
    DeskEvent,
    DeskOrder,
    DoorState,
    DriveState,
    EmergencyStop,
    Go,
    Message,
    Reference,
    ShuttleState,
    SyncRequest,
    TaskReport,
    TokenGrant,
    TokenHeld,
)
from onboard.core.authority import station_token
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.negotiation.winners import LOST_AFTER_US
from onboard.core.site import Station
from onboard.holon.holon import Holon
from onboard.systems.car_park.bay_memory import winner_record
from onboard.systems.car_park.site import CarPark
from onboard.systems.registry import factory_for
from onboard.ways.tokens import car_token
from tests.kinds.board import CALL
from tests.sites import one_floor

SITE = one_floor()
BAY, ROBOT, STRANGER = 1, 11, 200
CAR, TASK, WHEELBASE_MM = Reference(BAY, 1), Reference(BAY, 7), 2_600
HERE = SITE.compartments[BAY].number
PLACE = SITE.places[0].number
#: A second compartment.
ANOTHER = '[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,9)"\n'
Entry = dict[str, str | int]
PARKING: Entry = {"record": "job", "task_origin": BAY, "task": 1, "operation": int(Operation.PARK)}
PARKING |= {"car_origin": BAY, "car": 1, "wheelbase_mm": WHEELBASE_MM}


def token_entry(record: str, version: int, holder: int) -> Entry:
    key = car_token(*CAR)
    return {"record": record, "kind": int(key.kind), "number": key.number, "version": version, "holder": holder}


#: The compartment made the car and gave it to the robot, which has said that it has it.
GIVEN = [token_entry("token_held", 1, BAY), token_entry("token_given", 2, ROBOT), token_entry("token_gone", 2, ROBOT)]


def machine(node: int, entries: Iterable[Entry] = (), site: CarPark = SITE) -> Holon:
    """A machine with its journal, that knows the bus time; no other is there that could know better."""
    past: list[Entry] = [{"record": "boot", "boot": 1}, *entries] if entries else []
    made = Holon(
        site, site.machines[node], factory_for(site, site.machines[node].kind), boot=len(past[:1]) + 1, entries=past
    )
    made.start(0)
    if node != BAY:
        made.receive(BusTime(BAY, 0), 0)
    made.tokens.trust()
    return made


def said(effects: list[Effect]) -> list[Message]:
    return [effect.message for effect in effects if isinstance(effect, Send)]


def records(effects: list[Effect]) -> list[Entry]:
    return [dict(effect.entry) for effect in effects if isinstance(effect, Record)]


def grant(version: int, sender: int = ROBOT, holder: int = BAY) -> TokenGrant:
    return TokenGrant(sender, TokenKind.CAR, car_token(*CAR).number, version, holder)


def put_down(station: int = PLACE, version: int = 2) -> CarAt:
    """The robot's word, under the version before that of its grant."""
    return CarAt(ROBOT, CAR, station, version, WHEELBASE_MM)


def test_who_keeps_one_station_takes_no_car_that_stands_in_anothers() -> None:
    """All that it heard of the car is where it was before: it had it on paper there, and nobody had it where it is."""
    site = one_floor(extra=ANOTHER)
    keeper = machine(BAY, GIVEN, site)
    keeper.receive(put_down(site.compartments[2].number), 1)
    assert not [word for word in said(keeper.receive(grant(3), 2)) if isinstance(word, TokenHeld)]
    keeper.receive(put_down(), 3)
    assert [word for word in said(keeper.receive(grant(3), 4)) if isinstance(word, TokenHeld)]


@pytest.mark.parametrize(
    "heard",
    [
        [],
        [put_down(ANY_STATION)],
        [put_down(PLACE, 1)],
    ],
    ids=["nothing", "aboard", "older"],
)
def test_a_steward_takes_no_car_before_its_giver_has_said_where_it_stands(heard: list[CarAt]) -> None:
    steward = machine(BAY, GIVEN)
    for word in heard:
        steward.receive(word, 10)
    assert said(steward.receive(grant(3), 20)) == [], "as if it had not been heard"
    both = [*steward.receive(put_down(), 30), *steward.receive(grant(3), 40)]
    assert TokenHeld(BAY, TokenKind.CAR, car_token(*CAR).number, 3) in said(both)
    assert CarAt(BAY, CAR, PLACE, 3, WHEELBASE_MM) in said(both)


def test_a_robot_takes_no_car_that_it_neither_needs_nor_knows_the_place_of() -> None:
    """It could not give it back, and who gave it would be free to forget where the car stands."""
    robot = machine(ROBOT)
    late = grant(2, BAY, ROBOT)
    assert not any(isinstance(word, TokenHeld) for word in said(robot.receive(late, 20))), "as if it had not been heard"
    both = [*robot.receive(CarAt(BAY, CAR, HERE, 1, WHEELBASE_MM), 30), *robot.receive(late, 40)]
    assert TokenHeld(ROBOT, TokenKind.CAR, car_token(*CAR).number, 2) in said(both)


def test_the_place_is_in_the_journal_before_the_token() -> None:
    steward = machine(BAY, GIVEN)
    written = records([*steward.receive(put_down(), 10), *steward.receive(grant(3), 20)])
    assert [entry["record"] for entry in written] == ["car_at", "token_held"]
    killed_between = machine(BAY, [journalled_place(BAY, HERE, 1), *GIVEN, *written[:1]])
    assert not any(isinstance(word, CarAt) for word in said(killed_between.receive(SyncRequest(ROBOT, BAY), 30)))
    again = [*killed_between.receive(put_down(), 40), *killed_between.receive(grant(3), 50)]
    assert CarAt(BAY, CAR, PLACE, 3, WHEELBASE_MM) in said(again)


def test_what_was_journalled_under_an_older_version_is_no_knowledge_of_the_place() -> None:
    entries = [journalled_place(BAY, HERE, 1), token_entry("token_held", 3, BAY)]
    assert not any(isinstance(word, CarAt) for word in said(machine(BAY, entries).receive(SyncRequest(ROBOT, BAY), 9)))


@pytest.mark.parametrize("is_restarted", [False, True])
def test_the_giver_says_the_place_again_with_each_repeated_grant(is_restarted: bool) -> None:
    """As long as the new custodian is not heard; also when the giver was killed in between."""
    entries = [token_entry("token_held", 2, ROBOT), journalled_place(ROBOT, PLACE, 2)]
    if is_restarted:
        robot = machine(ROBOT, [*entries, token_entry("token_given", 3, BAY)])
    else:
        robot = machine(ROBOT, entries)
        robot.tokens.give(car_token(*CAR), BAY, 0)
    again = said(robot.wake(SITE.timing.token_repeat_us))
    assert again.index(put_down()) == again.index(grant(3)) - 1
    robot.receive(CarAt(BAY, CAR, PLACE, 3, WHEELBASE_MM), 300_000)
    robot.receive(TokenHeld(BAY, TokenKind.CAR, car_token(*CAR).number, 3), 300_010)
    assert put_down() not in said(robot.wake(1_000_000))


def test_rights_that_come_after_their_work_was_dropped_go_back_with_the_word_where_the_car_stands() -> None:
    """A grant that is said again for long finds a robot that has given the task back: the car would be nobody's."""
    robot = machine(ROBOT)
    robot.sense(standing_at_home(robot), 10)
    robot.sense(ShuttleState(ROBOT, 0, ShuttleMode.HOME, 0, Side.NEAR, 0, 2_500), 10)
    robot.receive(CarAt(BAY, CAR, PLACE, 1, WHEELBASE_MM), 20)
    place = station_token(Station.from_number(PLACE))
    got = said(robot.receive(TokenGrant(BAY, TokenKind.STATION, place.number, 1, ROBOT), 30))
    assert TokenGrant(ROBOT, TokenKind.STATION, place.number, 2, BAY) in got
    got = said(robot.receive(grant(2, BAY, ROBOT), 40))
    assert got.index(put_down()) < got.index(grant(3))


def standing_at_home(robot: Holon) -> DriveState:
    home_mm = (robot.machine.home.index - 1) * SITE.tracks[1].pitch_mm
    return DriveState(ROBOT, 0, home_mm, 0, DriveMode.STANDING, True)


@pytest.mark.parametrize("has_gone_on", [False, True])
def test_a_robot_killed_before_it_said_done_says_so_when_it_knows_where_it_is(has_gone_on: bool) -> None:
    entries: list[Entry] = [{"record": "handled", "task_origin": BAY, "task": 7, "handling": "leave", "station": PLACE}]
    if has_gone_on:
        entries.append({"record": "step", "phase": "reach", "handling": "take", "station": PLACE, "car": 1})
    robot = machine(ROBOT, entries)
    standing = standing_at_home(robot)
    effects = robot.sense(standing, 10)
    reports = [word for word in said(effects) if isinstance(word, TaskReport)]
    done = [word for word in reports if word.phase is TaskPhase.DONE]
    assert [(word.task, word.station) for word in done] == ([] if has_gone_on else [(TASK, PLACE)])
    assert not any(isinstance(word, TaskReport) for word in said(robot.sense(standing, 20))), "once"


def test_who_presses_again_inside_gets_the_ticket_that_the_power_failed_to_print() -> None:
    bay = machine(BAY, [token_entry("token_held", 1, BAY), PARKING])
    bay.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), 10)
    first = bay.sense(BayState(BAY, 1_500, 4_300, 1_500, WHEELBASE_MM, True, False, 0), 20)
    assert CarAt(BAY, CAR, HERE, 1, WHEELBASE_MM) in said(first), "nor had it been said that the car is here"
    assert tickets(first) == []
    assert tickets(bay.sense(DeskEvent(BAY, 1, DeskInput.KEY, Reference(0, 0)), 30)) == [CAR]


def test_a_car_that_its_driver_took_out_while_the_bay_was_off_is_called_for_by_nobody() -> None:
    """It was given back, or its driver left by himself; the compartment knows by its sensors only."""
    entries = [token_entry("token_held", 1, BAY), journalled_place(BAY, HERE, 1), PARKING]
    bay, words = machine(BAY, entries), list[Message]()
    for now_us in range(100_000, 20_000_000, 100_000):
        doors = DoorState(BAY, DoorPosition.LOCKED, DoorPosition.LOCKED, LightColour.RED)
        for sensed in (doors, BayState(BAY, 0, 0, 0, 0, False, False, 0)):
            words += said(bay.sense(sensed, now_us))
        words += said(bay.wake(now_us))
    assert not any(isinstance(word, CallForProposals) for word in words)
    assert TaskReport(BAY, CAR, TaskPhase.REFUSED, HERE, Reason.CANCELLED) in words
    assert CarAt(BAY, CAR, OUTSIDE, 1, WHEELBASE_MM) in words


def tickets(effects: list[Effect]) -> list[Reference]:
    orders = [effect.message for effect in effects if isinstance(effect, Tell)]
    return [one.car for one in orders if isinstance(one, DeskOrder) and one.text is DeskText.TAKE_TICKET]


def journalled_place(node: int, station: int, version: int) -> Entry:
    assert Station.from_number(station) in (*SITE.places, *SITE.compartments.values()), node
    place = {"station": station, "version": version, "wheelbase_mm": WHEELBASE_MM}
    return {"record": "car_at", "car_origin": CAR.origin, "car": CAR.number, **place}


def test_a_steward_that_was_held_counts_no_winner_as_lost_by_that_time() -> None:
    """All were held by the same stop: whoever is let go first took the others' tasks from them."""
    winner = dict(winner_record(CAR, ROBOT, TASK, 1).entry)
    entries = [token_entry("token_held", 3, BAY), journalled_place(BAY, PLACE, 3), winner]
    steward, let_go_us, given_back_us = machine(BAY, entries), 40_000_000, list[int]()
    for now_us in range(100_000, 60_000_000, 100_000):
        if now_us < let_go_us and not now_us % 1_000_000:
            steward.receive(EmergencyStop(251, Reason.OPERATOR), now_us)
        if now_us == let_go_us:
            steward.receive(Go(251, 0), now_us)
        words = said(steward.wake(now_us))
        given_back_us += [
            now_us for word in words if isinstance(word, TaskReport) and word.phase is TaskPhase.FORFEITED
        ]
    assert given_back_us and given_back_us[0] >= let_go_us + LOST_AFTER_US


@pytest.mark.parametrize("word", ["call", "withdrawal"])
def test_a_steward_says_that_a_winner_is_lost_until_its_task_is_called_anew_or_off(word: str) -> None:
    """Of a car that nobody could fetch one said so every other second for half an hour (drawn car park 5799)."""
    winner = dict(winner_record(CAR, ROBOT, TASK, 1).entry)
    entries = [token_entry("token_held", 3, BAY), journalled_place(BAY, PLACE, 3), winner]
    steward, forfeited_us = machine(BAY, entries, one_floor(extra=ANOTHER)), list[int]()
    call = replace(CALL, sender=2, task=TASK, operation=Operation.RETRIEVE, from_station=PLACE, to_station=HERE)
    call = replace(call, car=CAR)
    withdrawn = Award(2, 0, 0, TASK, 0, CallResult.WITHDRAWN, Reason.CANCELLED)
    for now_us in range(100_000, 60_000_000, 100_000):
        words = said(steward.wake(now_us))
        forfeited_us += [now_us for one in words if isinstance(one, TaskReport) and one.phase is TaskPhase.FORFEITED]
        if now_us == 40_000_000:
            steward.receive(call if word == "call" else withdrawn, now_us)
    assert len(forfeited_us) > 5 and 38_000_000 <= forfeited_us[-1] <= 40_000_000
