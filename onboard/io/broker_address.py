"""Where a broker is and how one shows who one is, as a command line names it."""

import importlib.util
import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path

#: Usual ports: without and with TLS (IANA).
PORTS = {"mqtt": 1883, "mqtts": 8883}
_ADDRESS = re.compile(r"(?P<scheme>mqtts?)://(?:(?P<user>[^@:/]+)@)?(?P<host>\[[^]]+\]|[^:/@]+)(?::(?P<port>\d+))?/?")


@dataclass(frozen=True, slots=True)
class BrokerAddress:
    """Where the broker is and how one shows who one is; ``ca`` None trusts what the system trusts."""

    host: str
    port: int
    tls: bool = False
    user: str | None = None
    password: str | None = None
    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None

    def __str__(self) -> str:
        return f"{'mqtts' if self.tls else 'mqtt'}://{self.host}:{self.port}"


def is_mqtt_installed() -> bool:
    """Whether the extra ``mqtt`` is there."""
    return importlib.util.find_spec("aiomqtt") is not None


def parse_broker(text: str) -> BrokerAddress:
    """``mqtt://[USER@]HOST[:PORT]``, or ``mqtts://`` with TLS. Raises ``ValueError`` with the remedy."""
    found = _ADDRESS.fullmatch(text)
    if found is None:
        raise ValueError(f"{text}: not an address; write mqtt://HOST:PORT, or mqtts://HOST:PORT with TLS")
    port = int(found["port"] or PORTS[found["scheme"]])
    if not 0 < port < 65_536:
        raise ValueError(f"{text}: port {port} is not from 1 to 65535")
    return BrokerAddress(found["host"].strip("[]"), port, found["scheme"] == "mqtts", found["user"])


def is_loopback(host: str) -> bool:
    """Whether a host is this computer itself, by number or as ``localhost``; another name may be anybody."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"
