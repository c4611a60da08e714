"""A controller as a process whose bus is late, or gone and back: it lives on, and tells of it."""

import asyncio
import os
import re
import signal
import sys
from asyncio.subprocess import PIPE, Process
from pathlib import Path

from onboard.contract.messages import Heartbeat
from onboard.io.open_bus import BusSettings, open_bus
from tests.io.test_socketcand import free_port
from tests.system.test_cli import Listener
from tests.tools import DEADLINE_S

ROOT = Path(__file__).parents[2]
#: Only where something hangs.


async def start(folder: Path, *words: str) -> Process:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", *words, cwd=folder, env=environment, stdout=PIPE, stderr=asyncio.subprocess.STDOUT
    )


async def said(process: Process, pattern: str) -> str:
    """Its next line that fits."""
    assert process.stdout is not None
    lines = ""
    while line := (await process.stdout.readline()).decode():
        lines += line
        if re.search(pattern, line):
            return line
    raise AssertionError(f"it ended: {lines}")


def machine_file(folder: Path, port: int) -> None:
    where = f'interface = "socketcand-asyncio"\nhost = "127.0.0.1"\nport = {port}\n'
    (folder / "level1.toml").write_text((ROOT / "bus_sim" / "sites" / "level1.toml").read_text())
    (folder / "mr1.toml").write_text(
        f'[machine]\nname = "MR1"\nsite = "level1.toml"\n[fleet_bus]\nchannel = "fleet"\n{where}[device_bus]\n'
        f'channel = "MR1"\n{where}'
    )


async def site(folder: Path, port: int) -> Process:
    words = ("run", "level1.toml", "--serve", f"127.0.0.1:{port}", "--without", "MR1", "--one-car", "20")
    process = await start(folder, "bus_sim.cli", *words)
    await said(process, "serving at")
    return process


async def heard_from_mr1(port: int) -> None:
    listener = Listener()
    bus = await open_bus(BusSettings("socketcand-asyncio", "fleet", extra=(("host", "127.0.0.1"), ("port", port))))
    bus.subscribe(listener.on_frame)
    await listener.until(lambda message: isinstance(message, Heartbeat) and message.sender == 11)
    await bus.close()


async def ended(process: Process) -> int:
    if process.returncode is None:
        process.send_signal(signal.SIGTERM)
    await process.communicate()
    assert process.returncode is not None
    return process.returncode


async def test_a_late_bus_is_waited_for_and_one_that_was_gone_is_joined_again(tmp_path: Path) -> None:
    port = free_port()
    machine_file(tmp_path, port)
    async with asyncio.timeout(DEADLINE_S):
        robot = await start(tmp_path, "onboard", "--machine", "mr1.toml")
        assert "is the server running" in await said(robot, "MR1: waits for its bus")
        assert not (tmp_path / "journal-MR1.life").exists(), "no life has begun"
        for _ in range(2):
            fleet = await site(tmp_path, port)
            await heard_from_mr1(port)
            await ended(fleet)
        assert await ended(robot) == 0


async def test_a_signal_ends_the_waiting(tmp_path: Path) -> None:
    machine_file(tmp_path, free_port())
    async with asyncio.timeout(DEADLINE_S):
        robot = await start(tmp_path, "onboard", "--machine", "mr1.toml")
        await said(robot, "MR1: waits for its bus")
        assert await ended(robot) == 0


async def test_how_the_last_life_ended_is_told(tmp_path: Path) -> None:
    port = free_port()
    machine_file(tmp_path, port)
    async with asyncio.timeout(DEADLINE_S):
        fleet = await site(tmp_path, port)
        robot = await start(tmp_path, "onboard", "--machine", "mr1.toml")
        for result in ("watchdog", ""):
            await heard_from_mr1(port)
            robot.kill()
            await robot.communicate()
            seen = tmp_path / "journal-MR1.ended"
            seen.write_text(f"{result}\n") if result else seen.unlink(missing_ok=True)
            robot = await start(tmp_path, "onboard", "--machine", "mr1.toml")
            told = await said(robot, "MR1: the last life")
            assert ("watchdog" in told) == bool(result)
        assert await ended(robot) == 0
        await ended(fleet)
