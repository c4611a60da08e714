"""A picture of characters that is drawn again and again where output is a terminal."""

import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

#: Pictures of a run that is watched, a second.
PICTURES_S = 10


class LiveOutput:
    """Room of a terminal for a picture, for as long as a run goes on; none where none is shown."""

    def __init__(self, console: Console, *, shown: bool) -> None:
        self._live = Live(console=console, auto_refresh=False, transient=True) if shown else None
        #: Of the page, if one is served: shown with every picture.
        self.address: str | None = None

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()


class LiveText(LiveOutput):
    """Draws a picture of text; nothing where it is not wanted, or output is no terminal."""

    def __init__(self, picture: Callable[[], str], console: Console, *, wanted: bool) -> None:
        super().__init__(console, shown=wanted and console.is_terminal and not console.quiet)
        self._picture = picture
        self._next_s = 0.0

    def update(self, now_us: int) -> None:
        """A new picture, not too often."""
        if self._live is None or time.perf_counter() < self._next_s:
            return
        self._next_s = time.perf_counter() + 1 / PICTURES_S
        where = f"\npicture at {self.address}" if self.address is not None else ""
        self._live.update(Text(self._picture() + where, no_wrap=True), refresh=True)
