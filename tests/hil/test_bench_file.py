"""The bench file: what may be written, what is said of mistakes, and what a bench without something leaves out."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from hil.bench import Capability, TargetKind, load_bench
from hil.play import missing
from hil.scenarios.registry import SCENARIOS
from onboard.config.problems import ConfigError
from tests.hil.bench_files import BENCHES, write_bench
from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]


def test_the_default_bench_lacks_nothing_that_a_scenario_asks_for() -> None:
    bench = load_bench(BENCHES / "simulated.toml")
    assert [(target.machine.name, target.kind) for target in bench.targets] == [("MR1", TargetKind.PROCESS)]
    assert [missing(scenario, target) for target in bench.targets for scenario in SCENARIOS] == [[]] * len(SCENARIOS)


def test_the_template_for_a_board_is_in_order_and_names_every_capability() -> None:
    (board,) = load_bench(BENCHES / "board.toml").targets
    assert board.capabilities == set(Capability)
    assert all(board.resources.has(capability) for capability in Capability)
    assert board.resources.buses[Capability.FLEET_BUS].channel == "can0"


WRONG = {
    "a machine of another site": (
        '[[targets]]\nmachine = "MR9"\nkind = "process"\n',
        'mine.toml:6: targets[0].machine = "MR9": no such machine in site bench; did you mean "MR',
    ),
    "an unknown capability": (
        '[[targets]]\nmachine = "MR1"\nkind = "process"\ncapabilities = ["fleet_buss"]\n',
        'unknown capability; did you mean "fleet_bus"?',
    ),
    "a capability without its resource": (
        '[[targets]]\nmachine = "MR1"\nkind = "board"\ncapabilities = ["power"]\n',
        "nothing on this bench does that; add a table [targets.power]",
    ),
    "a command that is one text": (
        '[[targets]]\nmachine = "MR1"\nkind = "board"\n[targets.power]\non = "poweron"\noff = ["poweroff"]\n',
        "write a list of words",
    ),
    "an empty command": (
        '[[targets]]\nmachine = "MR1"\nkind = "board"\n[targets.power]\non = []\noff = ["poweroff"]\n',
        "targets[0].power.on = []: no command; write a list of words",
    ),
    "an unknown key": (
        '[[targets]]\nmachine = "MR1"\nkind = "process"\ncapabilites = []\n',
        'unknown key; did you mean "capabilities"?',
    ),
    "no target": ("", "no device under test; add a table [[targets]]"),
}


@pytest.mark.parametrize(("targets", "said"), WRONG.values(), ids=WRONG.keys())
def test_a_mistake_is_told_with_its_place_and_remedy(targets: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_bench(write_bench(tmp_path, targets))
    assert said in str(caught.value)


def test_a_site_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    file = write_bench(tmp_path, '[[targets]]\nmachine = "MR1"\nkind = "process"\n')
    (tmp_path / "bench.toml").unlink()
    with pytest.raises(ConfigError, match="no such file; write its path as seen from the bench file"):
        load_bench(file)


def run_bench(file: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """``pytest hil --bench`` as a person calls it."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "hil", "-q", "-p", "no:cacheprovider", "--bench", str(file), *words],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )


def test_what_a_bench_has_not_is_skipped_by_name_and_figures_are_in_the_report(tmp_path: Path) -> None:
    capabilities = '["fleet_bus", "device_bus", "counters"]'
    file = write_bench(tmp_path, f'[[targets]]\nmachine = "MR1"\nkind = "simulated"\ncapabilities = {capabilities}\n')
    run = run_bench(file, f"--junitxml={tmp_path / 'report.xml'}", f"--traces={tmp_path / 'traces'}")
    assert run.returncode == 0, run.stdout + run.stderr
    assert "bench mine: MR1 has no cable" in run.stdout
    assert "bench mine: call to bid: worst" in run.stdout and "bench mine: grant to motion: worst" in run.stdout
    cases = {case.get("name"): case for case in ET.parse(tmp_path / "report.xml").iter("testcase")}
    assert len(cases) == len(SCENARIOS)
    skipped = [name for name, case in cases.items() if case.find("skipped") is not None]
    assert len(skipped) == sum(bool(scenario.needs - {"fleet_bus", "device_bus"}) for scenario in SCENARIOS)
    properties = {
        one.get("name"): one.get("value") for one in cases["test_scenario[MR1 moves under authority]"].iter("property")
    }
    assert {"call_to_bid_worst_us", "grant_to_motion_worst_us", "tec", "rec"} <= properties.keys()
    trace = properties["trace"]
    assert trace is not None and Path(trace).parent == tmp_path / "traces" / "MR1-moves-under-authority"
    assert Path(trace).stat().st_size > 0


def test_a_wrong_bench_file_is_one_line_and_no_test_runs(tmp_path: Path) -> None:
    run = run_bench(write_bench(tmp_path, ""))
    assert run.returncode == 4
    assert "no device under test; add a table [[targets]]" in run.stderr
    assert "Traceback" not in run.stderr + run.stdout
