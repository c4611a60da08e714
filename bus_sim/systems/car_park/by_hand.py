"""Cars in and out by hand while a site runs (row P52, manual piloting): keys of the terminal, or letters of a pipe."""

import asyncio
import os
import sys
import termios
import tty
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, time, timedelta
from types import TracebackType
from typing import Any, Self

from rich.console import Console

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.demand import Stay
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.plant.customer import CustomerState
from bus_sim.systems.car_park.plant.street import Street
from onboard.contract.announce import FetchWord

KEYS = (
    "keys: i a car comes in, o the car that came first is wanted out, f17:30 and Enter: its driver says that it will "
    "be fetched then, q ends the run"
)
#: A time that a customer names has so many characters at most: HH:MM, and what a slip of the fingers adds.
MOST_TIME = 8
#: What is said of an answer at the desk.
ANSWERS = {
    FetchWord.NOTED: "noted",
    FetchWord.NOT_INSIDE: "not noted: the car is not inside",
    FetchWord.PAST: "not noted: it is past",
    FetchWord.TOO_FAR: "not noted: it is more than a week away",
    FetchWord.NO_ANSWER: "not noted: the compartment at which the car came in is silent; try again later",
}
#: Who has said when, or waits for an answer.
_ANNOUNCED = (FetchWord.ASKED, FetchWord.NOTED)
#: What a person has done already: their car was asked for, or is on its way.
_ASKED = frozenset({CustomerState.AT_DESK, CustomerState.AWAITING_DOOR, CustomerState.DRIVING_OUT, CustomerState.GONE})


def _now_us() -> int:
    return round(asyncio.get_running_loop().time() * 1_000_000)


class StreetByHand:
    """What a person does to the street: lets a car come, and has one asked for."""

    def __init__(self, street: Street, seed: int) -> None:
        self._street = street
        self._seed = seed
        self._came = 0

    def car_in(self, *, charging: bool = False) -> str:
        """A car comes now, and asks for a place to charge or not; its name."""
        self._came += 1
        car = replace(random_car(f"by hand {self._came}", self._seed), charging=charging)
        self._street.add(Stay(_now_us(), None, car))
        return car.name

    def car_out(self) -> str | None:
        """The owner of the car that came first, of those not asked for yet, comes back: now, or once it is parked."""
        wanted = next((one for one in self._street.customers if one.state not in _ASKED and not one.is_leaving), None)
        if wanted is None:
            return None
        wanted.leave_now()
        return wanted.stay.car.name

    def announce(self, fetch_us: int, answered: Callable[[str, FetchWord], None]) -> str | None:
        """The owner of the car that came first, of those with a ticket who did not, says when it will be fetched.

        Loop time in us; ``answered`` is called with the car's name and what the desk shows. Returns why nobody can.
        """
        told = (one for one in self._street.customers if one.ticket is not None and one.state not in _ASKED)
        found = next((one for one in told if one.visit.announced not in _ANNOUNCED), None)
        if found is None:
            return "no car is inside of which nobody has said when it will be fetched"
        name = found.stay.car.name
        found.announce(fetch_us, lambda word: answered(name, word))
        return None


def time_of_day(text: str, zero: datetime, now_us: int) -> int:
    """Loop time in us of ``HH:MM`` on the day that it is; ``zero`` is the local time of loop time 0.

    Raises ``DemandError`` for what is no time of day, or past.
    """
    try:
        of_day = time.fromisoformat(text) if len(text) == len("17:30") else None
    except ValueError:
        of_day = None
    if of_day is None:
        raise DemandError(f"f{text}: no time of day; write f and a time from 00:00 to 23:59, then Enter")
    now = zero + timedelta(microseconds=now_us)
    at = now.replace(hour=of_day.hour, minute=of_day.minute, second=0, microsecond=0)
    if at <= now:
        raise DemandError(f"f{text}: is past, it is {now:%H:%M}; name a time of today that is to come")
    return (at - zero) // timedelta(microseconds=1)


class ByHand:
    """Turns keys at the terminal into customers who come and go."""

    def __init__(
        self,
        street: Street,
        seed: int,
        console: Console,
        *,
        ends_with_pipe: bool = True,
        zero: datetime = datetime(2000, 1, 1, tzinfo=UTC),
    ) -> None:
        """Without ``ends_with_pipe`` only q ends the run: cars may come by other ways than by keys.

        ``zero`` is the local time of loop time 0.
        """
        self._zero = zero
        #: What has been typed of a time; None while none is being typed.
        self._time: str | None = None
        self._ends_with_pipe = ends_with_pipe
        self._is_quit = False
        self._is_closed = False
        self._street = street
        self._hand = StreetByHand(street, seed)
        self._console = console
        self._in = sys.stdin.fileno()
        self._terminal: list[Any] | None = None
        self._acts = {"i": self._car_in, "o": self._car_out, "f": self._begin_time, "q": self._quit}

    @property
    def is_over(self) -> bool:
        """Whether somebody pressed q, or the pipe has ended and all that it asked for is done."""
        return self._is_quit or (self._is_closed and self._ends_with_pipe and self._street.is_over)

    def __enter__(self) -> Self:
        if os.isatty(self._in):
            self._terminal = termios.tcgetattr(self._in)
            tty.setcbreak(self._in)
        self._console.print(KEYS, highlight=False, soft_wrap=True)
        try:
            asyncio.get_running_loop().add_reader(self._in, self._read)
        except PermissionError:
            # A file, or nothing at all: there is no waiting for it, all of it is there.
            while not self._is_closed:
                self._read()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        asyncio.get_running_loop().remove_reader(self._in)
        if self._terminal is not None:
            termios.tcsetattr(self._in, termios.TCSADRAIN, self._terminal)

    def _read(self) -> None:
        keys = os.read(self._in, 1024)
        if not keys:
            asyncio.get_running_loop().remove_reader(self._in)
            self._is_closed = True
        for key in keys.decode("utf-8", errors="replace").lower():
            if self._time is not None:
                self._type(key)
                continue
            act = self._acts.get(key)
            if act is not None:
                act()

    def _car_in(self) -> None:
        self._hand.car_in()

    def _car_out(self) -> None:
        if self._hand.car_out() is None:
            self._console.print("no car is inside that nobody has asked for", highlight=False)

    def _begin_time(self) -> None:
        self._time = ""

    def _type(self, key: str) -> None:
        """One more character of a time; Enter ends it."""
        assert self._time is not None
        if key not in "\r\n" and len(self._time) < MOST_TIME:
            self._time += key.strip()
            return
        text, self._time = self._time, None
        try:
            told = self._hand.announce(time_of_day(text, self._zero, _now_us()), self._answered)
        except DemandError as error:
            told = str(error)
        if told is not None:
            self._console.print(told, highlight=False, soft_wrap=True)

    def _answered(self, car: str, word: FetchWord) -> None:
        self._console.print(f"{car}: {ANSWERS[word]}", highlight=False, soft_wrap=True)

    def _quit(self) -> None:
        self._is_quit = True
