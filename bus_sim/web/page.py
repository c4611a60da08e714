"""Serving the page for the time of a run."""

import asyncio
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console

from onboard.web.app import Source
from onboard.web.cli import web_token
from onboard.web.serve import WebServer


class Page:
    """The page for the time of a run: entered on the running loop, it prints its address and serves."""

    def __init__(self, source: Source, where: str, token_file: Path | None, console: Console) -> None:
        """Raises ``WebError``."""
        self._server = WebServer(source, where, web_token(token_file))
        #: Where a browser finds it.
        self.address = self._server.address
        self._console = console
        self._serving: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        self._serving = asyncio.get_running_loop().create_task(self._server.run())
        self._console.print(f"picture at {self._server.address}", highlight=False, soft_wrap=True)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.stop()
        if self._serving is not None:
            await self._serving
