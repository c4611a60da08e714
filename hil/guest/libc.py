"""What Python 3.11 does not offer of the C library."""

import ctypes
import os

#: The kind of namespace (linux/sched.h).
_CLONE_NEWNET = 0x40000000


def setns(descriptor: int) -> None:
    """Put this thread into a network namespace (setns(2); ``os.setns`` from Python 3.12 on). Raises ``OSError``."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.setns(descriptor, _CLONE_NEWNET):
        number = ctypes.get_errno()
        raise OSError(number, f"setns: {os.strerror(number)}")
