"""One machine's ``onboard`` as a process of the operating system."""

import asyncio
import os
import sys
from asyncio.subprocess import DEVNULL, Process
from pathlib import Path

import onboard


async def start_machine(directory: Path, name: str) -> Process:
    """Run ``onboard --machine NAME.toml`` in ``directory``; what it says on standard error is added to its log file.

    The file is ``log_of(directory, name)``. Raises ``OSError`` where the process cannot be started.
    """
    root = str(Path(onboard.__file__).parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    with log_of(directory, name).open("ab") as log:
        return await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "onboard", "--machine", f"{name}.toml"),
            cwd=directory,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=DEVNULL,
            stdout=DEVNULL,
            stderr=log,
            # A key pressed in this terminal ends the run, and the run ends its processes.
            start_new_session=True,
        )


def log_of(directory: Path, name: str) -> Path:
    """Where a machine's process writes what it has to say."""
    return directory / f"{name}.log"
