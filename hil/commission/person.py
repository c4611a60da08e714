"""The person who is walked through: asked at a terminal, or by a pipe with one answer a line."""

import asyncio
import os
import sys
from typing import Protocol

#: Answers that mean yes and no.
YES, NO = frozenset({"y", "yes"}), frozenset({"n", "no"})
#: A question is asked so often before it counts as not answered.
TRIES = 3
#: Longest line that is taken for an answer, bytes: a device in place of a person ends no line.
_MOST_BYTES = 1_000


class NoAnswerError(Exception):
    """Nobody answers any more: the terminal or the pipe has ended."""


class Person(Protocol):
    """The one who stands at the machine, reads what is shown and answers questions."""

    def tell(self, text: str) -> None:
        """Show one line without waiting for an answer."""

    async def ask(self, question: str) -> str:
        """One line, without white space around it. Raises ``NoAnswerError``."""


class ConsolePerson:
    """Standard input and output; the loop goes on while the person thinks, and a wait can be broken off."""

    def __init__(self) -> None:
        #: What was read of the answers that come, and not taken yet.
        self._pending = b""

    def tell(self, text: str) -> None:
        """Print one line, at once even into a pipe."""
        print(text, flush=True)

    async def ask(self, question: str) -> str:
        """Wait for a line of standard input; from a pipe the answer is printed too, for the record."""
        print(f"{question} ", end="", flush=True)
        line = await self._line()
        if not line:
            raise NoAnswerError
        if not sys.stdin.isatty():
            print(line.rstrip(), flush=True)
        return line.strip()

    async def _line(self) -> str:
        """One line with its end, or what there is of it; empty at the end of the input."""
        while b"\n" not in self._pending and len(self._pending) < _MOST_BYTES:
            more = await _more(sys.stdin.fileno(), _MOST_BYTES - len(self._pending))
            if not more:
                break
            self._pending += more
        line, end, rest = self._pending.partition(b"\n")
        line, self._pending = line + end, rest
        return line.decode("utf-8", "replace")


async def _more(source: int, most: int) -> bytes:
    """What comes next, so many bytes at most; no thread waits for it, for nothing could end that."""
    loop = asyncio.get_running_loop()
    ready: asyncio.Future[None] = loop.create_future()

    def is_ready() -> None:
        if not ready.done():
            ready.set_result(None)

    try:
        loop.add_reader(source, is_ready)
    except OSError:
        # A file never lets one wait.
        return os.read(source, most)
    try:
        await ready
    finally:
        loop.remove_reader(source)
    try:
        return os.read(source, most)
    except OSError:
        # The terminal is closed.
        return b""


async def is_yes(person: Person, question: str) -> bool:
    """A question that has two answers; whoever gives neither three times has said no."""
    for _ in range(TRIES):
        answer = (await person.ask(f"{question} [y/n]")).lower()
        if answer in YES | NO:
            return answer in YES
        person.tell("Please answer y or n.")
    return False


async def number(person: Person, question: str) -> float | None:
    """A number, with a comma or a point; None for whoever gives none three times."""
    for _ in range(TRIES):
        answer = await person.ask(question)
        try:
            return float(answer.replace(",", "."))
        except ValueError:
            person.tell("Please answer with a number, such as 60.3.")
    return None
