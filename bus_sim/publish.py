"""``bus-sim run --mqtt``: the site's gateway in a process of its own, and a broker where nobody named one."""

import asyncio
import os
import shutil
import socket
import sys
import tempfile
from asyncio.subprocess import DEVNULL, STDOUT, Process
from pathlib import Path

from rich.console import Console

import onboard
from bus_sim.outside import Served
from bus_sim.run import FLEET
from onboard.core.site import Site
from onboard.gateway.options import plain_warning, watch_lines
from onboard.gateway.roles import Role
from onboard.gateway.settings import GatewaySettings
from onboard.io.broker_address import BrokerAddress, is_mqtt_installed, parse_broker

#: The gateway's node-ID: it takes orders too.
NODE = 251
#: Who may order everything of a run, on the topic of this name.
DEMO = "demo"
_ROLES = {DEMO: Role(frozenset(), frozenset())}
#: What a process may take to start or to end, s of the loop.
PATIENCE_S = 10.0


class PublishError(Exception):
    """The gateway or its broker cannot be started; ``str`` is one line for a person."""


def check_mqtt(url: str) -> str:
    """An address, or empty for a broker of one's own. Raises ``ValueError`` for what cannot be."""
    if not is_mqtt_installed():
        raise ValueError("--mqtt: its libraries are missing; pip install 'onboard-fleet[mqtt]'")
    if url:
        try:
            parse_broker(url)
        except ValueError as error:
            raise ValueError(f"--mqtt {error}") from error
    elif _mosquitto() is None:
        raise ValueError("--mqtt: mosquitto is not installed; apt install mosquitto, or name a broker: --mqtt URL")
    return url


class Publishing:
    """Gateway and broker for the time of a run. Entering raises ``PublishError``."""

    def __init__(self, site: Site, site_text: str, url: str, served: Served, console: Console) -> None:
        """``served`` is where the fleet bus is; ``url`` empty starts a broker on a free loopback port."""
        self._site, self._site_text, self._url, self._served = site, site_text, url, served
        self._console = console
        self._folder = tempfile.TemporaryDirectory(prefix="gateway-")
        self._processes: list[Process] = []

    async def __aenter__(self) -> None:
        try:
            address = parse_broker(self._url) if self._url else await self._start_broker()
            await self._start_gateway(address)
        except BaseException:  # whatever ends it, no process may be left behind
            await self.__aexit__()
            raise
        warning = [f"warning: --mqtt {told}"] if (told := plain_warning(address)) else []
        for line in (*warning, *watch_lines(address, self._site, GatewaySettings(node_id=NODE, roles=_ROLES))):
            self._console.print(line, highlight=False, soft_wrap=True)

    async def __aexit__(self, *_: object) -> None:
        # The gateway first: it says goodbye to the broker.
        for process in reversed(self._processes):
            if process.returncode is None:
                process.terminate()
                try:
                    await asyncio.wait_for(process.wait(), PATIENCE_S)
                except TimeoutError:
                    process.kill()
                    await process.wait()
        self._folder.cleanup()

    async def _start_broker(self) -> BrokerAddress:
        path = _mosquitto()
        if path is None:
            raise PublishError("--mqtt: mosquitto is not installed; apt install mosquitto, or name a broker")
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        text = f"listener {port} 127.0.0.1\nallow_anonymous true\nmessage_size_limit 65536\n"
        (Path(self._folder.name) / "mosquitto.conf").write_text(text, encoding="utf-8")
        process = await self._start("broker", path, "-c", "mosquitto.conf")
        async with asyncio.timeout(PATIENCE_S):
            while not await _listens(port):
                if process.returncode is not None:
                    raise PublishError(f"--mqtt: mosquitto ended: {self._last_word('broker')}")
                await asyncio.sleep(0.05)
        return BrokerAddress("127.0.0.1", port)

    async def _start_gateway(self, address: BrokerAddress) -> None:
        (Path(self._folder.name) / "site.toml").write_text(self._site_text, encoding="utf-8")
        (Path(self._folder.name) / "roles.toml").write_text(f"[{DEMO}]\n", encoding="utf-8")
        words = ["-m", "onboard", "gateway", "-i", "socketcand-asyncio", "-c", FLEET, "--bus-kwargs"]
        words += [f"{key}={value}" for key, value in self._served.arguments.items()]
        words += ["--site", "site.toml", "--orders", str(NODE), "--roles", "roles.toml"]
        await self._start("gateway", sys.executable, *words, "--mqtt", self._url or str(address))

    async def _start(self, name: str, *words: str) -> Process:
        root = str(Path(onboard.__file__).parents[1])
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        with (Path(self._folder.name) / f"{name}.log").open("wb") as log:
            process = await asyncio.create_subprocess_exec(
                *words,
                cwd=self._folder.name,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                stdin=DEVNULL,
                stdout=log,
                stderr=STDOUT,
                # A key pressed in this terminal ends the run, and the run ends its processes.
                start_new_session=True,
            )
        self._processes.append(process)
        return process

    def _last_word(self, name: str) -> str:
        text = (Path(self._folder.name) / f"{name}.log").read_text(encoding="utf-8", errors="replace")
        return next((line for line in reversed(text.splitlines()) if line.strip()), "it said nothing")


def _mosquitto() -> str | None:
    """Where a daemon is, only root looks by itself."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/sbin")


async def _listens(port: int) -> bool:
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
    except OSError:
        return False
    writer.close()
    return True
