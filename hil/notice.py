"""Waiting for what is said, with a deadline: the one way in which a bench and a commissioning wait."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Notice:
    """Tells whoever waits that there is something new to look at."""

    def __init__(self) -> None:
        self._news = asyncio.Event()

    def tell(self) -> None:
        """Make whoever waits look again."""
        self._news.set()

    async def until(self, look: Callable[[], T | None], within_s: float) -> T | None:
        """Look now and after everything new, until ``look`` finds something; None after ``within_s``."""
        try:
            async with asyncio.timeout(within_s):
                while (found := look()) is None:
                    self._news.clear()
                    await self._news.wait()
                return found
        except TimeoutError:
            return None
