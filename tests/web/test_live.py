"""A bus that is not simulated: the page listens and commands nothing. Beyond loopback it needs a token."""

import asyncio
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from bus_sim.cli import main as bus_sim
from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.contract.messages import Award, CallForProposals, Message, Reference
from onboard.history.history import CALL_LIMIT, TASK_LIMIT
from onboard.trace.view import SiteView
from onboard.web.app import CommandError
from onboard.web.live import LiveSource
from onboard.web.serve import WebServer
from tests.tools import DEADLINE_S
from tests.web.browser import end, live_of, served
from tests.web.logs import SITE_FILES, contract, environment, frames_of


def until(socket: ClientConnection, key: str) -> Any:
    """What comes next of one kind."""
    while key not in (told := json.loads(socket.recv(timeout=DEADLINE_S))):
        pass
    return told


def test_a_served_bus_is_listened_to_and_takes_no_orders(tmp_path: Path) -> None:
    words = ["run", "small", "--by-hand", "--serve", "127.0.0.1:0", "--trace", str(tmp_path / "bus.log")]
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "bus_sim.cli", *words],
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        port = next(found[1] for line in process.stdout if (found := re.search(r"serving at [\d.]+:(\d+)", line)))
        bus = ["-i", "socketcand", "-c", "fleet", "--bus-kwargs", "host=127.0.0.1", f"port={port}"]
        site = ["--site", str(SITE_FILES / "small.toml"), "--web", "0"]
        with (
            served(["onboard", "web", *site, *bus], tmp_path) as address,
            connect(live_of(address)) as socket,
        ):
            layout = until(socket, "layout")["layout"]
            assert (layout["mode"], layout["commands"], layout["system"]) == ("live", [], "car-park")
            silent = True
            while silent:
                machines = until(socket, "snapshot")["snapshot"]["machines"]
                silent = any(one["state"] == "silent" for one in machines.values())
            for name in ("car_in", "break", "drop", "block", "pause", "seek"):
                socket.send(json.dumps({"command": name, "arguments": {}}))
                answer = until(socket, "answer")
                assert not answer["ok"]
                assert answer["answer"] == f"{name}: this bus is not simulated; the page only listens"
    finally:
        end(process, signal.SIGINT)


def test_a_live_bus_shows_what_its_frames_say_and_its_load() -> None:
    async def play() -> tuple[dict[str, Any], str]:
        site = find_site("small")
        source = LiveSource(site, contract(site))
        for raw in frames_of("small"):
            frame = raw.classic()
            assert frame is not None
            source.on_frame(frame, raw.time_us)
        with pytest.raises(CommandError) as refused:
            await source.command("car_in", {})
        return source.snapshot(), str(refused.value)

    snapshot, refused = asyncio.run(play())
    assert snapshot["figures"] == {"parked": 1, "fetched": 1, "calls": 2, "bids": 2}
    assert snapshot["machines"][1]["doors"]["light"] in ("red", "green"), "its devices are on the same wires here"
    assert all(0 < load < 1 for _, load, *_ in snapshot["chart"])
    assert "not simulated" in refused


def test_the_address_has_a_token_and_nothing_is_told_without() -> None:
    async def ask(port: int, path: str) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        answer = await reader.readline()
        writer.close()
        return answer.split()[1]

    async def play() -> None:
        site = find_site("small")
        source = LiveSource(site, contract(site))
        near, far = WebServer(source, "127.0.0.1:0"), WebServer(source, "0.0.0.0:0")
        serving = [asyncio.ensure_future(one.run()) for one in (near, far)]
        assert near.address.partition("?")[2] != far.address.partition("?")[2]
        for one in (near, far):
            token = one.address.partition("?token=")[2]
            assert len(token) >= 16
            assert await ask(one.port, "/") == b"403"
            assert await ask(one.port, f"/?token={token}") == b"200"
            one.stop()
        await asyncio.gather(*serving)

    asyncio.run(play())


def test_a_picture_that_stays_open_keeps_a_bounded_past() -> None:
    """Those that are open stay as long as there is room; call numbers that come round again are new calls."""
    calls, view = 3 * CALL_LIMIT, SiteView(find_site("small"))

    def say(*messages: Message) -> None:
        for one in messages:
            view.feed(one, view.now_us + 1_000)

    def call(number: int) -> CallForProposals:
        task = Reference(1, number)
        terms = (Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, 3_000, 1, 2, task, 2_700)
        return CallForProposals(1, number, task, *terms)

    say(call(1))
    for number in range(2, calls):
        say(call(number), Award(1, number, 11, Reference(1, number), 1, CallResult.WITHDRAWN, Reason.CANCELLED))
    assert len(view.calls) == CALL_LIMIT and len(view.tasks) == TASK_LIMIT
    assert (1, 1) in view.calls and Reference(1, 1) in view.tasks, "it is open still"
    assert view.calls_opened == calls - 1
    say(call(2))
    assert view.calls[1, 2].result is None and view.tasks[Reference(1, 2)].is_waiting


def test_the_usual_run_opens_the_picture_and_can_be_told_not_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As `make run` does, without a terminal."""
    words = ["run", "--one-car", "60", "--for", "3", "--trace", str(tmp_path / "run.log")]
    bus_sim(words)
    assert re.search(r"^picture at http://127\.0\.0\.1:\d+/\?token=[\w-]{22}$", capsys.readouterr().out, re.MULTILINE)
    bus_sim([*words, "--no-web"])
    assert "picture" not in capsys.readouterr().out
