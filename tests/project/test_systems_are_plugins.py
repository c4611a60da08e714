"""A system is a folder pair and nothing else knows it; a seventh is a package of its own and no edited file."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.project import plugins
from tests.project.plugins import ROOT, SYSTEMS
from tests.tools import DEADLINE_S

PLUGIN = ROOT / "tests" / "plugin"
PAGE = ROOT / "docs" / "new-system.md"
#: A site file of version 0.1 does not say what it is: the one place outside that may name a system.
ONE = "onboard/systems/registry.py"


@pytest.mark.parametrize("system", SYSTEMS)
def test_at_most_one_file_outside_its_folders_names_a_system(system: str) -> None:
    assert plugins.outsiders(system) <= {ONE}


def test_nobody_outside_asks_what_type_a_site_has() -> None:
    assert plugins.asks_for_site_type() == {}


def test_the_simulator_casts_nothing() -> None:
    assert plugins.casts("bus_sim") == []


def test_no_files_import_each_other_in_a_circle() -> None:
    assert plugins.circles() == []


def test_there_is_one_options_class_one_run_and_one_stage() -> None:
    """Beside the options of a bus node. A loop that somebody drives outside a system's folder is a second runner."""
    classes = plugins.classes("bus_sim")
    options = [file for name, file in classes if name.endswith("Options") and name != "NodeOptions"]
    assert options == ["bus_sim/options.py"]
    assert [file for name, file in classes if name == "SystemStage"] == ["bus_sim/systems/stage.py"]
    makers = [file for file, tree in plugins.files().items() if plugins.makes_loop(tree) and not plugins.home(file)]
    assert [file for file in makers if file.startswith("bus_sim/")] == ["bus_sim/session.py"]


# --- a seventh system ------------------------------------------------------------------------------------------


def ordinary(program: str, *words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A program as everybody runs it, where somebody has installed the polishing shop."""
    paths = os.pathsep.join([str(PLUGIN), str(ROOT)])
    command = [sys.executable, "-m", program, *words]
    environment = {**os.environ, "PYTHONPATH": paths}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )


def test_a_seventh_system_is_a_package_of_its_own(tmp_path: Path) -> None:
    """It is run, faulted, and judged by its own rule, by the ordinary commands."""
    site, figures = str(PLUGIN / "shop.toml"), tmp_path / "shop.json"
    fault = "crash:target=New,at_s=3,restart_s=1"
    ran = ordinary(
        "bus_sim.cli", "run", site, "--fault", fault, "--json", str(figures), "--trace", "a.log", folder=tmp_path
    )
    assert ran.returncode == 0, ran.stderr
    assert "parts OOO" in ran.stdout, "its own picture"
    assert json.loads(figures.read_text(encoding="utf-8"))["polished"] == 3
    judged = ordinary("onboard", "trace", "check", "a.log", "--site", site, folder=tmp_path)
    assert judged.returncode == 0 and "polished-once     held" in judged.stdout, judged.stderr
    calls = ordinary("onboard", "trace", "calls", "a.log", "--site", site, folder=tmp_path)
    assert "awarded to New" in calls.stdout, calls.stderr


def test_its_parts_are_drawn_by_seeds_and_survive_faults(tmp_path: Path) -> None:
    words = ("campaign", str(PLUGIN / "shop.toml"), "--seeds", "1-2", "--faults", "bus", "--jobs", "1")
    ran = ordinary("bus_sim.cli", *words, folder=tmp_path)
    assert ran.returncode == 0 and "8 parts: served 8" in ran.stdout, ran.stdout + ran.stderr


def test_the_page_shows_the_package_as_it_is() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for path in sorted(PLUGIN.rglob("*")):
        if path.suffix in (".py", ".toml", ".txt") and path.stat().st_size:
            assert path.read_text(encoding="utf-8").strip() in text, f"{path.relative_to(PLUGIN)} is not in {PAGE.name}"
