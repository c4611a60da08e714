"""The rules of the house hold in the sources, and each rule notices its breach."""

import subprocess
from pathlib import Path

import pytest

from tests.project.sources import MAX_LINES, check_text, check_tree, text_files
from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]

# Written in pieces, so that this file keeps the rules that it tests.
IGNORE, NOQA, DUTY = "# type: " + "ignore", "# no" + "qa", "# TO" + "DO"

WRONG = {
    "too long": "x = 1\n" * (MAX_LINES + 1),
    "sleep": "import time\ntime.sleep(1)\n",
    "sleep by name": "from time import sleep\n",
    "ignore without rule": f"x = 1  {IGNORE}  # the stubs are wrong here\n",
    "ignore without reason": f"x = 1  {IGNORE}[arg-type]\n",
    "noqa without rule": f"x = 1  {NOQA}\n",
    "noqa without reason": f"x = 1  {NOQA}: E501\n",
    "left to do": f"x = 1  {DUTY} the rest\n",
    "bare except": "try:\n    f()\nexcept:\n    pass\n",
    "broad except": "try:\n    f()\nexcept (OSError, Exception):\n    pass\n",
    "machine path": "x = '" + "/" + "root/thing'\n",
}

RIGHT = {
    "ignore": f"x = 1  {IGNORE}[arg-type]  # the library's annotation is too narrow\n",
    "noqa": f"x = 1  {NOQA}: SLF001, E501  asyncio has no public name for it\n",
    "broad except": "try:\n    f()\nexcept Exception:  # a listener must never stop the bus\n    pass\n",
    "narrow except": "try:\n    f()\nexcept OSError:\n    pass\n",
    "device path": "x = '/dev/ttyUSB0'\n",
    "other sleep": "import asyncio\nasync def f():\n    await asyncio.sleep(1)\n",
}


def test_the_sources_keep_the_rules_of_the_house() -> None:
    breaches = check_tree(ROOT)
    assert not breaches, "\n".join(breaches)


def test_the_walk_finds_sources_documents_and_scripts() -> None:
    names = {file.relative_to(ROOT).as_posix() for file in text_files(ROOT)}
    assert {"onboard/core/frame.py", "dbc/fleet.dbc", "docs/decisions.md", "Makefile", ".ci/run"} <= names


@pytest.mark.parametrize("text", WRONG.values(), ids=WRONG.keys())
def test_a_breach_is_reported_with_its_line(text: str) -> None:
    breaches = check_text("onboard/a.py", text)
    assert breaches
    assert all(breach.startswith("onboard/a.py:") for breach in breaches)


@pytest.mark.parametrize("text", RIGHT.values(), ids=RIGHT.keys())
def test_what_is_allowed_is_not_reported(text: str) -> None:
    assert check_text("onboard/a.py", text) == []


def test_a_document_that_is_named_must_exist(tmp_path: Path) -> None:
    (tmp_path / "onboard").mkdir()
    name = "docs/" + "nowhere.md"
    (tmp_path / "onboard" / "a.py").write_text(f'"""See {name}."""\n', encoding="utf-8")
    assert check_tree(tmp_path) == [f"onboard/a.py:1: {name} does not exist"]


#: What stands at the top of the project: fixed by the customer, and what tools need.
TOP = frozenset(
    [
        ".ci",
        ".gitignore",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "LICENSE",
        "Makefile",
        "NOTICE",
        "README.md",
        "SECURITY.md",
        "THIRD_PARTY.md",
        "bench",
        "bus_sim",
        "dbc",
        "deploy",
        "docs",
        "examples",
        "hil",
        "onboard",
        "pyproject.toml",
        "tests",
    ]
)


def test_nothing_that_a_run_left_behind_is_kept_at_the_top() -> None:
    if not (ROOT / ".git").exists():
        return  # unpacked from an archive: what lies here is what was kept, and what a run leaves besides
    command = ["git", "-C", str(ROOT), "-c", f"safe.directory={ROOT}", "ls-files", "-z"]
    kept = subprocess.run(command, check=True, capture_output=True, text=True, timeout=DEADLINE_S).stdout.split("\0")
    assert sorted({name.split("/")[0] for name in kept if name} - TOP) == []
