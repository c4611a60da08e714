"""The algorithms remain the same in processes of their own (row P58): a site at the pace of the clock, over sockets.

Every machine is a process that runs ``onboard``; buses, plant and customers are simulated and served to them. Machines
join late, leave, and are killed and started again while the others go on. What the trace tells is judged by the same
checkers as a run in one process, and the car's story is the same.
"""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from onboard.config.site import parse_site
from onboard.contract.messages import Award, CallForProposals, Heartbeat, Message, TaskReport
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.check.checks import Checks, check_records
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.tools import DEADLINE_S

Capture = pytest.CaptureFixture[str]

#: Machines so fast that a car is parked in less than a minute.
SITE = """
[site]
name = "fast"
[floors]
count = 3
positions = 4
[carrier]
speed_mm_s = 3_000
acceleration_mm_s2 = 3_000
[shuttle]
speed_mm_s = 5_000
acceleration_mm_s2 = 5_000
[lift]
speed_mm_s = 3_000
acceleration_mm_s2 = 3_000
[timing]
door_ms = 500
grip_ms = 300
[negotiation]
call_at = "key"
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,3)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[robots]]
name = "MR1"
node = 11
home = "p(2,2)"
[[robots]]
name = "MR2"
node = 12
home = "p(3,2)"
"""
#: Bus time is that of the wall here, and on a busy machine a start takes seconds: MR1 has 10 s to be heard in before
#: its power fails, and 16 s to come back in, MR2 16 s between coming and going. With this seed the car is called for
#: after 30 s and parked after 50; its driver would have it back after 75.
CAR = ["--one-car", "1", "--seed", "19", "--for", "60"]
CHANGES = ["--join", "MR2=8", "--kill", "MR1=10", "--join", "MR1=14", "--leave", "MR2=24"]


def heard(trace: Path) -> list[tuple[float, Message]]:
    """Every message of the fleet bus, with its seconds since the trace began."""
    decoder, found, begin_us = Decoder(fleet_codec()), [], None
    with trace.open("rb") as lines:
        for record in CandumpReader(lines):
            begin_us = record.time_us if begin_us is None else begin_us
            message = decoder.feed(record.frame, record.time_us) if record.channel == "fleet" else None
            if message is not None:
                found.append(((record.time_us - begin_us) / 1e6, message))
    return found


def story(messages: list[tuple[float, Message]]) -> list[str]:
    """What was called, awarded and reported of the car's two tasks, in order, repeats left out; who won may differ."""
    told = []
    for _, message in messages:
        if isinstance(message, CallForProposals) and message.depth == 0:
            told.append(f"call {message.operation.name} {message.task.number}")
        elif isinstance(message, Award) and message.task.origin == 1 and message.sender == 1:
            told.append(f"award {message.result.name} {message.task.number}")
        elif isinstance(message, TaskReport) and message.sender in (11, 12):
            told.append(f"{message.phase.name} {message.task.number}")
    return list(dict.fromkeys(told))


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a finished run with every machine in a process of its own."""
    where = tmp_path_factory.mktemp("processes")
    (where / "fast.toml").write_text(SITE)
    words = ["run", "fast.toml", "--processes", "--process-dir", "life", *CAR, *CHANGES]
    words += ["--trace", "trace.log", "--devices", "--json", "figures.json"]
    run = subprocess.run(
        [sys.executable, "-m", "bus_sim.cli", *words],
        cwd=where,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    # 1: the driver who wants the car back still waits when the minute is over.
    assert run.returncode == 1, run.stdout + run.stderr
    (where / "shown.txt").write_text(run.stdout)
    return where


def test_p58_the_car_is_served_and_the_trace_passes_the_same_checkers(processes: Path) -> None:
    figures = json.loads((processes / "figures.json").read_text())
    assert (figures["cars_in"], figures["violations"]) == (1, [])
    with (processes / "trace.log").open("rb") as lines:
        verdict = check_records(CandumpReader(lines), Checks(parse_site(SITE, "fast.toml"), disturbed=True))
    assert verdict.is_good, "\n".join(verdict.lines())
    assert not verdict.unknown


def test_p58_the_story_is_that_of_a_run_in_one_process(processes: Path, tmp_path: Path) -> None:
    (tmp_path / "fast.toml").write_text(SITE)
    trace = tmp_path / "trace.log"
    assert bus_sim(["run", str(tmp_path / "fast.toml"), *CAR, "--trace", str(trace)]) == 1
    alone = story(heard(trace))
    assert alone[:3] == ["call PARK 1", "award AWARDED 1", "AWARDED 1"]
    # The pace of the clock is not that of virtual time to the last second: the end may differ by a step.
    told = story(heard(processes / "trace.log"))
    shared = min(len(told), len(alone))
    assert told[:shared] == alone[:shared]
    assert "DONE 1" in told[:shared]


def test_p58_machines_join_leave_and_come_back_while_the_site_runs(processes: Path) -> None:
    beats: dict[int, list[tuple[float, int]]] = {}
    for at_s, message in heard(processes / "trace.log"):
        if isinstance(message, Heartbeat):
            beats.setdefault(message.sender, []).append((at_s, message.boot))
    joined, left = beats[12][0][0], beats[12][-1][0]
    assert joined >= beats[1][0][0] + 4 and left <= 25, "MR2 came late and went early"
    assert {boot for _, boot in beats[11]} == {1, 2}, "MR1 was killed and came back with its journal"
    last, back = (
        max(at_s for at_s, boot in beats[11] if boot == 1),
        min(at_s for at_s, boot in beats[11] if boot == 2),
    )
    assert back - last >= 3.5, "nothing is said between death and return"
    assert {boot for node in (1, 5) for _, boot in beats[node]} == {1}
    shown = (processes / "shown.txt").read_text()
    assert "MR1 was killed" in shown and "MR2 has left" in shown
    assert (processes / "life" / "journal-MR1").exists()


def test_p58_a_machine_that_dies_by_itself_ends_the_run_and_is_named(tmp_path: Path) -> None:
    (tmp_path / "fast.toml").write_text(SITE)
    with subprocess.Popen(
        [sys.executable, "-u", "-m", "bus_sim.cli", "run", "fast.toml", "--processes", *CAR],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "COLUMNS": "200"},
        stdout=subprocess.PIPE,
        text=True,
    ) as run:
        assert run.stdout is not None
        process = next(found for line in run.stdout if (found := re.search(r"ER1 is process (\d+)", line)))
        os.kill(int(process[1]), signal.SIGKILL)
        shown = run.stdout.read()
        assert run.wait(DEADLINE_S) == 1
    assert re.search(r"HALTED.*ER1: its process ended by itself, by SIGKILL", shown), shown


def test_p58_the_journals_of_another_run_are_not_taken_for_this_ones(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "fast.toml").write_text(SITE)
    (tmp_path / "life" / "journal-ER1").mkdir(parents=True)
    words = ["--processes", "--process-dir", str(tmp_path / "life"), "--trace", str(tmp_path / "trace.log")]
    assert bus_sim(["run", str(tmp_path / "fast.toml"), *words, *CAR]) == 2
    assert "name an empty directory" in capsys.readouterr().err
