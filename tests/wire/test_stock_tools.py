"""Our bus through the eyes of tools that nobody here wrote: cantools, Wireshark, can-utils, python-can."""

import asyncio
import fcntl
import os
import pty
import re
import signal
import struct
import sys
import termios
from pathlib import Path

import can
import pytest

from bus_sim.cli import main as bus_sim
from bus_sim.sites import find_site
from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.codec import fleet_codec
from onboard.wire.site_dbc import site_dbc
from tests.tools import DEADLINE_S, require_tool, run_tool
from tests.wire.samples import signal_values

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of one car parked and fetched, and the site's DBC."""
    where = tmp_path_factory.mktemp("stock")
    assert bus_sim(["run", "level1", "--one-car", "60", "--trace", str(where / "trace.log")]) == 0
    (where / "level1.dbc").write_text(site_dbc(find_site("level1")))
    return where


@pytest.fixture(scope="module")
def frames(folder: Path) -> list[tuple[int, Frame]]:
    with (folder / "trace.log").open("rb") as lines:
        reader = CandumpReader(lines)
        found = [(record.time_us, record.frame) for record in reader]
    assert not reader.faults and len(found) > 300
    return found


def test_cantools_decodes_every_line_from_a_pipe_to_our_values(folder: Path, frames: list[tuple[int, Frame]]) -> None:
    cantools = str(Path(sys.executable).with_name("cantools"))
    log = (folder / "trace.log").read_bytes()
    lines = run_tool(cantools, "decode", "--single-line", "--no-decode-choices", str(folder / "level1.dbc"), stdin=log)
    decoded = lines.splitlines()
    assert len(decoded) == len(frames)
    codec, nodes = fleet_codec(), {1: "IOC1", 11: "MR1"}
    for line, (_, frame) in zip(decoded, frames, strict=True):
        name, values = re.search(r":: (\w+)\((.*)\)", line).groups()  # type: ignore[union-attr]  # fails the test
        assert name == f"{nodes[frame.arbitration_id & 0xFF]}_{codec.name_of(frame)}"
        told = {key: int(value.split()[0]) for key, value in (pair.split(": ") for pair in values.split(", "))}
        part = codec.decode_part(frame)
        assert isinstance(part, Message), (part, line)
        assert told == signal_values(part)


def test_wireshark_reads_every_frame(folder: Path, frames: list[tuple[int, Frame]]) -> None:
    tshark = require_tool("tshark")
    fields = ("-e", "frame.time_epoch", "-e", "can.id", "-e", "can.flags.xtd", "-e", "data.data")
    shown = run_tool(tshark, "-r", str(folder / "trace.log"), "-T", "fields", *fields)
    rows = [line.split("\t") for line in shown.splitlines()]
    assert len(rows) == len(frames)
    for (time, identifier, extended, data), (time_us, frame) in zip(rows, frames, strict=True):
        assert round(float(time) * 1e6) == pytest.approx(time_us, abs=1)
        assert (int(identifier), extended, data) == (frame.arbitration_id, "1", frame.data.hex())


def test_can_utils_and_python_can_read_every_frame(folder: Path, frames: list[tuple[int, Frame]]) -> None:
    log2asc = require_tool("log2asc")
    (folder / "trace.asc").write_text(run_tool(log2asc, "-I", str(folder / "trace.log"), "fleet"))
    with can.LogReader(folder / "trace.asc", relative_timestamp=True) as reader:
        found = [(message.arbitration_id, message.is_extended_id, bytes(message.data)) for message in reader]
    assert found == [(frame.arbitration_id, True, frame.data) for _, frame in frames]


def test_can_utils_gives_our_log_back(folder: Path, frames: list[tuple[int, Frame]]) -> None:
    """To Vector's format and back: identifiers, data and times to the 100 us that the format keeps."""
    log2asc, asc2log = require_tool("log2asc"), require_tool("asc2log")
    asc = run_tool(log2asc, "-I", str(folder / "trace.log"), "fleet")
    again = CandumpReader(run_tool(asc2log, stdin=asc.encode()).encode().splitlines(keepends=True))
    found = list(again)
    assert not again.faults
    assert [record.frame for record in found] == [frame for _, frame in frames]
    shift_us = found[0].time_us - frames[0][0]
    assert (
        max(abs(record.time_us - time_us - shift_us) for record, (time_us, _) in zip(found, frames, strict=True)) <= 100
    )


async def test_canplayer_takes_the_log_and_stops_only_for_want_of_socketcan(folder: Path) -> None:
    """Where the kernel has SocketCAN it would play; here it must get as far as opening the socket."""
    canplayer = require_tool("canplayer")
    process = await asyncio.create_subprocess_exec(
        canplayer, "-I", str(folder / "trace.log"), "fleet=fleet",
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    async with asyncio.timeout(DEADLINE_S):
        said, _ = await process.communicate()
    assert re.search(rb"Address family not supported|No such device|Operation not permitted", said), said


def _readable(drawn: bytes) -> str:
    return re.sub(rb"\x1b[^A-Za-z]*[A-Za-z]", b" ", drawn).decode(errors="replace")


async def _until_shown(terminal: int, *wanted: str) -> str:
    """What a program draws on its terminal, up to the first time that all that is ``wanted`` can be read in it."""
    loop = asyncio.get_running_loop()
    drawn, news = bytearray(), asyncio.Event()

    def readable() -> None:
        try:
            drawn.extend(os.read(terminal, 65536))
        except OSError:
            loop.remove_reader(terminal)
        news.set()

    loop.add_reader(terminal, readable)
    try:
        while not all(one in (text := _readable(bytes(drawn))) for one in wanted):
            news.clear()
            await news.wait()
        return text
    finally:
        loop.remove_reader(terminal)


async def test_cantools_monitor_shows_the_served_bus(folder: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "160", "LINES": "50", "TERM": "xterm"}
    simulator = await asyncio.create_subprocess_exec(
        sys.executable, "-u", "-m", "bus_sim.cli", "run", "level1", "--serve", "127.0.0.1:0", "--one-car", "600",
        cwd=folder, env=environment, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert simulator.stdout is not None
    served = None
    async with asyncio.timeout(DEADLINE_S):
        while served is None:
            served = re.search(rb"127\.0\.0\.1:(\d+)", await simulator.stdout.readline())
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 160, 0, 0))
    monitor = await asyncio.create_subprocess_exec(
        str(Path(sys.executable).with_name("cantools")), "monitor", str(folder / "level1.dbc"), "-i", "socketcand",
        "-c", "fleet", "--bus-kwargs", "host=127.0.0.1", f"port={served[1].decode()}",
        cwd=folder, env=environment, stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    try:
        async with asyncio.timeout(DEADLINE_S):
            screen = await _until_shown(ours, "MR1_Heartbeat(", "IOC1_Heartbeat(")
        assert "site_digest" in screen
    finally:
        for process in (monitor, simulator):
            process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(DEADLINE_S):
            await asyncio.gather(monitor.wait(), simulator.communicate())
        os.close(ours)
