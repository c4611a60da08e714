"""What many tests look at is made once in a session, by the worker that asks first, and is gone when it ends."""

import fcntl
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp

import pytest

#: Environment variable: the folder of the session, which all its workers share.
VARIABLE = "MADE_ONCE"


def once(name: str, make: Callable[[Path], object]) -> Path:
    """The folder of this name, filled by ``make``. Who asks meanwhile waits; what failed is tried again."""
    folder = Path(os.environ[VARIABLE]) / name
    made = folder.with_name(f"{name}.made")
    with folder.with_name(f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not made.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            make(folder)
            made.touch()
    return folder


def begin(config: pytest.Config) -> None:
    """Before there are workers: they inherit it."""
    if not hasattr(config, "workerinput"):
        os.environ[VARIABLE] = mkdtemp(prefix="tests-")


def end(config: pytest.Config) -> None:
    """After the last of them."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(VARIABLE))
