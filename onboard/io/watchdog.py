"""The systemd service manager as supervisor: ``sd_notify(3)`` with the standard library."""

import os
import socket
from collections.abc import Mapping


class SystemdWatchdog:
    """``ports.Watchdog`` over the datagram socket that ``NOTIFY_SOCKET`` names; without it every call does nothing.

    ``period_us`` is the time in which the manager wants to hear ``alive`` (``WATCHDOG_USEC``, where ``WATCHDOG_PID``
    is this process or absent), 0 where it does not. What cannot be told is counted in ``failures``: a manager that
    does not listen must not stop a machine.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        """``environment`` is the process's own where none is given."""
        variables = os.environ if environment is None else environment
        self.failures = 0
        self.period_us = _period_us(variables)
        self._address = variables.get("NOTIFY_SOCKET", "")
        if self._address.startswith("@"):
            self._address = "\0" + self._address[1:]
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK)

    def ready(self) -> None:
        """Say ``READY=1``: units ordered after this one may start."""
        self._tell("READY=1")

    def alive(self) -> None:
        """Say ``WATCHDOG=1``; wanted at least once in ``period_us``."""
        self._tell("WATCHDOG=1")

    def status(self, text: str) -> None:
        """``STATUS=`` with ``text`` on one line."""
        self._tell("STATUS=" + " ".join(text.split()))

    def close(self) -> None:
        """``STOPPING=1``; later calls do nothing."""
        self._tell("STOPPING=1")
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _tell(self, state: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(state.encode(), self._address)
        except OSError:
            self.failures += 1


def _period_us(variables: Mapping[str, str]) -> int:
    text, process = variables.get("WATCHDOG_USEC", ""), variables.get("WATCHDOG_PID", "")
    return int(text) if text.isdecimal() and process in ("", str(os.getpid())) else 0
