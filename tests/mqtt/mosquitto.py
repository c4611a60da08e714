"""A real mosquitto on a loopback port, with the site's own configuration from ``deploy/mqtt``."""

import asyncio
import os
import shutil
import signal
import socket
import subprocess
from functools import cache
from pathlib import Path

from onboard.io.broker_address import BrokerAddress
from onboard.io.mqtt import MqttBroker
from tests.tools import DEADLINE_S, require_tool, run_tool

DEPLOY = Path(__file__).parents[2] / "deploy" / "mqtt"
ROLES = ("gateway", "dispatcher", "viewer")
#: A test's own, who reads and writes everything.
WITNESS = "witness"


def free_port() -> int:
    """A port that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@cache
def certificates(folder: Path) -> Path:
    """An authority, a broker and one client for each role and for a stranger's authority; EC keys, quick to make.

    With the extensions that RFC 5280 asks for (4.2.1.1 to 4.2.1.3): Python 3.13 and newer refuse what lacks them.
    """
    openssl = require_tool("openssl")
    folder.mkdir(parents=True, exist_ok=True)

    def key(name: str) -> None:
        run_tool(openssl, "ecparam", "-name", "prime256v1", "-genkey", "-noout", "-out", str(folder / f"{name}.key"))

    def authority(name: str) -> None:
        key(name)
        run_tool(
            *(openssl, "req", "-x509", "-new", "-key", str(folder / f"{name}.key"), "-subj", f"/CN={name}"),
            *("-addext", "keyUsage=critical,keyCertSign,cRLSign"),
            *("-days", "2", "-out", str(folder / f"{name}.pem")),
        )

    def member(name: str, of: str, extra: str = "") -> None:
        key(name)
        request, extensions = folder / f"{name}.csr", folder / f"{name}.ext"
        run_tool(
            *(
                openssl,
                "req",
                "-new",
                "-key",
                str(folder / f"{name}.key"),
                "-subj",
                f"/CN={name.split('-', maxsplit=1)[0]}",
            ),
            *("-out", str(request)),
        )
        told = "basicConstraints=CA:FALSE\nkeyUsage=critical,digitalSignature\n"
        told += "subjectKeyIdentifier=hash\nauthorityKeyIdentifier=keyid\n"
        extensions.write_text(f"{told}{extra}\n", encoding="ascii")
        run_tool(
            *(openssl, "x509", "-req", "-in", str(request), "-CA", str(folder / f"{of}.pem")),
            *("-CAkey", str(folder / f"{of}.key"), "-CAcreateserial", "-days", "2"),
            *("-extfile", str(extensions), "-out", str(folder / f"{name}.pem")),
        )

    authority("ca")
    authority("gateway-ca")
    authority("stranger")
    member("broker", "ca", "subjectAltName=IP:127.0.0.1,DNS:localhost")
    for role in (*ROLES, "MR1", WITNESS):
        member(role, "gateway-ca" if role == "gateway" else "ca")
    member("gateway-false", "stranger")
    return folder


class Mosquitto:
    """One broker process. ``folder`` is its own; what it keeps outlives ``kill``."""

    def __init__(self, folder: Path, *, tls: Path | None = None, extra: str = "") -> None:
        """``tls`` are the certificates: with them it runs ``deploy/mqtt`` as it stands, but for port and paths."""
        self.port = free_port()
        #: With TLS: where the gateway is let in.
        self.gateway_port = free_port()
        self._folder, self._tls = folder, tls
        self._process: asyncio.subprocess.Process | None = None
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "data").mkdir(exist_ok=True)
        self._configure(extra)

    def _configure(self, extra: str) -> None:
        if self._tls is None:
            text = f"listener {self.port} 127.0.0.1\nallow_anonymous true\n"
            text += "persistence true\npersistence_location ./data/\nautosave_interval 1\nautosave_on_changes false\n"
        else:
            text = (DEPLOY / "mosquitto.conf").read_text(encoding="utf-8")
            for shipped, port in ((8883, self.port), (8884, self.gateway_port)):
                text = text.replace(f"listener {shipped}\n", f"listener {port} 127.0.0.1\n")
                assert str(port) in text
            acl = (DEPLOY / "acl.conf").read_text(encoding="utf-8")
            acl += (DEPLOY / "acl-machines.conf").read_text(encoding="utf-8")
            acl += f"user {WITNESS}\ntopic readwrite #\n"
            (self._folder / "acl.conf").write_text(acl, encoding="utf-8")
            for name in ("ca.pem", "gateway-ca.pem", "broker.pem", "broker.key"):
                shutil.copy(self._tls / name, self._folder / name)
        if os.geteuid() == 0:
            text += "user root\n"
        (self._folder / "mosquitto.conf").write_text(text + extra, encoding="utf-8")

    async def start(self) -> None:
        """Run it, and wait until it listens."""
        path = require_tool("mosquitto")
        self._process = await asyncio.create_subprocess_exec(
            path, "-v", "-c", "mosquitto.conf", cwd=self._folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL
        )
        assert self._process.stderr is not None
        said = b""
        async with asyncio.timeout(DEADLINE_S):
            while b" running" not in said:
                line = await self._process.stderr.readline()
                assert line, f"mosquitto ended: {said.decode(errors='replace')}"
                said += line
        self._draining = asyncio.ensure_future(self._drain(self._process.stderr))

    async def _drain(self, stderr: asyncio.StreamReader) -> None:
        while await stderr.readline():
            pass

    def freeze(self) -> None:
        """SIGSTOP."""
        self._signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """SIGCONT."""
        self._signal(signal.SIGCONT)

    async def kill(self) -> None:
        """SIGKILL; it has no time to write anything down."""
        await self._end(signal.SIGKILL)

    async def stop(self) -> None:
        """In order, whatever state it is in."""
        if self._process is not None and self._process.returncode is None:
            self.thaw()
            await self._end(signal.SIGTERM)

    def _signal(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    async def _end(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._signal(number)
        async with asyncio.timeout(DEADLINE_S):
            await self._process.wait()
            await self._draining

    def address(self, role: str = "gateway", *, certificate: str | None = None) -> BrokerAddress:
        """How one of a role reaches it."""
        if self._tls is None:
            return BrokerAddress("127.0.0.1", self.port)
        name = role if certificate is None else certificate
        port = self.gateway_port if role == "gateway" else self.port
        mine, key = self._tls / f"{name}.pem", self._tls / f"{name}.key"
        return BrokerAddress("127.0.0.1", port, True, None, None, self._tls / "ca.pem", mine, key)

    def broker(self, role: str = "gateway") -> MqttBroker:
        """The port, with short patience."""
        return MqttBroker(self.address(role), keepalive_s=5, timeout_s=2.0)
