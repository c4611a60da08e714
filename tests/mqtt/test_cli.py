"""The commands as a person meets them: one that shows it all, and mistakes in one line each."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import Any

import pytest

from bus_sim.cli import main as bus_sim
from bus_sim.sites import site_text
from onboard.cli import main as onboard
from tests.mqtt.mosquitto import Mosquitto
from tests.tools import DEADLINE_S, require_tool, run_tool

ROOT = Path(__file__).parents[2]


@contextmanager
def process(*words: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A program whose output is read as it comes; killed where the test hangs or fails."""
    running = subprocess.Popen(
        words,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    alarm = Timer(2 * DEADLINE_S, running.kill)
    alarm.start()
    try:
        yield running
    finally:
        alarm.cancel()
        running.kill()
        running.communicate()


def lines_until(running: subprocess.Popen[str], pattern: str) -> list[str]:
    """What it says up to a line that fits; fails the test where it ends before."""
    assert running.stdout is not None
    said: list[str] = []
    for line in running.stdout:
        said.append(line)
        if re.search(pattern, line):
            return said
    raise AssertionError("it ended: " + "".join(said))


def test_one_command_shows_a_site_with_a_broker_of_its_own_and_takes_an_order(tmp_path: Path) -> None:
    for tool in ("mosquitto", "mosquitto_sub", "mosquitto_pub"):
        require_tool(tool)
    words = (sys.executable, "-m", "bus_sim.cli", "run", "small", "--mqtt", "--one-car", "9000", "--trace", "t.log")
    with process(*words, folder=tmp_path) as site:
        watch = next(one for one in lines_until(site, r"small/#") if "mosquitto_sub" in one)
        address = re.search(r"-h (\S+) -p (\d+)", watch)
        assert address is not None
        where = ("-h", address[1], "-p", address[2])
        # As it is printed, but for the topics: one line for each of what is waited for.
        with process(
            "mosquitto_sub", *where, "-v", "-t", "onboard/small/#", "-t", "uagv/v2/#", folder=tmp_path
        ) as reader:
            lines_until(reader, r"^onboard/small/status .*online")
            state = lines_until(reader, r"^uagv/v2/onboard/MR1/state ")[-1]
            told: Any = json.loads(state.split(" ", 1)[1])
            assert told["lastNodeId"] == "p(2,3)" and told["operatingMode"] == "AUTOMATIC"
            order = '{"id": "A1", "car": "1.99", "to": "IOC1"}'
            run_tool("mosquitto_pub", *where, "-q", "1", "-t", "onboard/small/orders/demo", "-m", order)
            life = lines_until(reader, r"UNKNOWN_TICKET")
            assert any('"phase":"accepted"' in one for one in life)
            site.send_signal(signal.SIGINT)
            lines_until(reader, r"^onboard/small/status .*offline")
        assert site.wait(DEADLINE_S) in (0, 1)


@pytest.mark.parametrize(
    ("url", "is_told"),
    [
        ("mqtt://broker.example", True),
        ("mqtt://192.0.2.1:1883", True),
        ("mqtts://broker.example", False),
        ("mqtt://127.0.0.1", False),
        ("mqtt://[::1]", False),
        ("mqtt://localhost", False),
    ],
)
def test_a_broker_elsewhere_without_tls_is_warned_of(
    url: str, is_told: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bus that it names is none, so that no broker is asked for."""
    words = ["gateway", "-i", "socketcand-asyncio", "-c", "two words", "--site", "small", "--mqtt", url]
    assert onboard([*words, "--spool", str(tmp_path)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert ("no TLS" in said[0] and f"write mqtts://{url[7:].split(':', maxsplit=1)[0]}" in said[0]) == is_told
    assert len(said) == 1 + is_told, "with the mistake itself"


MISTAKES = [
    (["--mqtt", "tcp://x"], "--mqtt tcp://x: not an address; write mqtt://HOST:PORT"),
    (["--mqtt", "mqtt://x:99999"], "port 99999 is not from 1 to 65535"),
    (["--mqtt", "mqtt://x", "--mqtt-ca", "ca.pem"], "--mqtt-ca ca.pem: goes with TLS only"),
    (["--mqtt", "mqtts://x", "--mqtt-ca", "no.pem"], "--mqtt-ca no.pem: cannot be read"),
    (["--mqtt", "mqtt://x", "--mqtt-password", "no.txt"], "--mqtt-password no.txt:"),
    (["--mqtt", "mqtt://x", "--vda5050", "1.1"], "--vda5050 1.1: not known; one of 2.1, 3.0"),
    (["--mqtt", "mqtt://x", "--prefix", "a/b"], "--prefix 'a/b': not a level of a topic"),
    (["--mqtt", "mqtt://x", "--orders", "11"], "--orders 11: no node-ID of a gateway; from 251 to 255"),
]


@pytest.mark.parametrize(("words", "told"), MISTAKES)
def test_a_mistake_is_one_line_with_the_remedy(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "site.toml").write_text(site_text("small"), encoding="utf-8")
    assert onboard(["gateway", "-i", "virtual", "-c", "none", "--site", "site.toml", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and told in error


def test_without_its_libraries_the_gateway_says_what_to_install(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("onboard.cli.is_mqtt_installed", lambda: False)
    monkeypatch.setattr("bus_sim.publish.is_mqtt_installed", lambda: False)
    assert onboard(["gateway", "--help"]) == 2
    assert "pip install 'onboard-fleet[mqtt]'" in capsys.readouterr().err
    assert bus_sim(["run", "small", "--mqtt"]) == 2
    assert "pip install 'onboard-fleet[mqtt]'" in capsys.readouterr().err


def test_a_broker_that_is_no_address_is_refused_before_anything_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert bus_sim(["run", "small", "--mqtt", "here"]) == 2
    assert "--mqtt here: not an address" in capsys.readouterr().err


MACHINE = """\
[machine]
name = "MR1"
site = "site.toml"
[fleet_bus]
interface = "socketcand-asyncio"
channel = "fleet"
host = "127.0.0.1"
port = {port}
[device_bus]
interface = "socketcand-asyncio"
channel = "MR1"
host = "127.0.0.1"
port = {port}
"""


async def test_a_controller_with_a_gateway_of_its_own_tells_of_itself_alone_and_its_death_is_told(
    tmp_path: Path,
) -> None:
    mosquitto = Mosquitto(tmp_path / "broker")
    await mosquitto.start()
    run = (sys.executable, "-m", "bus_sim.cli", "run", "small", "--without", "MR1", "--serve", "127.0.0.1:0")
    topics = ("mosquitto_sub", "-h", "127.0.0.1", "-p", str(mosquitto.port), "-v", "-t", "#")
    (tmp_path / "site.toml").write_text(site_text("small"), encoding="utf-8")
    with process(*run, "--one-car", "9000", folder=tmp_path) as site, process(*topics, folder=tmp_path) as reader:
        served = re.search(r"serving at 127\.0\.0\.1:(\d+)", lines_until(site, "serving at")[-1])
        assert served is not None
        (tmp_path / "mr1.toml").write_text(MACHINE.format(port=served[1]), encoding="utf-8")
        words = (
            "-m",
            "onboard",
            "--machine",
            "mr1.toml",
            "--mqtt",
            f"mqtt://127.0.0.1:{mosquitto.port}",
            "--vda5050",
            "3.0",
        )
        with process(sys.executable, *words, folder=tmp_path) as controller:
            told = lines_until(reader, r"^vda5050/v3/onboard/MR1/state .*p\(2,3\)")
            controller.kill()
            told += lines_until(reader, r"^vda5050/v3/onboard/MR1/connection .*CONNECTION_BROKEN")
    assert any(re.match(r"vda5050/v3/onboard/MR1/connection .*ONLINE", one) for one in told)
    machines = r"(vda5050/v3/onboard/MR1/|onboard/small/log/MR1 )"
    assert all(re.match(machines, one) for one in told), told
    await mosquitto.stop()
