"""What is installed beside the program: pinned for every extra, told as a bill of materials, and looked at or not."""

import hashlib
import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

from deploy.cli import main
from deploy.locks import LOCKS, Pin, merged, pins_of, requirements
from deploy.sbom import bill_of_materials
from deploy.wheels import PINS, DeployError

ROOT = Path(__file__).parents[2]
EXTRAS = sorted(requirements())
DIGESTS = [hashlib.sha256(bytes([number])).hexdigest() for number in range(4)]


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_extra_has_a_lock_and_no_other() -> None:
    said = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert sorted(file.stem for file in LOCKS.iterdir()) == EXTRAS == sorted(said["project"]["optional-dependencies"])


@pytest.mark.parametrize("extra", EXTRAS)
def test_a_lock_pins_what_the_extra_asks_for(extra: str) -> None:
    """Where this fails, pyproject.toml has changed since: python -m deploy lock."""
    pins = {pin.name: pin for pin in pins_of(LOCKS / f"{extra}.txt")}
    for wanted in map(Requirement, requirements()[extra]):
        assert wanted.specifier.contains(pins[plain(wanted.name)].version), wanted
    assert all(pin.digests for pin in pins.values())


def chosen(version: str, digest: str, name: str = "Two_Words") -> dict[str, Any]:
    archive = {"archive_info": {"hashes": {"sha256": digest}}}
    return {"install": [{"metadata": {"name": name, "version": version}, "download_info": archive}]}


def test_a_lock_has_the_wheels_of_all_processors_and_one_version() -> None:
    both = merged("web", [chosen("1.0", DIGESTS[1]), chosen("1.0", DIGESTS[0]), chosen("1.0", DIGESTS[1])])
    assert both == [Pin("two-words", "1.0", tuple(sorted(DIGESTS[:2])))]
    with pytest.raises(DeployError, match=r"\[web\]: pip chooses two-words 1.0 and 0.9"):
        merged("web", [chosen("1.0", DIGESTS[1]), chosen("0.9", DIGESTS[0])])


def test_the_bill_names_every_pin_with_its_digests(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sbom", "--out", str(tmp_path / "new" / "bill.json")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'new' / 'bill.json'}\n"
    said = json.loads((tmp_path / "new" / "bill.json").read_text())
    assert (said["bomFormat"], said["specVersion"]) == ("CycloneDX", "1.6")
    found = {(one["name"], one["version"]): one for one in said["components"]}
    for file in (PINS, *LOCKS.iterdir()):
        part = "board" if file == PINS else file.stem
        for pin in pins_of(file):
            one = found[pin.name, pin.version]
            assert {"name": "onboard:part", "value": part} in one["properties"]
            assert {digest["content"] for digest in one["hashes"]} >= set(pin.digests)
            assert one["purl"] == f"pkg:pypi/{pin.name}@{pin.version}"
    assert found["python-can", "4.6.1"]["licenses"] == [{"license": {"name": "LGPL-3.0-only"}}]
    assert len({one["bom-ref"] for one in said["components"]}) == len(found)
    assert said == json.loads(json.dumps(bill_of_materials(said["metadata"]["component"]["version"])))


AUDITOR = (
    f"#!{sys.executable} -IS"
    + """
import json, re, sys
weak, left = {weak!r}, {left!r}
found = []
for line in open(sys.argv[-1]):
    pin = re.match(r"([\\w.-]+)==(\\S+)", line)
    if pin and pin[1] in left:
        found.append({{"name": pin[1], "skip_reason": "Dependency not found on the index"}})
    elif pin:
        known = [{{"id": "PYSEC-2026-1", "fix_versions": ["99.1"]}}] if pin[1] == weak else []
        found.append({{"name": pin[1], "version": pin[2], "vulns": known}})
print("No known vulnerabilities found", file=sys.stderr)
print(json.dumps({{"dependencies": found}}))
"""
)


def auditor(folder: Path, text: str) -> str:
    program = folder / "auditor"
    program.write_text(text)
    program.chmod(0o755)
    return str(program)


def test_an_audit_of_all_tells_how_many_pins_it_looked_at(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    count = sum(len(pins_of(file)) for file in (PINS, *LOCKS.iterdir()))
    assert main(["audit", "--tool", auditor(tmp_path, AUDITOR.format(weak="", left=""))]) == 0
    assert capsys.readouterr().out == f"{count} pins were looked at, none has a known weakness\n"


def test_a_weak_library_is_named_once_with_its_mend(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.audit.LOCKS", tmp_path)
    assert main(["audit", "--tool", auditor(tmp_path, AUDITOR.format(weak="wrapt", left=""))]) == 1
    told = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"wrapt \S+: PYSEC-2026-1; mended in 99\.1", told[0])
    assert told[1:] == [f"{len(pins_of(PINS))} pins were looked at, 1 of the libraries has a known weakness"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            AUDITOR.format(weak="", left="wrapt"),
            "wheels.txt: 1 of 9 libraries were not looked at (Dependency not found",
        ),
        (
            "#!/bin/sh\necho '{\"dependencies\": []}'\n",
            "wheels.txt: 9 of 9 libraries were not looked at (it was passed",
        ),
        ("#!/bin/sh\necho no network >&2\nexit 1\n", "wheels.txt: pip-audit: no network; is there a network?"),
        ("", "auditor: is not installed; make audit installs it"),
    ],
)
def test_an_audit_that_could_not_look_fails(
    text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """pip-audit itself ends with 0 where the index answers nothing."""
    tool = auditor(tmp_path, text) if text else str(tmp_path / "auditor")
    assert main(["audit", "--tool", tool]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and told in said.err
