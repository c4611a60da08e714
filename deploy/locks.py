"""Exact versions and digests of what each extra installs: ``locks/EXTRA.txt``, for pip's ``--require-hashes``.

pip itself chooses: among wheels, for each Python and processor that is supported; what developers need, for theirs.
Whoever installs from a lock gets what was looked at when it was written, or nothing.
"""

import json
import platform
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from deploy.wheels import DeployError, pip

LOCKS = Path(__file__).with_name("locks")
PROJECT = Path(__file__).parents[1] / "pyproject.toml"
PYTHONS = ("3.11", "3.12", "3.13")
_PLATFORMS = {
    machine: [f"{form}_{machine}" for form in ("manylinux2014", "manylinux_2_17", "manylinux_2_28")]
    for machine in ("x86_64", "aarch64")
}
_ALL = f"Python {PYTHONS[0]} to {PYTHONS[-1]} on {' and '.join(_PLATFORMS)}"
#: Not everything that tests need comes as a wheel, and only on this computer pip can look into what does not.
_DEVELOPERS = frozenset({"test"})
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)((?: --hash=sha256:[0-9a-f]{64})+)$", re.MULTILINE)
_RESOLVE_S = 600


class Pin(NamedTuple):
    """One library: the digests are those of its wheels, SHA-256 in hex, sorted."""

    name: str
    version: str
    digests: tuple[str, ...]


def requirements(project: Path = PROJECT) -> dict[str, list[str]]:
    """What each extra asks for, with what the program always needs."""
    said = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
    return {extra: [*said["dependencies"], *wanted] for extra, wanted in said["optional-dependencies"].items()}


def pins_of(file: Path) -> list[Pin]:
    """The pins of a lock, or of ``wheels.txt``. Raises ``DeployError`` for a line that is none."""
    text = file.read_text(encoding="utf-8")
    found = [Pin(name, version, tuple(re.findall("[0-9a-f]{64}", said))) for name, version, said in _PIN.findall(text)]
    if len(found) != sum(not line.startswith("#") for line in text.splitlines()) or not found:
        raise DeployError(f"{file}: a line that is no pin with digests; write it anew: python -m deploy lock")
    return found


def write_locks(to: Path = LOCKS, project: Path = PROJECT) -> list[Path]:
    """Have pip choose anew, for every extra: minutes. Raises ``DeployError``: that lock and those behind it stay."""
    to.mkdir(exist_ok=True)
    return [write_lock(extra, wanted, to) for extra, wanted in requirements(project).items()]


def write_lock(extra: str, wanted: list[str], to: Path = LOCKS) -> Path:
    """Have pip choose anew for one extra. Raises ``DeployError``: nothing is written then."""
    here = extra in _DEVELOPERS
    pins = merged(extra, [_report(wanted)] if here else _reports(wanted))
    pythons = f"Python {sys.version_info[0]}.{sys.version_info[1]} on {platform.machine()}" if here else _ALL
    head = f"# [{extra}], {pythons}, Linux; `python -m deploy lock` writes it anew.\n"
    lines = (f"{pin.name}=={pin.version}" + "".join(f" --hash=sha256:{one}" for one in pin.digests) for pin in pins)
    file = to / f"{extra}.txt"
    file.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return file


def merged(extra: str, reports: Iterable[Mapping[str, Any]]) -> list[Pin]:
    """What pip chose for all targets together. Raises ``DeployError`` where it chose two versions of one library."""
    versions: dict[str, str] = {}
    digests: dict[str, set[str]] = {}
    for report in reports:
        for one in report["install"]:
            name, version = re.sub(r"[-_.]+", "-", one["metadata"]["name"]).lower(), one["metadata"]["version"]
            if versions.setdefault(name, version) != version:
                both = f"{name} {versions[name]} and {version}"
                raise DeployError(f"[{extra}]: pip chooses {both} for different Pythons; narrow it in pyproject.toml")
            digests.setdefault(name, set()).add(one["download_info"]["archive_info"]["hashes"]["sha256"])
    return [Pin(name, versions[name], tuple(sorted(digests[name]))) for name in sorted(versions)]


def _reports(wanted: list[str]) -> Iterable[Mapping[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        for python in PYTHONS:
            for platforms in _PLATFORMS.values():
                target = ["--implementation", "cp", "--python-version", python]
                target += [word for one in platforms for word in ("--platform", one)]
                # Nothing is installed: pip wants a place before it chooses for another computer.
                yield _report([*target, "--only-binary=:all:", "--target", folder, *wanted])


def _report(words: list[str]) -> Mapping[str, Any]:
    asked = ["install", "--quiet", "--dry-run", "--ignore-installed", "--report", "-", *words]
    found: Mapping[str, Any] = json.loads(pip(asked, f"pip install {' '.join(words)}", _RESOLVE_S))
    return found
