"""Bugs that are planted in shipped code to see whether an exploration finds them."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from onboard.core.authority import TokenBook
from onboard.core.effects import Record, Send
from onboard.core.records import TokenGivenRecord
from onboard.systems.car_park import custody
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.going_around import GoingAround
from onboard.systems.car_park.handling import ShuttleWork
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.lift_steps import LiftFinding
from onboard.systems.car_park.records import AwardRecord, HandledRecord
from onboard.systems.car_park.recovery import JournalRecovery
from onboard.systems.car_park.riding import Riding
from onboard.systems.car_park.robot import ParkingRobot
from onboard.systems.car_park.travel import Carriage

Method = Callable[..., Any]
GATES = "two have the gate"
TWO, TRAP, LOST = "two hold the car", "a trap", "its keeper does not know where the car stands"


class Planted(NamedTuple):
    """A bug: where it is planted, what is made of what stands there, and what is to be found."""

    owner: Any
    name: str
    made: Callable[[Method], Method]
    found: str


def _turned(method: Method) -> Method:
    return lambda *args: method(*args)[::-1]


def _nothing(method: Method) -> Method:
    return lambda *_: []


def _waits(method: Method) -> Method:
    return lambda *_: (LiftFinding.NOTHING, None)


def _under_no_gate(method: Method) -> Method:
    def word(lift: Lift, drive: Any) -> Send:
        said = method(lift, drive)
        return Send(replace(said.message, itinerary_version=0, leg=0))

    return word


def _one_less(method: Method) -> Method:
    return lambda *args: method(*args) - 1


def _unwritten(method: Method) -> Method:
    """What it does is not written down; None stays None."""

    def without(*args: Any) -> Any:
        effects = method(*args)
        return effects and [one for one in effects if not isinstance(one, Record)]

    return without


def _never_refused(method: Method) -> Method:
    return lambda *args: method(*args) or []


def _without(*records: type) -> Callable[[Method], Method]:
    def made(method: Method) -> Method:
        def take(memory: Any, record: Any) -> None:
            if not isinstance(record, records):
                method(memory, record)

        return take

    return made


def _keeps_given(method: Method) -> Method:
    def replay(book: TokenBook, entries: Any) -> None:
        method(book, [entry for entry in entries if entry.get("record") != TokenGivenRecord.NAME])

    return replay


def _never_again(method: Method) -> Method:
    def take_up(compartment: Compartment, now_us: int) -> Any:
        effects = method(compartment, now_us)
        assert compartment.job is not None
        compartment.job.retry_at_us = None
        return effects

    return take_up


AWARD = {
    "a grant is said before it is written": Planted(TokenBook, "give", _turned, TWO),
    "a right is given under its old version": Planted(TokenBook, "own_version", _one_less, TRAP),
    "what was given away is held again after a restart": Planted(TokenBook, "replay", _keeps_given, TWO),
    "a grant is said once": Planted(TokenBook, "wake", _nothing, TRAP),
    "an award is told before it is written": Planted(ParkingRobot, "_take_on", _turned, TRAP),
    "a robot forgets what it has won": Planted(JournalRecovery, "_take", _without(AwardRecord), TRAP),
    "a restarted compartment does not call": Planted(Compartment, "_take_up_job", _never_again, TRAP),
}


def _of_the_place(method: Method) -> Method:
    return lambda around, **_: method(around)


#: Of two robots, without a crash.
KEEPS_THE_PLACE = Planted(GoingAround, "untouched", _of_the_place, TRAP)

#: Of a car in the bay.
PARKING = {
    "a car that was left is not passed on": Planted(ShuttleWork, "_finish", _nothing, TRAP),
}

LEAVING = {
    "a grant is said before it is written": Planted(TokenBook, "give", _turned, TWO),
    "the place of a car is not written": Planted(custody, "before_taking", _unwritten, LOST),
    "a car is taken before its place is known": Planted(custody, "before_taking", _never_refused, LOST),
    # That where a car is left is said once is healed: mirrors that differ are made equal.
    "a keeper forgets where its cars stand": Planted(custody, "replay", _nothing, TRAP),
    "a robot forgets what it has handled": Planted(JournalRecovery, "_take", _without(HandledRecord), TRAP),
    "a car that was left is not passed on": Planted(ShuttleWork, "_finish", _nothing, TRAP),
    "a stroke is not written": Planted(ShuttleWork, "_next", _unwritten, TRAP),
}

#: Of who stands before the sill.
BOARDING = {
    "a grant is said once": Planted(TokenBook, "wake", _nothing, TRAP),
    "a right is given under its old version": Planted(TokenBook, "own_version", _one_less, TRAP),
    "a gate that came too early is kept": Planted(Riding, "_return_again", _nothing, TRAP),
}

#: Of who stands on the platform.
RIDING = {
    "a grant is said before it is written": Planted(TokenBook, "give", _turned, GATES),
    "what was given away is held again after a restart": Planted(TokenBook, "replay", _keeps_given, GATES),
    # That a ride is not written, or forgotten, is healed: whoever is aboard tells where it is carried.
    "a lift forgets its ride, and asks nobody": Planted(Lift, "_found_of_ride", _waits, TRAP),
    "a lift does not say under which gate it stands": Planted(Lift, "_word", _under_no_gate, TRAP),
    "gate and slots are given back on the way": Planted(Carriage, "occupied", _nothing, TRAP),
}
