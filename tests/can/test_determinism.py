import os
import subprocess
import sys
from pathlib import Path

from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]


def log(hash_seed: str) -> bytes:
    command = [sys.executable, "-m", "tests.can.busy_day", "400000"]
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, check=True, timeout=DEADLINE_S
    ).stdout


def test_two_processes_with_different_hash_seeds_write_the_same_bytes() -> None:
    first, second = log("0"), log("4711")
    assert first == second
    text = first.decode()
    assert text.count("\n") > 4_000
    assert " E" in text
    assert "struck 0" not in text
