"""A driver says when the car will be fetched: the compartment at which it came in notes it, and says so to all."""

from collections.abc import Iterable
from dataclasses import replace

import pytest

from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.announce_device import DeskFetch, DeskFetchAnswer
from onboard.contract.codes import DeskText, DoorPosition, LightColour
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import (
    BayState,
    CarAt,
    DeskOrder,
    DoorState,
    Message,
    Reference,
    SyncRequest,
    TicketRead,
)
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.journal_records import Entry
from onboard.core.serial import to_bus_ms
from onboard.holon.holon import Holon
from onboard.systems.car_park.fetch_times import ASK_AGAIN_US, ASKS, MOST_AHEAD_US, NOTE_APART_US
from onboard.systems.car_park.records import FetchTimeRecord
from onboard.systems.car_park.stays import Stays
from onboard.systems.registry import factory_for
from tests.system.test_desks import two

SITE = two("any")
HERE, THERE, ROBOT, GATEWAY = 1, 2, 11, 251
CAR, OTHERS_CAR = Reference(HERE, 7), Reference(THERE, 8)
SECOND = 1_000_000
#: An hour and a half.
LATER_S = 5_400


class Desk:
    """Compartment ``HERE``, which knows a car that came in there and one that came in at ``THERE``."""

    def __init__(self, entries: Iterable[Entry] = ()) -> None:
        machine = SITE.machines[HERE]
        past: list[Entry] = [{"record": "boot", "boot": 1}, *entries] if entries else []
        self.holon = Holon(SITE, machine, factory_for(SITE, machine.kind), boot=1 + bool(past), entries=past)
        self.now_us, self.sequence, self.entries = SECOND, 0, list[Entry]()
        self.holon.start(0)
        self.holon.tokens.trust()
        for number, car in enumerate((CAR, OTHERS_CAR)):
            self.hears(CarAt(ROBOT, car, SITE.places[number].number, 2, 2_700))
        self.holon.sense(DoorState(HERE, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), self.now_us)
        self.holon.sense(BayState(HERE, 0, 0, 0, 0, False, False, 0), self.now_us)

    def _did(self, effects: list[Effect]) -> list[Message]:
        self.entries += [one.entry for one in effects if isinstance(one, Record)]
        words = (FetchTime, DeskFetchAnswer, DeskOrder)
        said = [one.message for one in effects if isinstance(one, Send | Tell)]
        return [one for one in said if isinstance(one, words)]

    def hears(self, message: Message) -> list[Message]:
        return self._did(self.holon.receive(message, self.now_us))

    def announces(self, car: Reference, in_s: int = LATER_S, code: int = 0) -> list[Message]:
        self.sequence += 1
        read = [TicketRead(HERE, self.sequence, half, code) for half in range(2)]
        acts = (*read, DeskFetch(HERE, self.sequence, car, in_s), *read, DeskFetch(HERE, self.sequence, car, in_s))
        return [one for act in acts for one in self._did(self.holon.sense(act, self.now_us))]

    def until(self, end_us: int) -> list[Message]:
        said: list[Message] = []
        while (due_us := self.holon.next_wake()) is not None and due_us <= end_us:
            self.now_us = max(self.now_us, due_us)
            said += self._did(self.holon.wake(self.now_us))
        self.now_us = end_us
        return said

    def tells(self) -> list[Message]:
        """What it answers to who asks what others know."""
        return self.hears(SyncRequest(ROBOT, 0, 0)) + self.until(self.now_us + 5 * SECOND)


def at(in_s: int, word: FetchWord, *, sender: int = HERE, car: Reference = CAR) -> FetchTime:
    """What is said of a time so long after the desk's first second."""
    return FetchTime(sender, car, to_bus_ms(SECOND + in_s * SECOND), word)


def test_a_time_is_noted_and_said_to_all_before_the_customer_reads_so_and_once_for_each_act() -> None:
    desk = Desk()
    said = desk.announces(CAR)
    assert said == [at(LATER_S, FetchWord.NOTED), DeskFetchAnswer(HERE, CAR, LATER_S, FetchWord.NOTED)]
    assert FetchTimeRecord(CAR, at(LATER_S, FetchWord.NOTED).fetch_ms).entry in desk.entries


def test_whoever_was_away_hears_it_again_also_after_a_restart_until_the_car_has_left() -> None:
    desk = Desk()
    desk.announces(CAR)
    assert at(LATER_S, FetchWord.NOTED) in desk.tells()
    again = Desk(desk.entries)
    assert at(LATER_S, FetchWord.NOTED) in again.tells()
    again.hears(CarAt(ROBOT, CAR, OUTSIDE, 2, 2_700))
    assert again.tells() == []


def test_the_newest_time_counts() -> None:
    desk = Desk()
    desk.announces(CAR)
    desk.announces(CAR, in_s=60)
    assert desk.tells() == [at(60, FetchWord.NOTED)]
    assert Desk(desk.entries).tells() == [at(60, FetchWord.NOTED)]


@pytest.mark.parametrize(
    ("car", "in_s", "word"),
    [
        (Reference(HERE, 9), LATER_S, FetchWord.NOT_INSIDE),
        (Reference(ROBOT, 7), LATER_S, FetchWord.NOT_INSIDE),
        (CAR, 0, FetchWord.PAST),
        (CAR, MOST_AHEAD_US // SECOND + 1, FetchWord.TOO_FAR),
    ],
)
def test_a_time_that_cannot_be_is_refused_and_nothing_is_kept(car: Reference, in_s: int, word: FetchWord) -> None:
    desk = Desk()
    assert desk.announces(car, in_s) == [DeskFetchAnswer(HERE, car, in_s, word)]
    assert not desk.entries and desk.tells() == []


def test_without_the_right_ticket_nothing_is_noted() -> None:
    desk = Desk()
    (shown,) = desk.announces(CAR, code=1)
    assert isinstance(shown, DeskOrder) and shown.text is DeskText.UNKNOWN_TICKET
    assert desk.tells() == []


def test_a_car_of_another_compartment_is_asked_for_there() -> None:
    desk = Desk()
    asked = at(LATER_S, FetchWord.ASKED, car=OTHERS_CAR)
    assert desk.announces(OTHERS_CAR) == [asked]
    noted = replace(asked, sender=THERE, fetch_word=FetchWord.NOTED)
    assert desk.hears(replace(noted, fetch_ms=noted.fetch_ms + 1)) == [], "the answer to somebody else"
    assert desk.hears(noted) == [DeskFetchAnswer(HERE, OTHERS_CAR, LATER_S, FetchWord.NOTED)]
    assert desk.until(desk.now_us + 2 * ASKS * ASK_AGAIN_US) == []


def test_where_that_one_is_silent_the_customer_reads_so() -> None:
    desk = Desk()
    first = desk.announces(OTHERS_CAR)
    *again, shown = desk.until(desk.now_us + ASKS * ASK_AGAIN_US)
    assert again == first * (ASKS - 1)
    assert isinstance(shown, DeskFetchAnswer) and shown.fetch_word is FetchWord.NO_ANSWER


def test_whoever_asks_for_a_car_that_came_in_here_is_answered_as_often_as_it_asks() -> None:
    desk = Desk()
    asked = at(LATER_S, FetchWord.ASKED, sender=GATEWAY)
    assert desk.hears(asked) == desk.hears(asked) == [at(LATER_S, FetchWord.NOTED)]
    gone = replace(asked, car=Reference(HERE, 9))
    assert desk.hears(gone) == [replace(gone, sender=HERE, fetch_word=FetchWord.NOT_INSIDE)]


def test_who_changes_a_time_all_the_time_fills_no_disk() -> None:
    desk = Desk()
    for in_s in range(60, 120):
        desk.hears(at(in_s, FetchWord.ASKED, sender=GATEWAY))
    assert len(desk.entries) == 1
    desk.until(desk.now_us + NOTE_APART_US)
    assert desk.hears(at(LATER_S, FetchWord.ASKED, sender=GATEWAY)) == [at(LATER_S, FetchWord.NOTED)]


def test_what_a_driver_says_counts_before_what_others_did_and_only_from_the_compartment_of_the_car() -> None:
    stays, came_us = Stays(), SECOND
    stays.hear(CarAt(HERE, CAR, SITE.places[0].number, 1, 2_700), came_us)
    stays.hear(at(LATER_S, FetchWord.ASKED, sender=THERE), came_us)
    stays.hear(at(LATER_S, FetchWord.NOTED, sender=THERE), came_us)
    assert stays.fetched_us(CAR) is None
    stays.hear(at(LATER_S, FetchWord.NOTED), came_us)
    assert stays.fetched_us(CAR) == SECOND + LATER_S * SECOND
    stays.hear(CarAt(HERE, CAR, OUTSIDE, 2, 2_700), came_us)
    assert stays.fetched_us(CAR) is None
