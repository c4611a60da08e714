"""Rules that need device buses, and rules about life."""

from dataclasses import replace

import pytest

from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    DriveMode,
    LightColour,
    OperatorAction,
    Reason,
    ShuttleAction,
    ShuttleMode,
    Side,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import (
    BayState,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    DriveOrder,
    DriveState,
    Message,
    OperatorOrder,
    Reference,
    ShuttleOrder,
    ShuttleState,
    Waiting,
)
from onboard.systems.car_park.site import SizeClass
from onboard.ways.site import way_site
from tests.sites import one_floor
from tests.trace.checking import CAR, MR1, MR2, Tape, at, award, bid, call, car_at, one_alley, power_up, report

OPEN, LOCKED, CLOSING, OPENING = DoorPosition.OPEN, DoorPosition.LOCKED, DoorPosition.CLOSING, DoorPosition.OPENING


def shuttle(mode: ShuttleMode = ShuttleMode.HOME, out_mm: int = 0, node: int = MR1) -> ShuttleState:
    return ShuttleState(node, 0, mode, out_mm, Side.NEAR, 0, 1800)


def drive(mode: DriveMode = DriveMode.STANDING, speed_mm_s: int = 0) -> DriveState:
    return DriveState(MR1, 0, 7200, speed_mm_s, mode, at_mark=True)


def order(action: ShuttleAction, wheelbase_mm: int = 2700, side: Side = Side.NEAR) -> ShuttleOrder:
    return ShuttleOrder(MR1, 1, action, side, wheelbase_mm)


def bay(load_kg: int = 0, *, person: bool = False) -> BayState:
    return BayState(1, load_kg, 4000, 1500, 2700, person_inside=person, carrier_in_front=False, width_mm=0)


def doors(outer: DoorPosition, inner: DoorPosition) -> DoorState:
    return DoorState(1, outer, inner, LightColour.GREEN)


def before_bay() -> Tape:
    """MR1 before the compartment, a car in it; nobody knows whose the slots are."""
    return Tape(one_alley(), started=False).say(1, at(MR1, 1, 4), drive(), shuttle(), car_at(1, 0x0104, 1))


# --- a shuttle pair tearing a car in half


def test_a_car_is_taken_whole() -> None:
    tape = before_bay().say(2, order(ShuttleAction.REACH), shuttle(ShuttleMode.REACHED, 5400))
    tape.say(3, order(ShuttleAction.GRIP), shuttle(ShuttleMode.GRIPPING, 5400), shuttle(ShuttleMode.REACHED, 5400))
    tape.say(4, order(ShuttleAction.RETRACT), shuttle(ShuttleMode.MOVING, 5400), shuttle())
    assert tape.say(5, drive(DriveMode.MOVING, 300)).broken() == {}


TORN: dict[str, list[Message]] = {
    "the carrier moves": [shuttle(ShuttleMode.REACHED, 5400), drive(DriveMode.MOVING, 300)],
    "the carrier is sent away": [shuttle(ShuttleMode.MOVING, 100), DriveOrder(MR1, 1, 9600, 1500)],
    "the shuttle moves while it grips": [shuttle(ShuttleMode.GRIPPING, 5400), order(ShuttleAction.RETRACT)],
    "the other side": [shuttle(ShuttleMode.MOVING, 100), order(ShuttleAction.REACH, side=Side.FAR)],
    "the wrong wheelbase": [shuttle(ShuttleMode.REACHED, 5400), order(ShuttleAction.GRIP, 2500)],
    "two shuttles at one car": [
        shuttle(ShuttleMode.REACHED, 5400),
        at(MR2, 1, 4),
        shuttle(ShuttleMode.REACHED, 5400, MR2),
    ],
}


@pytest.mark.parametrize("messages", TORN.values(), ids=TORN.keys())
def test_a_shuttle_pair_tearing_a_car_in_half_is_found(messages: list[Message]) -> None:
    assert before_bay().say(2, *messages).broken()["torn-car"] == 1


# --- doors


def test_doors_of_a_compartment_in_their_order() -> None:
    tape = before_bay().say(2, doors(OPEN, LOCKED), bay(1400, person=True), bay(1400), doors(CLOSING, LOCKED))
    tape.say(3, doors(LOCKED, LOCKED), DoorOrder(1, 1, DoorName.OUTPUT, DoorAction.OPEN), doors(LOCKED, OPEN))
    assert tape.say(4, shuttle(ShuttleMode.MOVING, 100)).broken() == {}


def test_a_person_may_come_out_where_the_word_that_the_door_is_open_was_lost() -> None:
    tape = before_bay().say(2, doors(OPENING, LOCKED), bay(1400, person=True), bay(1400))
    assert tape.broken() == {}


UNSAFE: dict[str, list[Message]] = {
    "neither locked": [doors(CLOSING, OPEN), doors(CLOSING, OPEN)],
    "told to open beside an open one": [doors(OPEN, LOCKED), DoorOrder(1, 1, DoorName.OUTPUT, DoorAction.OPEN)],
    "a person with the machines": [doors(LOCKED, LOCKED), bay(1400, person=True), doors(LOCKED, OPEN)],
    "told to open with a person inside": [
        doors(LOCKED, LOCKED),
        bay(1400, person=True),
        DoorOrder(1, 1, DoorName.OUTPUT, DoorAction.OPEN),
    ],
    "a person through a closed door": [doors(LOCKED, LOCKED), bay(1400), bay(1400, person=True)],
    "a shuttle behind a closed door": [doors(OPEN, LOCKED), shuttle(ShuttleMode.MOVING, 100)],
    "a door closed on a shuttle": [
        doors(LOCKED, OPEN),
        shuttle(ShuttleMode.MOVING, 100),
        doors(LOCKED, CLOSING),
    ],
}


@pytest.mark.parametrize("messages", UNSAFE.values(), ids=UNSAFE.keys())
def test_an_unsafe_door_is_found(messages: list[Message]) -> None:
    assert before_bay().say(2, *messages).broken() == {"doors": 1}


# --- customers


def key() -> DeskEvent:
    return DeskEvent(1, 1, DeskInput.KEY, Reference(0, 0))


def word(text: DeskText, car: Reference = CAR) -> DeskOrder:
    return DeskOrder(1, 1, text, car)


def test_a_customer_without_a_word_is_found() -> None:
    asked = Tape(one_alley()).say(1, bay(1400), key())
    assert asked.broken(70) == {"customers-served": 1}
    told = Tape(one_alley()).say(1, bay(1400), key()).say(2, word(DeskText.TAKE_TICKET)).say(3, key())
    assert told.broken(70) == {}, "the second press asks nothing new"
    assert Tape(one_alley()).say(1, bay(0), key()).broken(70) == {}, "a key without a car asks nothing"
    fetched = Tape(one_alley()).say(1, bay(1400)).say(2, word(DeskText.CAR_READY)).say(3, key())
    assert fetched.broken(70) == {}, "nor does one before a car that was brought for its owner"


def test_a_ticket_that_leads_to_nothing_is_found() -> None:
    ticket = DeskEvent(1, 1, DeskInput.TICKET, CAR)
    assert Tape(one_alley()).say(1, ticket).broken(3_700) == {"customers-served": 1}
    assert Tape(one_alley()).say(1, ticket).say(600, word(DeskText.CAR_READY)).broken(3_700) == {}
    assert Tape(one_alley()).say(1, ticket).say(2, word(DeskText.UNKNOWN_TICKET)).broken(3_700) == {}


def test_full_means_full() -> None:
    assert Tape(one_alley()).say(1, word(DeskText.FULL)).broken() == {"full-means-full": 1}
    full = Tape(one_alley())
    for number, place in enumerate(way_site(one_alley()).places, start=1):
        car = Reference(1, number)
        full.say(number, car_at(1, 0x0104, 1, car), car_at(MR1, ANY_STATION, 2, car), car_at(1, place.number, 3, car))
    full.say(100, word(DeskText.FULL))
    assert "full-means-full" not in full.verdict().counts
    assert Tape(one_alley(), disturbed=True).say(1, word(DeskText.FULL)).broken() == {}
    gone = Tape(one_alley()).say(1, car_at(1, 0x0104, 1), car_at(1, OUTSIDE, 1), word(DeskText.FULL))
    assert gone.broken() == {"full-means-full": 1}


def test_full_means_full_for_the_class_of_the_car_before_the_desk() -> None:
    site = one_floor(2)
    long, plug, *short = site.places
    classes = (
        SizeClass("short", 3_900, 1_600, 2_000),
        SizeClass("long", 4_500, 1_600, 2_000),
        SizeClass("plug", 4_500, 1_600, 2_000, charging=True),
    )
    of_place = {**{place.number: 1 for place in short}, long.number: 2, plug.number: 3}
    site = replace(site, classes=classes, place_class=of_place)
    other, charging = Reference(1, 9), DeskEvent(1, 1, DeskInput.CHARGING_KEY, Reference(0, 0))
    from_afar = OperatorOrder(251, 1, OperatorAction.CHARGING_KEY, Reference(0, 0))

    def is_true(*taken: Message, pressed: Message, text: DeskText) -> bool:
        tape = Tape(site).say(1, *taken, bay(1400), pressed).say(2, word(text))
        return "full-means-full" not in tape.broken()

    both = (car_at(1, long.number, 1), car_at(1, plug.number, 1, other))
    # It is 4,000 mm long; who does not charge may stand where one can.
    assert is_true(*both, pressed=key(), text=DeskText.FULL)
    assert not is_true(both[0], pressed=key(), text=DeskText.FULL)
    assert is_true(both[1], pressed=charging, text=DeskText.NO_CHARGING)
    assert is_true(both[1], pressed=from_afar, text=DeskText.NO_CHARGING)
    assert not is_true(both[0], pressed=charging, text=DeskText.NO_CHARGING)
    assert not is_true(both[0], pressed=from_afar, text=DeskText.NO_CHARGING)


# --- life


def awarded() -> Tape:
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), call(1, 2), bid(MR1, 50_000))
    return tape.say(2, award(MR1), report(MR1, TaskPhase.AWARDED))


def test_nothing_happens_while_there_is_work() -> None:
    assert awarded().broken(60) == {}
    assert awarded().say(130, power_up()).broken(140) == {"something-happens": 1}
    idle = awarded().say(10, report(MR1, TaskPhase.REFUSED, reason=Reason.PARK_FULL))
    assert idle.broken(1_000) == {}, "without a task nothing need happen"


def test_an_award_said_again_and_again_is_no_progress() -> None:
    tape = awarded()
    for second in range(3, 140):
        tape.say(second, award(MR1))
    assert tape.broken() == {"something-happens": 1}


def test_a_machine_that_waits_for_ever_is_found_and_every_wait_is_told() -> None:
    waits = Waiting(MR1, 1, 8, MR2, Reason.TOKEN_HELD_BY_OTHER)
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), waits).say(31, at(MR1, 1, 12, 0, -100))
    verdict = tape.verdict()
    assert verdict.is_good and verdict.waits_us == {MR1: 30_000_000}
    assert verdict.wait_limit_us is not None
    limit_s = verdict.wait_limit_us / 1e6
    late = Tape(one_alley()).say(1, waits).say(20, waits).broken(limit_s + 2)
    assert late == {"nobody-starves": 1}
