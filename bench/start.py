"""How soon a machine is on the bus: start of ``onboard`` to its first heartbeat, and the memory taken until then.

    python bench/start.py [--runs N] [--python FILE]

Each run is a new process with an empty journal; the bus is served over loopback in the socketcand protocol by this one.
Wall time counts from just before the process is made to the arrival of the heartbeat; memory is the process's highest
resident set by then (``VmHWM`` of proc(5), so Linux only), and its proportional set. One run that is not counted fills
the caches. For comparison the table begins with an interpreter that does nothing but say that it runs, alone and with
each library imported.
"""

import argparse
import asyncio
import os
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from bus_sim.serve.socketcand import SocketcandServer
from deploy.archive import build_archive
from onboard.core.frame import Frame
from onboard.ports.bus import BusHealth, FrameHandler
from onboard.wire.codec import fleet_codec

ROOT = Path(__file__).parents[1]
AIM_S, AIM_MB, AIM_PSS_MB = 0.5, 40.0, 20.0
DEADLINE_S = 60.0
MACHINE = """\
[machine]
name = "MR1"
site = "{site}"
[fleet_bus]
interface = "{interface}"
channel = "fleet"
host = "127.0.0.1"
port = {port}
[device_bus]
interface = "{interface}"
channel = "MR1"
host = "127.0.0.1"
port = {port}
"""


class Start(NamedTuple):
    """One start: wall seconds, and MB (2**20 bytes): highest resident set, and proportional set (PSS) at its end."""

    wall_s: float
    peak_mb: float
    pss_mb: float


class Ear:
    """The served bus: nobody else is on it, and the first heartbeat said on it ends the wait."""

    name = "ear"

    def __init__(self) -> None:
        self.heard: asyncio.Future[float] = asyncio.get_running_loop().create_future()

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """Nothing is ever said to the client."""

    def send(self, frame: Frame) -> bool:
        """Take a frame of the controller under test; its first heartbeat ends the wait."""
        if fleet_codec().name_of(frame) == "Heartbeat" and not self.heard.done():
            self.heard.set_result(time.perf_counter())
        return True

    def health(self) -> BusHealth:
        """All counters 0: nothing is ever lost on this bus."""
        return BusHealth()

    async def close(self) -> None:
        """Nothing is held open for a client that leaves."""


async def start_onboard(interface: str, *program: str, python: str = sys.executable) -> Start:
    """Start one controller, as ``program`` where one is named, and wait for its first heartbeat."""
    ear = Ear()
    server = SocketcandServer(lambda _channel, _name: ear, lambda time_us: time_us, port=0)
    port = await server.start()
    with tempfile.TemporaryDirectory() as folder:
        site = ROOT / "bus_sim" / "sites" / "level1.toml"
        machine = Path(folder) / "mr1.toml"
        machine.write_text(MACHINE.format(site=site, interface=interface, port=port), encoding="utf-8")
        begun_s = time.perf_counter()
        process = await _started(python, *(program or ("-m", "onboard")), "--machine", str(machine))
        try:
            async with asyncio.timeout(DEADLINE_S):
                heard_s = await ear.heard
            peak_mb, pss_mb = _memory_mb(process.pid)
        finally:
            if process.returncode is None:
                process.terminate()
            await process.communicate()
            await server.close()
    return Start(heard_s - begun_s, peak_mb, pss_mb)


async def start_script(script: str, python: str = sys.executable) -> Start:
    """Start an interpreter that runs ``script`` and then waits for its input to end."""
    begun_s = time.perf_counter()
    process = await _started(python, "-c", f"{script}\nimport sys\nprint('here', flush=True)\nsys.stdin.read()")
    assert process.stdout is not None
    await process.stdout.readline()
    heard_s = time.perf_counter()
    peak_mb, pss_mb = _memory_mb(process.pid)
    await process.communicate(b"\n")
    return Start(heard_s - begun_s, peak_mb, pss_mb)


async def _started(python: str, *words: str) -> asyncio.subprocess.Process:
    pipe = asyncio.subprocess.PIPE
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return await asyncio.create_subprocess_exec(
        python, *words, env=environment, stdin=pipe, stdout=pipe, stderr=asyncio.subprocess.DEVNULL
    )


def _memory_mb(pid: int) -> tuple[float, float]:
    """Highest resident set, and what the process takes now with its share of what others use too."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii", errors="replace")
    peak = re.search(r"^VmHWM:\s+(\d+) kB$", status, re.MULTILINE)
    pss = re.search(r"^Pss:\s+(\d+) kB$", rollup, re.MULTILINE)
    if peak is None or pss is None:
        raise RuntimeError(f"process {pid} has ended before it was measured")
    return int(peak[1]) / 1024, int(pss[1]) / 1024


async def measure(runs: int, python: str) -> None:
    """Start each process ``runs`` times; print median and worst of wall s and peak MB."""
    print(f"median of {runs} runs, worst in brackets; aims {AIM_S} s, {AIM_MB:.0f} MB and {AIM_PSS_MB:.0f} MB PSS")
    print("| process | wall s | peak MB | PSS MB |")
    print("|---|---|---|---|")
    scripts = {"an interpreter that does nothing": "", "with asyncio imported": "import asyncio"}
    libraries = {"with python-can imported": "import can", "with cantools imported": "import cantools"}
    is_own = python == sys.executable
    for name, script in (scripts | libraries if is_own else scripts).items():
        print(_row(name, [await start_script(script, python) for _ in range(runs + 1)]), flush=True)
    for interface in ("socketcand-asyncio", "socketcand") if is_own else ():
        print(_row(f"onboard on {interface}", [await start_onboard(interface) for _ in range(runs + 1)]), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        archive = str(build_archive(Path(folder) / "onboard.pyz"))
        starts = [await start_onboard("socketcand-asyncio", "-I", archive, python=python) for _ in range(runs + 1)]
        print(_row("onboard.pyz, as boards have it, on socketcand-asyncio", starts), flush=True)


def _row(name: str, starts: list[Start]) -> str:
    wall_s, peak_mb, pss_mb = zip(*starts[1:], strict=True)
    return (
        f"| {name} | {statistics.median(wall_s):.3f} ({max(wall_s):.3f}) "
        f"| {statistics.median(peak_mb):.1f} ({max(peak_mb):.1f}) "
        f"| {statistics.median(pss_mb):.1f} ({max(pss_mb):.1f}) |"
    )


def main() -> None:
    """Read the options and measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=7, help="starts for each row (default %(default)s)")
    parser.add_argument("--python", default=sys.executable, metavar="FILE", help="interpreter (default: this one)")
    args = parser.parse_args()
    asyncio.run(measure(args.runs, args.python))


if __name__ == "__main__":
    main()
