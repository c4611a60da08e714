"""The person who is walked through: asked at a terminal, or by a pipe with one answer a line."""

import asyncio
import sys
from typing import Protocol

#: Answers that mean yes and no.
YES, NO = frozenset({"y", "yes"}), frozenset({"n", "no"})
#: A question is asked so often before it counts as not answered.
TRIES = 3
#: Longest line that is taken for an answer, characters: a device in place of a person ends no line.
_MOST_CHARS = 1_000


class NoAnswerError(Exception):
    """Nobody answers any more: the terminal or the pipe has ended."""


class Person(Protocol):
    """The one who stands at the machine, reads what is shown and answers questions."""

    def tell(self, text: str) -> None:
        """Show one line without waiting for an answer."""

    async def ask(self, question: str) -> str:
        """One line, without white space around it. Raises ``NoAnswerError``."""


class ConsolePerson:
    """Standard input and output; the loop goes on while the person thinks."""

    def tell(self, text: str) -> None:
        """Print one line, at once even into a pipe."""
        print(text, flush=True)

    async def ask(self, question: str) -> str:
        """Wait in a thread for a line of standard input; from a pipe the answer is printed too, for the record."""
        print(f"{question} ", end="", flush=True)
        line: str = await asyncio.to_thread(sys.stdin.readline, _MOST_CHARS)
        if not line:
            raise NoAnswerError
        if not sys.stdin.isatty():
            print(line.rstrip(), flush=True)
        return line.strip()


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
