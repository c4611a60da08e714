"""Whether any pinned library has a known weakness, by pip-audit; and whether that was looked at, for every one.

pip-audit by itself says "No known vulnerabilities found" and ends with 0 where the index answered nothing.
"""

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from deploy.locks import LOCKS, pins_of
from deploy.wheels import PINS, DeployError

_LIMIT_S = 600
_MOST_SHOWN = 300


class Weakness(NamedTuple):
    """One library with what is known of it: identifiers, and versions in which it is mended."""

    name: str
    version: str
    known: tuple[str, ...]
    mended_in: tuple[str, ...]

    def __str__(self) -> str:
        """One line for a person."""
        after = f"; mended in {', '.join(self.mended_in)}" if self.mended_in else "; no mend is known"
        return f"{self.name} {self.version}: {', '.join(self.known)}{after}"


def audited(tool: str, files: Sequence[Path] = ()) -> tuple[int, list[Weakness]]:
    """How many libraries were looked at, and the weak ones.

    Raises ``DeployError`` where pip-audit is missing or failed, and where one was not looked at.
    """
    looked_at, found = 0, dict[str, Weakness]()
    for file in files or [PINS, *sorted(LOCKS.glob("*.txt"))]:
        said = _asked(tool, file)
        left = [one["name"] for one in said if "vulns" not in one]
        wanted = {pin.name for pin in pins_of(file)}
        left += sorted(wanted - {one["name"].lower().replace("_", "-").replace(".", "-") for one in said})
        if left:
            why = next((str(one["skip_reason"]) for one in said if "skip_reason" in one), "it was passed over")
            count = f"{len(left)} of {len(wanted)} libraries were not looked at"
            raise DeployError(f"{file.name}: {count} ({why[:_MOST_SHOWN]}); is there a network?")
        looked_at += len(said)
        for one in said:
            if one["vulns"]:
                known = tuple(weak["id"] for weak in one["vulns"])
                mended = tuple(sorted({fix for weak in one["vulns"] for fix in weak["fix_versions"]}))
                found[one["name"]] = Weakness(one["name"], one["version"], known, mended)
    return looked_at, list(found.values())


def _asked(tool: str, file: Path) -> list[dict[str, Any]]:
    words = ["--disable-pip", "--require-hashes", "--format", "json", "--progress-spinner", "off", "-r", str(file)]
    try:
        done = subprocess.run([tool, *words], capture_output=True, text=True, timeout=_LIMIT_S, check=False)
    except FileNotFoundError:
        raise DeployError(f"{tool}: is not installed; make audit installs it, or name another with --tool") from None
    except subprocess.TimeoutExpired:
        raise DeployError(f"{file.name}: pip-audit has not ended within {_LIMIT_S} s; is there a network?") from None
    try:
        said: list[dict[str, Any]] = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError):
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise DeployError(f"{file.name}: pip-audit: {last[:_MOST_SHOWN]}; is there a network?") from None
    return said
