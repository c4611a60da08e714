"""The two programs as a person meets them: help, mistakes, a real run, a controller in a process of its own."""

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from onboard.cli import main as onboard
from onboard.contract.codes import MachineState
from onboard.contract.messages import Award, Bid, Heartbeat, Message, Progress, TokenGrant
from onboard.core.frame import Frame
from onboard.io.open_bus import BusSettings, open_bus
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.thinned import is_long
from tests.tools import DEADLINE_S


def run_program(*words: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *words],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **environment},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )


def test_one_car_by_hand_is_parked_and_fetched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trace, figures = tmp_path / "trace.log", tmp_path / "figures.json"
    status = bus_sim(["run", "level1", "--one-car", "120", "--trace", str(trace), "--json", str(figures)])
    shown = capsys.readouterr().out
    assert status == 0
    assert "cars         in 1   out 1   inside 0" in shown
    assert str(trace) in shown.replace("\n", "")
    lines = trace.read_text().splitlines()
    assert all(re.fullmatch(r"\(\d{10}\.\d{6}\) fleet [0-9A-F]{8}#[0-9A-F]{16}", line) for line in lines)
    summary = json.loads(figures.read_text())
    assert (summary["cars_in"], summary["cars_out"], summary["violations"]) == (1, 1, [])
    assert summary["frames"] == len(lines)


def test_p52_cars_come_and_go_by_keys_while_the_site_runs(tmp_path: Path) -> None:
    """Two cars come, one is asked for while it comes in; letters that mean nothing change nothing."""
    words = ["run", "level1", "--by-hand", "--speed", "500", "--seed", "2"]
    run = subprocess.run(
        [sys.executable, "-m", "bus_sim.cli", *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "COLUMNS": "200"},
        input="i\nx i o",
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "keys: i a car comes in" in run.stdout
    assert "cars         in 2   out 1   inside 1" in run.stdout


def test_the_real_day_serves_everybody(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its busiest hour, in which cars only come; the whole day where all is tried."""
    words, cars = ([], "in 33   out 33   inside 0 ") if is_long() else (["--hour", "busiest"], "in 12 ")
    status = bus_sim(["run", "level1", *words, "--trace", str(tmp_path / "trace.log")])
    shown = capsys.readouterr().out
    assert status == 0, shown
    assert f"cars         {cars}" in shown and "refused: full 0, too large 0" in shown
    assert "opened again 0   refused 0" in shown
    assert "waiting out  nobody" in shown or is_long()
    assert "at least: bays alone " in shown and " times)   free flow " in shown
    assert "HALTED" not in shown and "VIOLATION" not in shown


def test_equal_seeds_give_equal_logs_in_processes_with_different_hash_seeds(tmp_path: Path) -> None:
    logs = []
    for hash_seed in ("1", "2"):
        log = tmp_path / f"{hash_seed}.log"
        done = run_program(
            "bus_sim.cli", "run", "level1", "--random", "200", "60", "--cars", "2", "--seed", "5", "--devices",
            "--fault", "omission:receivers=11,probability=0.05,seed=3", "--trace", str(log),
            cwd=tmp_path, PYTHONHASHSEED=hash_seed,
        )  # fmt: skip
        assert done.returncode in (0, 1), done.stderr
        logs.append(log.read_bytes())
    assert logs[0] == logs[1] and len(logs[0]) > 50_000


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "no-such-site"], r'site "no-such-site": no such file.*shipped: .*level1'),
        (["run", "--day", "24.7.2019"], r"--day 24.7.2019: not a day; write it as 2019-07-24"),
        (["run", "--sessions", "nowhere.csv"], r"nowhere\.csv"),
        (["run", "--stalls", "ZZ-9"], r"ZZ-9"),
        (["run", "--fault", "gremlins"], r"--fault gremlins: "),
        (["run", "level1", "--without", "MR7"], r"--without MR7: no such machine; machines here: IOC1, MR1"),
        (["run", "--speed", "0"], r"--speed 0.0: must be above 0"),
        (["run", "--bus", "vcan0"], r'--bus "vcan0": must be INTERFACE:CHANNEL'),
    ],
)
def test_a_persons_mistake_gets_one_clear_line_and_status_2(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert bus_sim(words) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(told, error), error
    assert list(tmp_path.iterdir()) == [], "nothing half done"


def test_sites_are_listed_and_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert bus_sim(["sites"]) == 0
    assert {"large", "level1", "small", "standard", "terminal"} <= set(capsys.readouterr().out.split())
    assert bus_sim(["sites", "terminal"]) == 0
    assert "vehicle: R1, R2, R3, R4" in capsys.readouterr().out
    assert bus_sim(["sites", "standard"]) == 0
    shown = capsys.readouterr().out
    assert "places: 191" in shown and "without ER1" in shown


@pytest.mark.parametrize("program", ["bus_sim.cli", "onboard"])
def test_help_teaches_and_the_version_is_told(program: str, tmp_path: Path) -> None:
    shown = run_program(program, "--help", cwd=tmp_path)
    assert shown.returncode == 0
    assert "exit status:" in shown.stdout and "examples:" in shown.stdout
    assert re.fullmatch(r"(bus-sim|onboard) \d+\.\d+\.\d+\n", run_program(program, "--version", cwd=tmp_path).stdout)


def test_a_machine_file_without_its_site_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mr1.toml"
    file.write_text('[machine]\nname = "MR1"\nsite = "gone.toml"\n[fleet_bus]\ninterface = "virtual"\nchannel = "x"\n')
    assert onboard(["--machine", str(file)]) == 2
    assert "gone.toml" in capsys.readouterr().err


async def _first_line(stream: asyncio.StreamReader, wanted: str) -> str:
    while True:
        line = (await stream.readline()).decode()
        if not line:
            raise AssertionError(f"ended before {wanted!r} was said")
        if wanted in line:
            return line


class Listener:
    """A node of the served fleet bus that waits for what the robot says."""

    def __init__(self) -> None:
        self.heard: list[Message] = []
        self._decoder = Decoder(fleet_codec())
        self._news = asyncio.Event()

    def on_frame(self, frame: Frame, time_us: int) -> None:
        message = self._decoder.feed(frame, time_us)
        if message is not None:
            self.heard.append(message)
            self._news.set()

    async def until(self, fits: Callable[[Message], bool]) -> Message:
        while True:
            for message in self.heard:
                if fits(message):
                    return message
            self._news.clear()
            await self._news.wait()


async def test_p58_the_robot_joins_from_a_process_of_its_own(tmp_path: Path) -> None:
    """The controller that ran inside the simulation runs unchanged in its own process, at the pace of the clock."""
    root = Path(__file__).parents[2]
    (tmp_path / "level1.toml").write_text((root / "bus_sim" / "sites" / "level1.toml").read_text())
    environment = {**os.environ, "PYTHONPATH": str(root), "COLUMNS": "200"}
    words = ["run", "level1.toml", "--serve", "127.0.0.1:0", "--without", "MR1", "--one-car", "20", "--seed", "4"]
    simulator = await asyncio.create_subprocess_exec(
        sys.executable, "-u", "-m", "bus_sim.cli", *words, cwd=tmp_path, env=environment,
        stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert simulator.stdout is not None
    async with asyncio.timeout(DEADLINE_S):
        serving = await _first_line(simulator.stdout, "serving at")
    port = re.search(r"127\.0\.0\.1:(\d+)", serving)
    assert port is not None
    interface = f'interface = "socketcand-asyncio"\nhost = "127.0.0.1"\nport = {port[1]}\n'
    (tmp_path / "mr1.toml").write_text(
        f'[machine]\nname = "MR1"\nsite = "level1.toml"\n[fleet_bus]\nchannel = "fleet"\n{interface}[device_bus]\n'
        f'channel = "MR1"\n{interface}'
    )
    robot = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "onboard", "--machine", "mr1.toml", cwd=tmp_path, env=environment,
        stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    listener = Listener()
    bus = await open_bus(
        BusSettings("socketcand-asyncio", "fleet", extra=(("host", "127.0.0.1"), ("port", int(port[1]))))
    )
    bus.subscribe(listener.on_frame)
    try:
        async with asyncio.timeout(DEADLINE_S):
            await listener.until(lambda m: isinstance(m, Heartbeat) and m.sender == 11 and m.state is MachineState.IDLE)
            bid = await listener.until(lambda m: isinstance(m, Bid) and m.sender == 11)
            award = await listener.until(lambda m: isinstance(m, Award) and m.winner == 11)
            granted = await listener.until(lambda m: isinstance(m, TokenGrant) and m.holder == 11)
            moving = await listener.until(lambda m: isinstance(m, Progress) and m.sender == 11 and m.speed_mm_s > 0)
    finally:
        await bus.close()
        for process in (robot, simulator):
            process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(DEADLINE_S):
            _, errors = await robot.communicate()
            await simulator.communicate()
    order = [listener.heard.index(message) for message in (bid, award, granted, moving)]
    assert order == sorted(order), "no motion before the award and a token"
    assert robot.returncode == 0, errors.decode()
    assert b"program:" in errors
    assert (tmp_path / "journal-MR1").exists()
