"""A supervisor's SIGTERM, a closed terminal: the log is whole, and no process is left behind."""

import argparse
import os
import re
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

import pytest

from onboard.cli import main as onboard
from onboard.trace import cli as trace
from onboard.trace.candump_reader import CandumpReader
from tests.dispositions import SENT
from tests.tools import DEADLINE_S, require_tool, run_tool

ROOT = Path(__file__).parents[2]


@contextmanager
def bus_sim(*words: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """The program, as a supervisor starts it; killed where the test hangs or fails."""
    running = subprocess.Popen(
        [sys.executable, "-m", "bus_sim.cli", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "COLUMNS": "200"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    alarm = Timer(DEADLINE_S, running.kill)
    alarm.start()
    try:
        yield running
    finally:
        alarm.cancel()
        running.kill()
        running.wait()
        assert running.stdout is not None
        running.stdout.close()


def said_until(running: subprocess.Popen[str], pattern: str, times: int = 1) -> list[str]:
    """What it says up to so many lines that fit."""
    assert running.stdout is not None
    said: list[str] = []
    for line in running.stdout:
        said.append(line)
        times -= bool(re.search(pattern, line))
        if not times:
            return said
    raise AssertionError("it ended: " + "".join(said))


def hear_a_frame(port: int) -> None:
    """Until something was said on the served fleet bus (the protocol of socketcand)."""
    with socket.create_connection(("127.0.0.1", port), DEADLINE_S) as client:
        said = ""
        for word, then in ("< hi >", b"< open fleet >"), ("< ok >", b"< rawmode >"), ("< frame", b""):
            while word not in said:
                news = client.recv(4096).decode()
                assert news, "the server is gone"
                said += news
            said = ""
            client.sendall(then)


def descendants(pid: int) -> set[int]:
    """All processes that it has started, and those that they have."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text(errors="replace").rpartition(")")[2].split()
        except OSError:
            # It has ended meanwhile.
            continue
        parents[int(status.parent.name)] = int(fields[1])
    found, new = set[int](), {pid}
    while new:
        new = {child for child, parent in parents.items() if parent in new} - found
        found |= new
    return found


def lives(pid: int) -> bool:
    """A process that nobody has waited for yet does not live."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def frames(log: Path) -> int:
    with log.open("rb") as lines:
        return sum(1 for _ in CandumpReader(lines))


def test_whoever_ignores_signals_the_programs_of_the_tests_do_not() -> None:
    """As under nohup, and in the background of a shell."""
    names = ", ".join(f"signal.{number.name}" for number in SENT)
    look = f"import signal; print([signal.getsignal(n) is signal.SIG_IGN for n in ({names})])"
    shell = (
        f"import signal, subprocess, sys; [signal.signal(n, signal.SIG_IGN) for n in ({names})]; "
        "from tests.dispositions import give_children_the_default; give_children_the_default(); "
        f"subprocess.run([sys.executable, '-c', {look!r}], check=True)"
    )
    assert run_tool(sys.executable, "-c", shell) == "[False, False, False]\n"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_run_with_processes_and_a_broker_leaves_its_log_and_nobody(number: signal.Signals, tmp_path: Path) -> None:
    require_tool("mosquitto")
    words = ("run", "level1", "--one-car", "30", "--processes", "--mqtt", "--trace", "run.log")
    with bus_sim(*words, folder=tmp_path) as running:
        hear_a_frame(int(re.findall(r"serving at 127.0.0.1:(\d+)", "".join(said_until(running, "serving at")))[0]))
        children = descendants(running.pid)
        assert len(children) >= 4, "two machines, the gateway and its broker"
        running.send_signal(number)
        said, _ = running.communicate()
    assert f"{number.name}: ending" in said
    assert [child for child in children if lives(child)] == []
    assert frames(tmp_path / "run.log") > 0
    assert "was killed" not in said


@pytest.mark.parametrize("site", ["level1", "cell"])
def test_a_run_of_any_system_leaves_a_whole_log(site: str, tmp_path: Path) -> None:
    """At the pace of the clock: without the signal it would go on for hours."""
    fifo = tmp_path / "run.log"
    os.mkfifo(fifo)
    with bus_sim("run", site, "--speed", "1", "--trace", "run.log", "--no-web", folder=tmp_path) as running:
        # Opening waits until the run has opened its log.
        with fifo.open("rb") as log:
            running.terminate()
            lines = log.read().splitlines()
        running.communicate()
    assert running.returncode >= 0, "it came to its own end"
    assert all(re.fullmatch(rb"\(\d+\.\d{6}\) \S+ \S+", line) for line in lines)


def test_a_campaign_leaves_no_worker(tmp_path: Path) -> None:
    with bus_sim("campaign", "small", "--seeds", "1-400", "--jobs", "2", folder=tmp_path) as running:
        children = set[int]()
        # Two workers, and what counts their shared memory, which ends once it hears that all others have.
        while len(children) < 3:
            assert running.poll() is None
            children = descendants(running.pid)
        ends = [os.pidfd_open(child) for child in children]
        running.terminate()
        running.communicate()
    assert running.returncode == 130
    for end in ends:
        assert select.select([end], [], [], DEADLINE_S)[0], "a worker lives on"
        os.close(end)


def test_ctrl_c_in_the_warm_up_tells_what_the_warm_up_came_to(tmp_path: Path) -> None:
    with bus_sim("run", "--no-web", "--trace", "t.log", folder=tmp_path) as running:
        said_until(running, "^15:00:00 |^14:4.:.. ")
        running.send_signal(signal.SIGINT)
        assert running.stdout is not None
        figures = running.stdout.read()
        assert running.wait() == 0
    told = re.search(r"(\d+) min (\d+) s \(warm-up, 2019-07-24 14:4\d to (\d+:\d+)\) shown", figures)
    assert told or "ended in its first second; no figures" in figures, figures
    assert "now 2019-07-24" not in figures, "the hour itself did not begin"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_look_at_a_log_ends_by_its_own_way_out(number: signal.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []
    if signal.getsignal(number) is signal.SIG_IGN:
        # Under nohup.
        signal.signal(number, signal.SIG_DFL)

    def slow_command(_: object) -> int:
        try:
            os.kill(os.getpid(), number)
            signal.pause()
        finally:
            closed.append("file")
        return 0

    parser = trace.build_parser()
    parser.set_defaults(run=slow_command)
    monkeypatch.setattr(trace, "build_parser", lambda: parser)
    monkeypatch.setattr(parser, "parse_known_args", lambda _: (argparse.Namespace(run=slow_command), []))
    assert onboard(["trace", "dump"]) == 130
    assert closed == ["file"]
    assert signal.getsignal(number) is signal.SIG_DFL
