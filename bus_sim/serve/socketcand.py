"""The simulated buses served in the socketcand protocol, so that other processes can join them as nodes.

Each client is a node of its own on the bus that it opens: it takes part in arbitration, and hears the others' frames
and not its own. python-can, SavvyCAN, Kayak and our own controllers speak this protocol.
"""

import asyncio
import hmac
import socket
from collections import Counter
from collections.abc import Callable

from bus_sim.serve.socketcand_session import SocketcandSession
from onboard.io.socketcand_protocol import DEFAULT_PORT
from onboard.ports.bus import Bus

#: Gives a client, by channel and client name, its own node on that bus; None where there is no such channel.
JoinBus = Callable[[str, str], Bus | None]
#: Microseconds since the epoch for a loop time in microseconds.
Stamp = Callable[[int], int]


class ServeError(Exception):
    """The address cannot be served; ``str`` is one line for a person."""


class SocketcandServer:
    """Serves on one address. ``counts`` says what clients did, in words; see ``SocketcandSession`` for its keys.

    The protocol knows no password. With ``token`` a client names its channel as ``CHANNEL:TOKEN``, which every client
    of the protocol can; beyond loopback nothing should be served without.
    """

    def __init__(
        self, join: JoinBus, stamp: Stamp, host: str = "127.0.0.1", port: int = DEFAULT_PORT, token: str | None = None
    ) -> None:
        """``port`` 0 takes a free one, which ``start`` returns."""
        self.counts: Counter[str] = Counter()
        self._join = join if token is None else _guarded(join, token)
        self._stamp = stamp
        self._address = (host, port)
        self._server: asyncio.Server | None = None
        self._sessions: set[SocketcandSession] = set()
        self._leaving: set[asyncio.Task[None]] = set()
        self._clients = 0
        self._all_gone: asyncio.Future[None] | None = None

    async def start(self) -> int:
        """Listen; returns the port. Raises ``ServeError``."""
        host, port = self._address
        try:
            self._server = await asyncio.get_running_loop().create_server(self._session, host, port)
        except OSError as error:
            is_unknown = isinstance(error, socket.gaierror)
            remedy = "name this computer" if is_unknown else "another program may hold it, choose another port"
            raise ServeError(f"cannot serve on {host}:{port}: {error.strerror or error}; {remedy}") from error
        bound: int = self._server.sockets[0].getsockname()[1]
        return bound

    async def close(self) -> None:
        """Stop listening, disconnect all clients and take their nodes off the buses."""
        if self._server is not None:
            self._server.close()
        for session in list(self._sessions):
            session.disconnect()
        if self._sessions or self._leaving:
            self._all_gone = asyncio.get_running_loop().create_future()
            await self._all_gone

    def _session(self) -> SocketcandSession:
        self._clients += 1
        name = f"socketcand-{self._clients}"
        session = SocketcandSession(name, self._join, self._stamp, self.counts, self._on_end)
        self._sessions.add(session)
        return session

    def _on_end(self, session: SocketcandSession, bus: Bus | None) -> None:
        self._sessions.discard(session)
        if bus is not None:
            task = asyncio.get_running_loop().create_task(bus.close())
            self._leaving.add(task)
            task.add_done_callback(self._left)
        else:
            self._report_gone()

    def _left(self, task: asyncio.Task[None]) -> None:
        self._leaving.discard(task)
        self._report_gone()

    def _report_gone(self) -> None:
        gone = self._all_gone
        if gone is not None and not gone.done() and not self._sessions and not self._leaving:
            gone.set_result(None)


def _guarded(join: JoinBus, token: str) -> JoinBus:
    """The same buses for who says the token after the channel; there is none for anybody else."""

    def open_for(channel: str, client: str) -> Bus | None:
        name, _, said = channel.partition(":")
        return join(name, client) if hmac.compare_digest(said.encode(), token.encode()) else None

    return open_for
