"""The pinned wheels of a board: fetched once by pip, and never another than ``wheels.txt`` says."""

import hashlib
import re
import subprocess
import sys
from pathlib import Path

PINS = Path(__file__).with_name("wheels.txt")
STORE = Path(__file__).parents[1] / "build" / "wheels"
#: The boards' platform and Debian 12's Python.
_PLATFORM = (
    *("--platform", "manylinux2014_aarch64", "--platform", "manylinux_2_17_aarch64"),
    *("--python-version", "3.11", "--implementation", "cp", "--abi", "cp311", "--abi", "none"),
)
_FETCH_S = 300


class DeployError(Exception):
    """Something cannot be built; ``str`` is one line for a person."""


def pinned_wheels(pins: Path = PINS, store: Path = STORE) -> list[Path]:
    """All wheels of ``pins``, in its order; pip fetches what the store lacks. Raises ``DeployError``."""
    wanted = _digests(pins)
    if not wanted.keys() <= _there(store).keys():
        _fetch(pins, store)
    there = _there(store)
    missing = [name for digest, name in wanted.items() if digest not in there]
    if missing:
        raise DeployError(f"{pins.name}: pip brought no wheel of {missing[0]} with the digest there")
    return [there[digest] for digest in wanted]


def _digests(pins: Path) -> dict[str, str]:
    """Of every pin its digest, and what it is."""
    found = re.findall(r"^(\S+==\S+) --hash=sha256:([0-9a-f]{64})$", pins.read_text(encoding="utf-8"), re.MULTILINE)
    return {digest: name for name, digest in found}


def _there(store: Path) -> dict[str, Path]:
    return {hashlib.sha256(file.read_bytes()).hexdigest(): file for file in sorted(store.glob("*.whl"))}


def _fetch(pins: Path, store: Path) -> None:
    words = ["download", "--quiet", "--no-deps", "--only-binary=:all:", "--require-hashes", *_PLATFORM]
    pip([*words, "-d", str(store), "-r", str(pins)], pins.name, _FETCH_S)


def pip(words: list[str], what: str, limit_s: float) -> str:
    """What pip prints. Raises ``DeployError`` with its last reason, after ``what``; it may take ``limit_s``."""
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--disable-pip-version-check", *words],
        capture_output=True,
        text=True,
        timeout=limit_s,
        check=False,
    )
    if done.returncode:
        errors = [line for line in done.stderr.splitlines() if line.startswith("ERROR")] or ["pip said nothing"]
        raise DeployError(f"{what}: {errors[-1]}; is the package index there?")
    return done.stdout
