"""Where the page is served, and whether it can be: without the libraries of the extra ``web``."""

import ipaddress
from importlib.util import find_spec

DEFAULT_PORT = 8080
#: Digits of a port.
_LONGEST_PORT = 5


class WebError(Exception):
    """The page cannot be served; ``str`` is one line for a person."""


def is_installed() -> bool:
    """Whether the libraries of the extra ``web`` are there."""
    return all(find_spec(name) is not None for name in ("starlette", "uvicorn", "websockets"))


def parse_address(where: str) -> tuple[str, int]:
    """Host and port of ``PORT`` or ``HOST:PORT``. Raises ``WebError``."""
    host, _, port = where.rpartition(":")
    if not (port.isascii() and port.isdecimal() and len(port) <= _LONGEST_PORT and int(port) < 1 << 16):
        raise WebError(f"{where}: must be PORT or HOST:PORT, such as 127.0.0.1:{DEFAULT_PORT}")
    return host.strip("[]") or "127.0.0.1", int(port)


def host_of(header: str) -> str:
    """The host of a ``Host`` header, in small letters, without its port and without brackets."""
    host, colon, port = header.rpartition(":")
    return (host if colon and port.isdigit() else header).strip("[]").rstrip(".").lower()


def is_own_host(header: str, names: frozenset[str]) -> bool:
    """Whether a request meant this server: by number, as ``localhost``, or by one of ``names`` (small letters).

    A page whose name has been made to point here (DNS rebinding) brings its own name; a number has none to point.
    """
    host = host_of(header)
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return host == "localhost" or host in names
    return True
