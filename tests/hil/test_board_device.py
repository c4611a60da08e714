"""A board behind real interfaces and commands: here ``onboard`` behind another server, started by a shell."""

import asyncio
import json
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from bus_sim.can.medium import Medium
from bus_sim.serve.socketcand import SocketcandServer
from bus_sim.virtual_time import LoopClock
from hil.bench import load_bench
from hil.board_device import read_counters
from hil.device import BenchError
from hil.play import ScenarioOutcome, play
from hil.scenarios.registry import SCENARIOS
from onboard.ports.bus import BusHealth, ErrorState
from tests.hil.bench_files import write_bench
from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]
LINK = {
    "ifname": "can0",
    "linkinfo": {
        "info_kind": "can",
        "info_data": {"state": "ERROR-PASSIVE", "berr_counter": {"tx": 128, "rx": 3}, "bittiming": {}},
    },
    "stats64": {"rx": {"packets": 70, "dropped": 1, "over_errors": 2}, "tx": {"packets": 50, "dropped": 4}},
}


@pytest.fixture
def port() -> Iterator[int]:
    """A server with two buses, ``fleet`` and ``device``, in a thread of its own: the wires between bench and board."""
    bound: list[int] = []
    ready = threading.Event()
    loop = asyncio.new_event_loop()
    end = asyncio.Event()

    async def live() -> None:
        buses = {name: Medium(LoopClock(loop), name=name) for name in ("fleet", "device")}
        for medium in buses.values():
            medium.attach("acknowledges")
        server = SocketcandServer(
            lambda channel, client: buses[channel].attach(client) if channel in buses else None, int, port=0
        )
        bound.append(await server.start())
        ready.set()
        await end.wait()
        await server.close()

    thread = threading.Thread(target=lambda: loop.run_until_complete(live()))
    thread.start()
    assert ready.wait(DEADLINE_S)
    yield bound[0]
    loop.call_soon_threadsafe(end.set)
    thread.join(DEADLINE_S)
    loop.close()


def board(directory: Path, port: int, link: object) -> Path:
    """A bench file whose board is a process that a shell starts and kills."""
    home = directory / "board"
    home.mkdir()
    where = f'interface = "socketcand-asyncio"\nhost = "127.0.0.1"\nport = {port}\n'
    start = (
        f"cd {home} && {{ PYTHONPATH={ROOT} {sys.executable} -m onboard --machine machine.toml "
        ">>console.log 2>&1 </dev/null & echo $! >pid; }"
    )
    stop = "test ! -f pid || kill -9 $(cat pid); rm -f pid"
    words = json.dumps
    return write_bench(
        directory,
        f"""[[targets]]
machine = "MR1"
kind = "board"
capabilities = ["fleet_bus", "device_bus", "power", "files", "console", "counters"]
[targets.fleet_bus]
channel = "fleet"
{where}[targets.device_bus]
channel = "device"
{where}[targets.power]
on = ["sh", "-c", {words(start)}]
off = ["sh", "-c", {words(f"cd {home}; {stop}")}]
[targets.files]
install = ["cp", "{{directory}}/machine.toml", "{{directory}}/site.toml", {words(str(home))}]
[targets.files.fleet_bus]
channel = "fleet"
{where}[targets.files.device_bus]
channel = "device"
{where}[targets.console]
read = ["cat", {words(str(home / "console.log"))}]
[targets.counters]
read = ["echo", {words(json.dumps([link]))}]
""",
    )


def play_on(file: Path, name: str, directory: Path) -> ScenarioOutcome:
    bench = load_bench(file)
    return play(bench, bench.targets[0], next(one for one in SCENARIOS if one.name == name), directory)


def test_a_board_behind_interfaces_and_commands_works_in_the_simulated_fleet(tmp_path: Path, port: int) -> None:
    quiet = {**LINK, "linkinfo": {"info_data": {"state": "ERROR-ACTIVE"}}, "stats64": {}}
    outcome = play_on(board(tmp_path, port, quiet), "moves under authority", tmp_path)
    assert outcome.is_good, "\n".join(outcome.lines())
    assert not (tmp_path / "board" / "pid").exists(), "its power is cut when the test is over"
    assert (tmp_path / "board" / "site.toml").read_text() == (tmp_path / "bench.toml").read_text()
    machine = (tmp_path / "board" / "machine.toml").read_text()
    assert 'channel = "device"' in machine
    # A journal of its own for each test, as another test was another world.
    journals = [entry for entry in (tmp_path / "board").glob("journal-*") if (entry / "journal.log").exists()]
    assert [f'journal = "{entry.name}"' in machine for entry in journals] == [True]


def test_error_counters_of_the_board_are_judged(tmp_path: Path, port: int) -> None:
    outcome = play_on(board(tmp_path, port, LINK), "joins", tmp_path)
    assert outcome.failure is None
    assert outcome.judgement.faults == (
        "counters: it is error-passive at the end",
        "counters: TEC 128, REC 3 on a bus without errors",
        "counters: 3 frames lost for want of room",
        "counters: 4 frames refused for want of room",
    )


def test_the_counters_are_what_ip_prints() -> None:
    assert read_counters(json.dumps([LINK])) == BusHealth(ErrorState.ERROR_PASSIVE, 128, 3, 50, 70, 4, 3)
    for text in ("", "[]", "[{}]", '{"linkinfo": 1}'):
        with pytest.raises(BenchError, match="mend the command"):
            read_counters(text)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ('["no-such-program-here"]', "no-such-program-here: No such file or directory; install it, or mend the bench"),
        ('["sh", "-c", "echo no power here >&2; exit 3"]', "status 3: no power here"),
    ],
)
def test_a_command_that_fails_is_one_line(command: str, said: str, tmp_path: Path, port: int) -> None:
    file = board(tmp_path, port, LINK)
    lines = file.read_text().splitlines()
    changed = [f"on = {command}" if line.startswith("on = ") else line for line in lines]
    file.write_text("\n".join(changed))
    with pytest.raises(BenchError) as caught:
        play_on(file, "joins", tmp_path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
