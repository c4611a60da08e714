"""What `make` says to somebody whose computer lacks something: one line of what is wrong, one of what to do."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]
#: A Python that makes environments, and whose pip reaches nobody.
OFFLINE = """\
#!/bin/sh
case "$1 $2" in
  "-m venv") mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
  "-m pip")
    for n in 1 2 3 4 5; do echo "WARNING: Retrying: [Errno 101] Network is unreachable" >&2; done
    echo "  ERROR: Could not find a version that satisfies the requirement hatchling" >&2
    echo "ERROR: No matching distribution found for hatchling" >&2
    echo "note: This error originates from a subprocess" >&2
    exit 1 ;;
esac
"""


def make(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    shutil.copy(ROOT / "Makefile", folder)
    shutil.copy(ROOT / "pyproject.toml", folder)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "PIP_"))}
    return subprocess.run(
        ["make", "--no-print-directory", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )


@pytest.mark.parametrize(("goal", "extras"), [("run", ".[sim,web]"), ("lint", ".[sim,web,mqtt,parquet,test]")])
def test_without_a_network_make_says_what_to_do(goal: str, extras: str, tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text(OFFLINE)
    python.chmod(0o755)
    done = make(tmp_path, goal, f"PYTHON={python}")
    assert done.returncode == 2
    mistake, remedy, *rest = done.stderr.splitlines()
    assert mistake.strip() == "ERROR: Could not find a version that satisfies the requirement hatchling"
    assert f"pip download --dest wheels hatchling editables '{extras}'" in remedy
    assert f"PIP_NO_INDEX=1 PIP_FIND_LINKS=wheels make {goal}" in remedy
    assert all(line.startswith("make: *** ") for line in rest), "and what make itself says at its end"
    assert not (tmp_path / ".venv" / f".{goal}").exists(), "the next make tries again"


def test_without_a_usable_python_make_says_what_to_install(tmp_path: Path) -> None:
    done = make(tmp_path, "run", "PYTHON=/no/such/python")
    assert done.returncode == 2
    assert "no usable Python among: /no/such/python (3.11 or newer" in done.stderr
    assert "apt install python3-venv" in done.stderr
