"""``bus-sim run`` on sites of other systems than the car park, and ``onboard trace check`` on what it wrote."""

from pathlib import Path

import pytest

import bus_sim.sites
from bus_sim.cli import main as bus_sim_main
from onboard.cli import main as onboard_main


@pytest.mark.parametrize(
    ("system", "rules", "says"),
    [
        (
            "cell",
            ("inside-area", "part-passed-on", "predecessors"),
            "The cost of the goal fulfilment is: 65,2119063886405",
        ),
        ("turning", ("bills-add-up", "one-lathe"), "order 2: 4 x shaft: DONE L2 7.13 EUR a part"),
    ],
)
def test_a_run_leaves_a_trace_that_is_judged(
    system: str, rules: tuple[str, ...], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.log"
    assert (
        bus_sim_main(["run", system, "--speed", "max", "--trace", str(log), "--json", str(tmp_path / "run.json")]) == 0
    )
    told = capsys.readouterr().out
    assert told.startswith(f"site {system}, seed 1") and says in told and "violations: none" in told
    assert (tmp_path / "run.json").read_text(encoding="utf-8").startswith('{\n  "site"')
    site = Path(bus_sim.sites.__file__).parent / f"{system}.toml"
    assert onboard_main(["trace", "check", str(log), "--site", str(site)]) == 0
    verdict = capsys.readouterr().out
    for rule in rules:
        assert any(line.split()[:2] == [rule, "held:"] for line in verdict.splitlines()), verdict


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("crash:target=R9,at_s=20", "target=R9: no such machine on site cell; known here: GM, R1"),
        (
            "lost_ticket:car=1",
            "cell: a manufacturing cell has nothing that this strikes (a customer comes back without the ticket)",
        ),
    ],
)
def test_a_fault_that_a_cell_cannot_have_is_one_line(fault: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert bus_sim_main(["run", "cell", "--fault", fault]) == 2
    told = capsys.readouterr()
    assert says in told.err and len(told.err.strip().splitlines()) == 1
