"""What a desk makes of tickets: a right one fetches, a number alone does not, and five wrong ones shut the slot."""

from dataclasses import replace

import pytest

from onboard.contract.codes import DeskInput, DeskText, DoorPosition, LightColour, OperatorAction, Reason
from onboard.contract.messages import (
    BayState,
    CarAt,
    DeskEvent,
    DeskOrder,
    Diagnostic,
    DoorState,
    Message,
    OperatorOrder,
    Reference,
    TicketPrint,
    TicketRead,
)
from onboard.core.effects import Effect, Record, Report, Send, Tell
from onboard.core.frame import Frame
from onboard.holon.holon import Holon
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.tickets import CODE_BITS, Ticket, TicketCodes, split
from onboard.systems.contract import codecs_for
from onboard.systems.registry import factory_for, with_secrets
from onboard.wire.untold import untold
from tests.sites import one_floor

SITE = car_park(one_floor())
BAY, ROBOT = 1, 11
CAR, OTHER = Reference(BAY, 7), Reference(BAY, 8)
SECRET, OLD = bytes(range(32)), bytes(range(32, 64))
WHEELBASE_MM = 2_700
MINUTE = 60_000_000


class Desk:
    """A compartment that knows two cars which a robot has stored; acts at its desk, and what comes of them."""

    def __init__(self, *secrets: bytes) -> None:
        factory = with_secrets(factory_for(SITE, SITE.machines[BAY].kind), secrets or (SECRET,))
        self.holon = Holon(SITE, SITE.machines[BAY], factory, boot=1)
        self.holon.start(0)
        self.holon.tokens.trust()
        self.now_us, self.sequence = 1_000, 0
        for number, car in enumerate((CAR, OTHER)):
            place = SITE.places[number].number
            self.holon.receive(CarAt(ROBOT, car, place, 2, WHEELBASE_MM), self.now_us)

    def sense(self, *messages: Message) -> list[Effect]:
        return [effect for one in messages for effect in self.holon.sense(one, self.now_us)]

    def act(self, ticket: Ticket, event: DeskInput = DeskInput.TICKET) -> list[Effect]:
        self.sequence = self.sequence % 255 + 1
        halves = enumerate(split(ticket.code))
        read = [TicketRead(BAY, self.sequence, half, code) for half, code in halves]
        return self.sense(*read, DeskEvent(BAY, self.sequence, event, ticket.car))

    def counted(self) -> dict[Reason, int]:
        """What the machine says on the bus of what came to nothing."""
        self.now_us += 2_000_000
        said = [one.message for one in self.holon.wake(self.now_us) if isinstance(one, Send)]
        return {one.reason: one.count for one in said if isinstance(one, Diagnostic)}


def right(car: Reference = CAR, secret: bytes = SECRET) -> Ticket:
    return Ticket(car, TicketCodes((secret,)).code(car))


def shown(effects: list[Effect]) -> list[DeskText]:
    orders = [one.message for one in effects if isinstance(one, Tell)]
    return [one.text for one in orders if isinstance(one, DeskOrder)]


def asked_for(effects: list[Effect]) -> bool:
    """Whether the car is now to be fetched: that is written down."""
    return any(one.entry["record"] in ("ticket", "ahead") for one in effects if isinstance(one, Record))


def printed(effects: list[Effect]) -> int:
    halves = [one.message for one in effects if isinstance(one, Tell)]
    found = {one.half: one.code for one in halves if isinstance(one, TicketPrint)}
    return found[1] << CODE_BITS // 2 | found[0]


@pytest.mark.parametrize("event", [DeskInput.TICKET, DeskInput.CANCEL])
def test_the_number_of_a_car_fetches_nothing(event: DeskInput) -> None:
    for wrong in (Ticket(CAR, 0), Ticket(CAR, right().code ^ 1), Ticket(CAR, right(OTHER).code), right(CAR, OLD)):
        desk = Desk()
        effects = desk.act(wrong, event)
        assert (shown(effects), asked_for(effects)) == ([DeskText.UNKNOWN_TICKET], False)
    effects = Desk().act(right(), event)
    assert (shown(effects), asked_for(effects)) == ([DeskText.PLEASE_WAIT], True)


def test_a_ticket_that_was_printed_is_the_one_that_fetches_at_every_desk_and_after_a_lost_journal() -> None:
    desk = Desk()
    desk.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN))
    desk.sense(BayState(BAY, 1_500, 4_300, 1_500, WHEELBASE_MM, True, False, 0))
    effects = desk.sense(DeskEvent(BAY, 1, DeskInput.KEY, Reference(0, 0)))
    car = next(one.message.car for one in effects if isinstance(one, Tell) and isinstance(one.message, DeskOrder))
    at_another = Desk()
    at_another.holon.receive(CarAt(ROBOT, car, SITE.places[2].number, 2, WHEELBASE_MM), at_another.now_us)
    assert asked_for(at_another.act(Ticket(car, printed(effects))))


def test_half_a_code_is_no_try_and_a_repeat_brings_the_rest() -> None:
    desk, (low, high) = Desk(), split(right().code)
    event = DeskEvent(BAY, 1, DeskInput.TICKET, CAR)
    assert desk.sense(TicketRead(BAY, 1, 0, low), event, TicketRead(BAY, 2, 1, high), event) == []
    assert asked_for(desk.sense(TicketRead(BAY, 1, 0, low), TicketRead(BAY, 1, 1, high)))
    assert desk.sense(event) == [], "once"
    assert Reason.UNKNOWN_TICKET not in desk.counted()


def test_five_wrong_tickets_lock_the_desk_for_a_minute_which_customer_and_bus_are_told() -> None:
    desk = Desk()
    tries = [shown(desk.act(Ticket(CAR, code))) for code in range(4)]
    assert tries == [[DeskText.UNKNOWN_TICKET]] * 4
    fifth = desk.act(Ticket(OTHER, 4))
    assert shown(fifth) == [DeskText.TOO_MANY_TRIES], "whichever car was tried"
    assert any(isinstance(one, Report) and "5 wrong tickets" in one.text for one in fifth)
    locked = desk.act(right())
    assert (shown(locked), asked_for(locked)) == ([DeskText.TOO_MANY_TRIES], False)
    locked_us = desk.now_us
    counted = desk.counted()
    assert (counted[Reason.UNKNOWN_TICKET], counted[Reason.NOT_AUTHORISED]) == (5, 2)
    desk.now_us = locked_us + MINUTE - 1
    assert not asked_for(desk.act(right()))
    desk.now_us = locked_us + MINUTE
    assert asked_for(desk.act(right()))


def test_ones_own_ticket_between_guesses_makes_them_no_cheaper() -> None:
    desk = Desk()
    for code in range(4):
        desk.act(Ticket(CAR, code))
        desk.act(right(OTHER))
    assert shown(desk.act(Ticket(CAR, 4))) == [DeskText.TOO_MANY_TRIES]


def test_slips_of_a_long_day_lock_nothing() -> None:
    desk = Desk()
    for code in range(20):
        assert shown(desk.act(Ticket(CAR, code))) == [DeskText.UNKNOWN_TICKET]
        desk.now_us += 3 * MINUTE


def test_a_car_comes_in_at_a_locked_desk() -> None:
    desk = Desk()
    for code in range(5):
        desk.act(Ticket(CAR, code))
    desk.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN))
    desk.sense(BayState(BAY, 1_500, 4_300, 1_500, WHEELBASE_MM, True, False, 0))
    assert shown(desk.sense(DeskEvent(BAY, 9, DeskInput.KEY, Reference(0, 0)))) == [DeskText.TAKE_TICKET]


def test_tickets_under_the_secret_before_still_fetch_and_older_ones_do_not() -> None:
    newest = bytes(32)
    assert asked_for(Desk(newest, SECRET).act(right()))
    assert not asked_for(Desk(newest, OLD).act(right()))


def test_nothing_of_a_code_is_said_on_the_fleet_bus_kept_or_told_in_words() -> None:
    desk = Desk()
    desk.sense(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN))
    desk.sense(BayState(BAY, 1_500, 4_300, 1_500, WHEELBASE_MM, True, False, 0))
    effects = desk.sense(DeskEvent(BAY, 1, DeskInput.KEY, Reference(0, 0)))
    effects += desk.act(Ticket(CAR, 5)) + desk.act(right())
    codes = [printed(effects), right().code]
    parts = [str(half) for code in codes for half in split(code)] + [f"{half:x}" for c in codes for half in split(c)]
    seen = [repr(one) for one in effects if not isinstance(one, Tell)]
    assert len(seen) > 5
    assert not [part for part in parts for one in seen if part in one]


def test_a_log_of_a_device_bus_has_acts_and_no_codes() -> None:
    codec = codecs_for(SITE).device
    for word in (TicketPrint(BAY, 9, 1, split(right().code)[1]), TicketRead(BAY, 9, 1, split(right().code)[1])):
        (frame,) = codec.encode(word)
        assert codec.decode_part(untold(frame)) == replace(word, code=0)
    (frame,) = codec.encode(DeskEvent(BAY, 9, DeskInput.TICKET, CAR))
    assert untold(frame) == frame
    assert untold(Frame(frame.arbitration_id, b"\1", is_error=True)).data == b"\1"


@pytest.mark.parametrize("action", [OperatorAction.INSERT_TICKET, OperatorAction.URGENT_TICKET])
def test_who_answers_for_an_order_from_afar_needs_no_ticket(action: OperatorAction) -> None:
    """A tool's node is believed as far as the bus proves it: docs/security.md."""
    desk = Desk()
    assert asked_for(desk.holon.receive(OperatorOrder(251, BAY, action, CAR), desk.now_us))
