"""``python -m hil commission`` as a person calls it: on a served bus, with the answers from a pipe."""

import asyncio
import os
import signal
import sys
from asyncio.subprocess import PIPE, STDOUT
from collections.abc import Coroutine
from pathlib import Path

import pytest

from bus_sim.options import RunOptions
from bus_sim.processes.plan import machine_file
from bus_sim.serve.socketcand import SocketcandServer
from bus_sim.systems.car_park.simulation import build
from bus_sim.virtual_time import VirtualTimeLoop
from hil.cli import main
from hil.play import stop_fleet
from onboard.config.site import parse_site
from tests.hil.bench_files import BENCHES
from tests.tools import DEADLINE_S

Capture = pytest.CaptureFixture[str]
ROOT = Path(__file__).parents[2]
#: Name, termination, the fleet is on, drive and shuttle tell the truth, three times somebody in the way, controller on.
ANSWERS = "A. Person\n60,1\ny\ny\ny\nn\nn\nn\n\n"


async def play(
    directory: Path, answers: str = ANSWERS, *, end_by: signal.Signals | None = None, end_at: str = ""
) -> tuple[int | None, str]:
    """Exit status and output of a walk; the controller is switched on when the walk asks for it.

    With ``end_by`` the answers do not end, and the walk is ended once it has said ``end_at``.
    """
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    text = (BENCHES / "bench.toml").read_text()
    simulation = build(parse_site(text, "site.toml"), RunOptions(without=frozenset({"MR1", "MR2"})), loop)
    for medium in (*simulation.devices.values(), simulation.fleet):
        medium.attach("another node")
    simulation.start()
    server = SocketcandServer(simulation.join, lambda time_us: time_us, port=0)
    port = await server.start()
    (directory / "site.toml").write_text(text)
    (directory / "MR1.toml").write_text(machine_file("MR1", {"host": "127.0.0.1", "port": port}))
    walk = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "hil", "commission", "--machine", "MR1.toml"),
        cwd=directory,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=PIPE,
        stdout=PIPE,
        stderr=STDOUT,
    )
    assert walk.stdin is not None and walk.stdout is not None
    walk.stdin.write(answers.encode())
    shown, told, ended = "", False, False
    async with asyncio.timeout(DEADLINE_S):
        while piece := await walk.stdout.read(4096):
            shown += piece.decode()
            if "passed: digests" in shown and not told:
                # Devices repeat themselves every ten seconds; the test does not wait so long.
                told = True
                simulation.plant.carriers[11].start()
                simulation.plant.shuttles[11].start()
            if "Switch the controller of MR1 on" in shown and 11 not in simulation.controllers:
                simulation.start_controller(simulation.site.machines[11])
            if end_by is not None and end_at in shown and not ended:
                ended = True
                walk.send_signal(end_by)
        status = await walk.wait()
    await server.close()
    await stop_fleet(simulation)
    return status, shown


def on_a_live_bus(walk: Coroutine[None, None, tuple[int | None, str]]) -> tuple[int | None, str]:
    loop = VirtualTimeLoop(pace=1.0)
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(walk)
    finally:
        asyncio.set_event_loop(None)
        loop.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
@pytest.mark.parametrize(
    ("answers", "end_at"),
    [("A. Person\n60,1\n", "passed: termination"), ("A. Person\n60,1\ny\ny\n", "passed: drive's position")],
    ids=["before the fleet is on", "at the devices"],
)
def test_who_ends_the_walk_keeps_what_was_measured(
    answers: str, end_at: str, number: signal.Signals, tmp_path: Path
) -> None:
    """The input goes on: a person thinks, and nobody answers any more."""
    status, shown = on_a_live_bus(play(tmp_path, answers, end_by=number, end_at=end_at))
    assert status == 1, shown
    protocol = (tmp_path / "MR1-protocol.txt").read_text()
    assert protocol in shown
    assert "person      A. Person" in protocol and "60.1 ohms, wanted 54 to 66" in protocol
    assert f"not done  all further steps: ended from outside ({number.name})" in protocol
    assert "The machine is NOT in order: 0 failed, 1 not done." in protocol


def test_the_walk_on_a_live_bus_prints_and_keeps_its_protocol(tmp_path: Path) -> None:
    status, shown = on_a_live_bus(play(tmp_path))
    assert status == 1, shown
    protocol = (tmp_path / "MR1-protocol.txt").read_text()
    assert protocol in shown
    assert "person      A. Person" in protocol
    assert "60.1 ohms, wanted 54 to 66" in protocol
    assert "passed    node-ID: 11 is free" in protocol
    assert "not done  drive: somebody was in the way" in protocol
    assert "passed    joins: boot 1, idle" in protocol
    assert "NOT in order: 0 failed, 3 not done" in protocol


def test_mistakes_are_one_line_and_status_2(tmp_path: Path, capsys: Capture) -> None:
    assert main(["commission", "--machine", str(tmp_path / "none.toml")]) == 2
    assert "does not exist; name an existing machine file" in capsys.readouterr().err
    (tmp_path / "site.toml").write_text((BENCHES / "bench.toml").read_text())
    (tmp_path / "MR1.toml").write_text(machine_file("MR1", {"host": "127.0.0.1", "port": 1}))
    assert main(["commission", "--machine", str(tmp_path / "MR1.toml")]) == 2
    assert "is the server running" in capsys.readouterr().err
    assert main([]) == 2
    assert "a command is missing; write commission" in capsys.readouterr().err
