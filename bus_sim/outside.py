"""What joins a simulated site from outside: clients of the served buses, and interfaces of python-can."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from bus_sim.options import RunOptions
from bus_sim.run import FLEET, BusRun
from bus_sim.serve.bridge import Bridge, open_bridge, parse_bus_specs
from bus_sim.serve.socketcand import ServeError, SocketcandServer
from onboard.config.arguments import whole
from onboard.io.kept_token import kept_token
from onboard.io.owned_file import OwnedFileError

#: Of TCP.
MOST_PORT = 65_535


def is_address(text: str) -> bool:
    """Whether a text is HOST:PORT; port 0 is any."""
    host, _, port = text.rpartition(":")
    number = whole(port)
    return bool(host) and number is not None and number <= MOST_PORT


@dataclass(frozen=True, slots=True)
class Served:
    """Where the buses are served, and the file of the token that clients there say; None where none is wanted."""

    host: str
    port: int
    token_file: Path | None

    @property
    def arguments(self) -> dict[str, str | int]:
        """What a controller's own client is told besides its channel."""
        where: dict[str, str | int] = {"host": self.host, "port": self.port}
        return where if self.token_file is None else where | {"token_file": str(self.token_file.resolve())}


class Outside:
    """Everything that joins the buses from outside, for the time of a run.

    ``options`` name HOST:PORT for socketcand clients, and python-can interfaces as ``--bus`` does. Entering raises
    ``ServeError`` and ``BusOpenError`` for a person's mistakes.
    """

    def __init__(self, simulation: BusRun[Any], options: RunOptions, console: Console) -> None:
        self._simulation = simulation
        self._address, self._token_file = options.serve, options.serve_token
        self._buses = options.buses
        self._console = console
        self._server: SocketcandServer | None = None
        self._bridges: list[Bridge] = []
        #: What is served, once it is.
        self.served: Served | None = None

    async def __aenter__(self) -> None:
        if self._address is not None or self._buses:
            # Somebody acknowledges from the start: a lone controller would repeat its first frame for ever.
            self._simulation.fleet.attach("gateway")
        if self._address is not None:
            await self._serve(self._address)
        site = self._simulation.site
        machines = [machine.name for machine in site.machines.values()]
        for machine, settings in parse_bus_specs(self._buses, site.bitrate, machines):
            node = self._simulation.join(machine or FLEET, str(settings))
            assert node is not None, "the names were checked"
            bridge, _ = await open_bridge(node, settings)
            self._bridges.append(bridge)
            which = "the fleet bus" if machine is None else f"the device bus of {machine}"
            self._console.print(f"{which} is on {settings}", highlight=False, soft_wrap=True)

    async def __aexit__(self, *_: object) -> None:
        for bridge in self._bridges:
            await bridge.close()
        if self._server is not None:
            await self._server.close()

    async def _serve(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        number = whole(port)
        if number is None:
            raise ServeError(f"--serve {address}: must be HOST:PORT, such as 127.0.0.1:29536")
        epoch_us = self._simulation.options.epoch_us
        try:
            token = kept_token(self._token_file) if self._token_file is not None else None
        except OwnedFileError as error:
            raise ServeError(f"--serve-token {error}") from error
        server = SocketcandServer(
            self._simulation.join, lambda time_us: epoch_us + time_us, host or "127.0.0.1", number, token
        )
        bound = await server.start()
        self._server = server
        self.served = Served(host or "127.0.0.1", bound, self._token_file)
        channels = ", ".join([FLEET, *(machine.name for machine in self._simulation.site.machines.values())])
        self._console.print(
            f"serving at {host or '127.0.0.1'}:{bound} (socketcand), channels {channels}"
            + (f"; open CHANNEL:TOKEN, the token is in {self._token_file}" if token is not None else ""),
            highlight=False,
            soft_wrap=True,
        )
