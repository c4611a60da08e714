"""What tests in a guest share: its skip by name, one run for all tests of a module, and sites that live fast."""

import fcntl
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hil.guest.machine import GuestRun, missing_for_guest

ROOT = Path(__file__).parents[2]


def require_guest() -> None:
    """Skip where the host lacks something for a guest, by its name; ``REQUIRE=all`` makes that a failure."""
    why = missing_for_guest()
    if why is not None:
        pytest.skip(why)


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], GuestRun]) -> Path:
    """The shared folder of one run for all processes of this test session: the first makes it, others wait.

    What a run that ended badly said is told by every test that asks for it.
    """
    base = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent
    share, story = base / name, base / f"{name}.json"
    with (base / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not story.exists():
            story.write_text(json.dumps(_told(make, share)), encoding="utf-8")
    failure = json.loads(story.read_text(encoding="utf-8"))
    if failure:
        pytest.fail(failure, pytrace=False)
    return share


def _told(make: Callable[[Path], GuestRun], share: Path) -> str:
    try:
        done = make(share)
    except Exception as error:  # noqa: BLE001 - whatever it is, each test that needs the run shall tell it
        return f"the guest failed: {error!r}"
    if done.status == 0:
        return ""
    logs = "".join(f"--- {file.name}\n{_last(file)}\n" for file in sorted(share.glob("*.txt")))
    return f"the scene ended with status {done.status}\n{done.output}\n{logs}"


def _last(file: Path) -> str:
    return "\n".join(file.read_text(errors="replace").splitlines()[-12:])


def scene_script(module: str) -> str:
    """The guest's script that runs a scene of this folder, with the interpreter and the sources of this process."""
    settings = f"export PYTHONPATH={ROOT} PYTHONDONTWRITEBYTECODE=1 COLUMNS=200"
    return f"{settings}\nexec {sys.executable} -m {module} /run/share\n"
