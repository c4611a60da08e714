"""In the gate a skip is a failure; on a desk it is a skip with its reason."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]

SUITE = {
    "test_call.py": "import pytest\ndef test_needs_a_tool():\n    pytest.skip('no frobnicator here')\n",
    "test_mark.py": "import pytest\n@pytest.mark.skip(reason='no frobnicator here')\ndef test_marked():\n    pass\n",
    "test_module.py": "import pytest\npytest.skip('no frobnicator here', allow_module_level=True)\n",
}


def run_pytest(folder: Path, source: str, require: str) -> subprocess.CompletedProcess[str]:
    """Pytest in a process of its own on one file, with the plugin of this project and nothing else of it."""
    (folder / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    (folder / "test_it.py").write_text(source, encoding="utf-8")
    plugins = ["-p", "tests.skips", "-p", "no:cacheprovider"]
    where = ["--rootdir", str(folder), "-c", str(folder / "pytest.ini"), str(folder / "test_it.py")]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "COV"))}
    # What else is installed for tests takes longer to load than all of this.
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-rs", *plugins, *where],
        cwd=ROOT,
        env=environment | {"REQUIRE": require},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )


@pytest.mark.parametrize("source", SUITE.values(), ids=SUITE.keys())
def test_a_skip_fails_where_all_is_required_and_says_why(tmp_path: Path, source: str) -> None:
    gate = run_pytest(tmp_path, source, "all")
    assert gate.returncode != 0
    assert "skipped: no frobnicator here; REQUIRE=all allows no skip" in gate.stdout


@pytest.mark.parametrize("require", ["", "some"])
def test_a_skip_stays_a_skip_elsewhere(tmp_path: Path, require: str) -> None:
    desk = run_pytest(tmp_path, SUITE["test_call.py"], require)
    assert desk.returncode == 0
    assert "1 skipped" in desk.stdout


def test_an_expected_failure_is_no_skip(tmp_path: Path) -> None:
    source = "import pytest\n@pytest.mark.xfail\ndef test_it():\n    assert False\n"
    gate = run_pytest(tmp_path, source, "all")
    assert gate.returncode == 0
    assert "1 xfailed" in gate.stdout
