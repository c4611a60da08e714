"""The page's server: one page, its layout, and one socket for each viewer. Starlette; nothing from another host.

``Source`` is what is shown. A viewer is sent a snapshot several times a second and sends commands; the answer to a
command is one line. Only a source that is simulated, or a recorded log, takes any.
"""

import asyncio
import hmac
import json
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from importlib.resources import files
from typing import Any, Protocol

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from onboard.web.address import is_own_host

#: Snapshots a second that a viewer is sent at most.
SNAPSHOTS_S = 10
#: Most viewers at a time, and the longest command, bytes: a page that is left open must not fill the memory.
MOST_VIEWERS = 32
MOST_COMMAND_BYTES = 4_096
_SCRIPTS = ("page.js", "draw.js", "building.js", "plan.js", "paint.js")
_TYPES = {"index.html": "text/html", "page.css": "text/css", **dict.fromkeys(_SCRIPTS, "text/javascript")}
#: Everything comes from this server, and nobody may put the page into a frame.
_POLICY = "default-src 'self'; img-src data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'"
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    # The token stands in the address.
    "Referrer-Policy": "no-referrer",
}
#: Why a viewer is cut off (RFC 6455, section 7.4.1): it may not look on, or it has sent what is no text.
_POLICY_BREACH, _NO_TEXT = 1008, 1003


class CommandError(ValueError):
    """A command that cannot be done; ``str`` is one line for the person who gave it."""


class Source(Protocol):
    """What is shown. ``mode`` is ``simulated``, ``live`` or ``log``."""

    mode: str

    def layout(self) -> dict[str, Any]:
        """What never changes, with ``commands``: the names of those that ``command`` takes."""

    def snapshot(self) -> dict[str, Any]:
        """What changes, with ``now_us`` and ``pace``, simulated seconds a second."""

    def figures(self) -> dict[str, Any]:
        """The indicators; asked for once a second."""

    async def command(self, name: str, arguments: Mapping[str, Any]) -> str:
        """Do what a person asked for and say so in one line. Raises ``CommandError``."""

    def sleep(self, seconds: float) -> Awaitable[None]:
        """Let so many seconds of the wall clock pass."""


def create_app(source: Source, token: str, names: frozenset[str] = frozenset()) -> Starlette:
    """The application. A viewer brings ``token``, as ``?token=``, and asks for this host: see ``is_own_host``.

    On loopback too: other people of this computer, and any page that its browser opens, reach it there.
    """
    viewers: set[WebSocket] = set()

    def is_allowed(given: str | None) -> bool:
        return given is not None and hmac.compare_digest(given.encode(), token.encode())

    async def page(request: Request) -> Response:
        if not is_own_host(request.headers.get("host", ""), names):
            return PlainTextResponse("not a name of this server; open the address that it printed", 421, _HEADERS)
        name = request.path_params.get("name", "index.html")
        if name not in _TYPES:
            return PlainTextResponse("not found", 404, _HEADERS)
        if name == "index.html" and not is_allowed(request.query_params.get("token")):
            return PlainTextResponse("the address needs ?token=..., as the server printed it", 403, _HEADERS)
        text = files("onboard.web").joinpath("page", name).read_text(encoding="utf-8")
        return Response(text, media_type=_TYPES[name], headers=_HEADERS)

    async def live(socket: WebSocket) -> None:
        is_meant = is_own_host(socket.headers.get("host", ""), names) and _same_origin(socket)
        if not is_meant or not is_allowed(socket.query_params.get("token")) or len(viewers) >= MOST_VIEWERS:
            await socket.close(_POLICY_BREACH)
            return
        await socket.accept()
        viewers.add(socket)
        try:
            await _serve(socket, source)
        finally:
            viewers.discard(socket)

    return Starlette(routes=[Route("/", page), Route("/{name}", page), WebSocketRoute("/live", live)])


def _same_origin(socket: WebSocket) -> bool:
    """A page of another host must not command this one through a person's browser."""
    origin = socket.headers.get("origin")
    return origin is None or origin.partition("://")[2] == socket.headers.get("host")


async def _serve(socket: WebSocket, source: Source) -> None:
    """One viewer, until it is gone."""
    await socket.send_text(json.dumps({"layout": {**source.layout(), "mode": source.mode}}))
    sending = asyncio.ensure_future(_send(socket, source))
    try:
        while True:
            text = (await _received(socket)).get("text")
            if text is None:
                await socket.close(_NO_TEXT)
                return
            answer = await _obey(text, source)
            # With what has come of it: a source that stands still would not tell by itself.
            await socket.send_text(json.dumps({**answer, "snapshot": source.snapshot()}))
    except WebSocketDisconnect:
        return
    finally:
        sending.cancel()
        with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
            await sending


async def _received(socket: WebSocket) -> Mapping[str, Any]:
    """The next frame; one of bytes has no ``text``. Raises ``WebSocketDisconnect``."""
    frame = await socket.receive()
    if frame["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(frame.get("code", 1005))
    return frame


async def _send(socket: WebSocket, source: Source) -> None:
    turn = 0
    while True:
        told = {"snapshot": source.snapshot()}
        if turn % SNAPSHOTS_S == 0:
            told["figures"] = source.figures()
        await socket.send_text(json.dumps(told, separators=(",", ":")))
        turn += 1
        await source.sleep(1 / SNAPSHOTS_S)


async def _obey(text: str, source: Source) -> dict[str, Any]:
    """The answer to one command; malformed ones are told so and nothing else happens."""
    if len(text.encode()) > MOST_COMMAND_BYTES:
        return {"answer": "the command is too long", "ok": False}
    try:
        order = json.loads(text)
        name, arguments = order["command"], order.get("arguments", {})
        if not isinstance(name, str) or not isinstance(arguments, dict):
            raise TypeError
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return {"answer": "not a command", "ok": False}
    try:
        return {"answer": await source.command(name, arguments), "ok": True}
    except CommandError as error:
        return {"answer": str(error), "ok": False}


Handler = Callable[[Mapping[str, Any]], str]


def number(arguments: Mapping[str, Any], name: str, low: float, high: float) -> float:
    """One number of a command. Raises ``CommandError`` for a missing one, and for one out of its range."""
    value = arguments.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise CommandError(f"{name}: must be a number from {low:g} to {high:g}")
    return float(value)
