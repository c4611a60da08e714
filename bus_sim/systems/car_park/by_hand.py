"""Cars in and out by hand while a site runs (row P52, manual piloting): keys of the terminal, or letters of a pipe."""

import asyncio
import os
import sys
import termios
import tty
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

from rich.console import Console

from bus_sim.systems.car_park.demand import Stay
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.plant.customer import CustomerState
from bus_sim.systems.car_park.plant.street import Street

KEYS = "keys: i a car comes in, o the car that came first is wanted out, q ends the run"
#: What a person has done already: their car was asked for, or is on its way.
_ASKED = frozenset({CustomerState.AT_DESK, CustomerState.AWAITING_DOOR, CustomerState.DRIVING_OUT, CustomerState.GONE})


class StreetByHand:
    """What a person does to the street: lets a car come, and has one asked for."""

    def __init__(self, street: Street, seed: int) -> None:
        self._street = street
        self._seed = seed
        self._came = 0

    def car_in(self, *, charging: bool = False) -> str:
        """A car comes now, and asks for a place to charge or not; its name."""
        self._came += 1
        now_us = round(asyncio.get_running_loop().time() * 1_000_000)
        car = replace(random_car(f"by hand {self._came}", self._seed), charging=charging)
        self._street.add(Stay(now_us, None, car))
        return car.name

    def car_out(self) -> str | None:
        """The owner of the car that came first, of those not asked for yet, comes back: now, or once it is parked."""
        wanted = next((one for one in self._street.customers if one.state not in _ASKED and not one.is_leaving), None)
        if wanted is None:
            return None
        wanted.leave_now()
        return wanted.stay.car.name


class ByHand:
    """Turns keys at the terminal into customers who come and go."""

    def __init__(self, street: Street, seed: int, console: Console, *, ends_with_pipe: bool = True) -> None:
        """Without ``ends_with_pipe`` only q ends the run: cars may come by other ways than by keys."""
        self._ends_with_pipe = ends_with_pipe
        self._is_quit = False
        self._is_closed = False
        self._street = street
        self._hand = StreetByHand(street, seed)
        self._console = console
        self._in = sys.stdin.fileno()
        self._terminal: list[Any] | None = None
        self._acts = {"i": self._car_in, "o": self._car_out, "q": self._quit}

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
            act = self._acts.get(key)
            if act is not None:
                act()

    def _car_in(self) -> None:
        self._hand.car_in()

    def _car_out(self) -> None:
        if self._hand.car_out() is None:
            self._console.print("no car is inside that nobody has asked for", highlight=False)

    def _quit(self) -> None:
        self._is_quit = True
