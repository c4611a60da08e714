"""Serving the page on a socket of our own, on whatever asyncio loop is running."""

import contextlib
import secrets
import socket
from collections.abc import Generator

import uvicorn

from onboard.web.address import WebError, parse_address
from onboard.web.app import Source, create_app


class _Server(uvicorn.Server):
    """A server that leaves the signals to the program it runs in."""

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        yield


class WebServer:
    """The page of one source. ``address`` is what a person opens, with the token that this server wants."""

    def __init__(self, source: Source, where: str, token: str | None = None) -> None:
        """``where`` is PORT or HOST:PORT; a token is made where none is given.

        Raises ``WebError`` for a bad or a busy address.
        """
        host, port = parse_address(where)
        self._socket = _listen(host, port)
        self.port: int = self._socket.getsockname()[1]
        token = token or secrets.token_urlsafe(16)
        shown = f"[{host}]" if ":" in host else host
        self.address = f"http://{shown}:{self.port}/?token={token}"
        config = uvicorn.Config(
            create_app(source, token, _names(host)),
            lifespan="off",
            log_level="error",
            ws="websockets-sansio",
            # A viewer's sleeping tablet is no reason to drop it, and the loop's clock may run faster than the wall's.
            ws_ping_interval=None,
            ws_ping_timeout=None,
            ws_max_size=1 << 16,
            timeout_graceful_shutdown=1,
        )
        self._server = _Server(config)

    async def run(self) -> None:
        """Serve the page on the socket that was opened, until ``stop`` is called."""
        await self._server.serve([self._socket])

    def stop(self) -> None:
        """Let ``run`` come to its end."""
        self._server.should_exit = True
        self._server.force_exit = True


def _listen(host: str, port: int) -> socket.socket:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        found = socket.socket(family, kind, protocol)
    except OSError as error:
        raise WebError(f"{host}:{port}: {error.strerror or error}; name another address") from error
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind(address)
        # At once: whoever reads the address may open it before the server's first turn.
        found.listen()
    except OSError as error:
        found.close()
        raise WebError(f"{host}:{port}: {error.strerror or error}; choose another port, 0 for any") from error
    return found


def _names(host: str) -> frozenset[str]:
    """Names under which people reach this server: as it was told, and this computer's own, alone and by mDNS."""
    own = socket.gethostname().lower()
    return frozenset({host.lower(), own, f"{own}.local"})
