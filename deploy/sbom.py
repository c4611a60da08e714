"""What the program is made of, as CycloneDX 1.6 (ECMA-424) in JSON: libraries of boards and of every extra.

It says what was pinned, by name, version, digests and licence, and is the same for the same pins. Debian's packages in
the image are not in it.
"""

import json
import re
import uuid
from pathlib import Path
from typing import Any

from deploy.locks import LOCKS, Pin, pins_of
from deploy.wheels import PINS

#: What a board carries is said under this name, beside the names of extras.
BOARD = "board"
NOTICES = Path(__file__).parents[1] / "THIRD_PARTY.md"


def bill_of_materials(version: str, board: Path = PINS, locks: Path = LOCKS, notices: Path = NOTICES) -> dict[str, Any]:
    """The whole document. Raises ``DeployError`` for pins that cannot be read."""
    parts = {BOARD: pins_of(board), **{file.stem: pins_of(file) for file in sorted(locks.glob("*.txt"))}}
    users: dict[tuple[str, str], list[str]] = {}
    digests: dict[tuple[str, str], set[str]] = {}
    for part, pins in parts.items():
        for pin in pins:
            users.setdefault(pin[:2], []).append(part)
            digests.setdefault(pin[:2], set()).update(pin.digests)
    licences = _licences(notices)
    every = [Pin(*key, tuple(sorted(digests[key]))) for key in sorted(users)]
    components = [_component(pin, users[pin[:2]], licences.get(pin.name)) for pin in every]
    root = f"pkg:pypi/onboard-fleet@{version}"
    said: dict[str, Any] = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": root,
                "name": "onboard-fleet",
                "version": version,
                "purl": root,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
            }
        },
        "components": components,
        "dependencies": [{"ref": root, "dependsOn": [one["bom-ref"] for one in components]}],
    }
    # Of the same pins the same document: its number is drawn from what it says.
    said["serialNumber"] = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(said, sort_keys=True))}"
    return said


def write_bill(to: Path, version: str) -> Path:
    """Write the document. Raises ``DeployError`` and ``OSError``."""
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_text(json.dumps(bill_of_materials(version), indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return to


def _component(pin: Pin, users: list[str], licence: str | None) -> dict[str, Any]:
    """``hashes`` has one of each wheel that pip may choose."""
    purl = f"pkg:pypi/{pin.name}@{pin.version}"
    found: dict[str, Any] = {
        "type": "library",
        "bom-ref": purl,
        "name": pin.name,
        "version": pin.version,
        "purl": purl,
        "scope": "required" if BOARD in users else "optional",
        "hashes": [{"alg": "SHA-256", "content": digest} for digest in pin.digests],
        "properties": [{"name": "onboard:part", "value": user} for user in users],
    }
    if licence is not None:
        found["licenses"] = [{"license": {"name": licence}}]
    return found


def _licences(notices: Path) -> dict[str, str]:
    """By library, from the table of what is installed beside the program."""
    rows = re.findall(r"^\| ([\w.-]+) \| [^|]+ \| ([^|]+) \|$", notices.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[-_.]+", "-", name).lower(): licence.strip() for name, licence in rows}
