"""A person's answer at the terminal, or from a pipe, while the bus goes on being heard."""

import asyncio
import sys
from collections.abc import Callable
from typing import TextIO

from onboard.operate.order import OperatorCommand
from onboard.operate.station import OperatorStation

_YES = ("y", "yes")
#: Longest line that is taken for an answer, characters: a device in place of a person ends no line.
_MOST_CHARS = 1_000


class Asker:
    """Asks on standard input, but where ``is_agreed``; ``tell`` is given every line but the question.

    A word that must be typed is not agreed to by that: ``typed`` is what was given in its place.
    """

    def __init__(
        self, station: OperatorStation, tell: Callable[[str], None], *, is_agreed: bool = False, typed: str = ""
    ) -> None:
        self._station, self._tell, self._is_agreed, self._typed = station, tell, is_agreed, typed
        self._source: TextIO = sys.stdin

    async def agrees(self, order: OperatorCommand) -> bool:
        """Whether the person says yes, or types the word that the order asks for."""
        if self._typed if order.answer else self._is_agreed:
            return not order.answer or self._typed == order.answer
        wanted = f"type {order.answer} to go on" if order.answer else "y/N"
        print(f"{order.question} [{wanted}] ", end="", flush=True)
        line = await self._line()
        if line == "":
            self._tell("\nno answer: nothing was said; --yes answers for a script")
            return False
        word = line.strip()
        agrees = word == order.answer if order.answer else word.lower() in _YES
        if not agrees:
            self._tell("nothing was said")
        return agrees

    async def _line(self) -> str:
        """One line; empty at the end of the input, and where the person interrupts."""
        loop = asyncio.get_running_loop()
        answered: asyncio.Future[str] = loop.create_future()

        def read() -> None:
            if not answered.done():
                answered.set_result(self._source.readline(_MOST_CHARS))

        try:
            loop.add_reader(self._source, read)
        except (PermissionError, ValueError, OSError):
            # A file, or no input at all, never lets one wait.
            return self._source.readline(_MOST_CHARS)
        interrupted = loop.create_task(self._station.interrupted())
        try:
            await asyncio.wait((answered, interrupted), return_when=asyncio.FIRST_COMPLETED)
            return answered.result() if answered.done() else ""
        finally:
            interrupted.cancel()
            loop.remove_reader(self._source)
