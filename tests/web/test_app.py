"""The page's server as a browser, or somebody else's page, meets it."""

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from bus_sim.cli import main as bus_sim
from onboard.cli import main as onboard
from onboard.web.address import WebError, parse_address
from onboard.web.app import CommandError, create_app, number

ROOT = Path(__file__).parents[2]


class Shown:
    """A source with nothing in it that takes one command."""

    mode = "simulated"

    def layout(self) -> dict[str, Any]:
        return {"site": "test"}

    def snapshot(self) -> dict[str, Any]:
        return {"now_us": 5}

    def figures(self) -> dict[str, Any]:
        return {"tasks": 0}

    async def command(self, name: str, arguments: Mapping[str, Any]) -> str:
        if name != "speed":
            raise CommandError(f"{name}: no such command")
        return f"{number(arguments, 'factor', 1, 10):g}"

    async def sleep(self, seconds: float) -> None:
        await asyncio.Event().wait()


TOKEN = "a-token"
LIVE = f"ws://127.0.0.1/live?token={TOKEN}"


def client(host: str = "127.0.0.1") -> TestClient:
    return TestClient(create_app(Shown(), TOKEN, frozenset({"gate7"})), base_url=f"http://{host}")


def answer(socket: Any, text: str) -> dict[str, Any]:
    socket.send_text(text)
    told: dict[str, Any] = {}
    while "answer" not in told:
        told = json.loads(socket.receive_text())
    return told


def test_a_viewer_gets_the_layout_then_a_snapshot_with_the_figures() -> None:
    with client().websocket_connect(LIVE) as socket:
        assert json.loads(socket.receive_text()) == {"layout": {"site": "test", "mode": "simulated"}}
        assert json.loads(socket.receive_text()) == {"snapshot": {"now_us": 5}, "figures": {"tasks": 0}}


def test_the_page_and_all_that_it_asks_for_come_from_here_and_nothing_else_may() -> None:
    page = client().get(f"/?token={TOKEN}")
    assert page.status_code == 200 and "default-src 'self'" in page.headers["content-security-policy"]
    for name in ("page.js", "draw.js", "page.css"):
        assert name in page.text or name in client().get("/page.js").text
        assert client().get(f"/{name}").status_code == 200
    assert "http" not in page.text.replace("http-equiv", "")
    assert client().get("/app.py").status_code == client().get("/../app.py").status_code == 404


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"command": "speed", "arguments": {"factor": 2}}', "2"),
        ('{"command": "speed", "arguments": {"factor": 11}}', "factor: must be a number from 1 to 10"),
        ('{"command": "speed", "arguments": {"factor": true}}', "factor: must be a number from 1 to 10"),
        ('{"command": "speed", "arguments": {"factor": "2"}}', "factor: must be a number from 1 to 10"),
        ('{"command": "explode"}', "explode: no such command"),
        ('{"command": 7}', "not a command"),
        ("[]", "not a command"),
        ("{", "not a command"),
        ('{"command": "' + "x" * 5000 + '"}', "the command is too long"),
    ],
)
def test_a_command_is_answered_in_one_line(text: str, told: str) -> None:
    with client().websocket_connect(LIVE) as socket:
        found = answer(socket, text)
        assert found["answer"] == told
        assert found["ok"] is (told == "2")
        assert found["snapshot"] == {"now_us": 5}, "what has come of it is shown at once"


def is_let_in(told: TestClient, path: str = LIVE, **headers: str) -> bool:
    try:
        with told.websocket_connect(path, headers=headers) as socket:
            return "layout" in socket.receive_text()
    except WebSocketDisconnect as refused:
        return refused.code != 1008


def test_nothing_is_shown_without_the_token_on_loopback_either() -> None:
    assert client().get("/").status_code == 403
    assert client().get("/?token=wrong").status_code == client().get("/?token=%C3%A9").status_code == 403
    assert client().get(f"/?token={TOKEN}").status_code == 200
    assert not is_let_in(client(), "ws://127.0.0.1/live") and not is_let_in(client(), "ws://127.0.0.1/live?token=wrong")
    assert is_let_in(client())


def test_a_page_of_another_host_cannot_command_this_one() -> None:
    assert not is_let_in(client(), origin="http://evil.test")
    assert not is_let_in(client(), origin="null")
    assert is_let_in(client(), origin="http://127.0.0.1")


@pytest.mark.parametrize("host", ["evil.test", "evil.test:8080", "127.0.0.1.evil.test", "localhost.evil.test", "[::1"])
def test_a_name_that_was_made_to_point_here_opens_nothing(host: str) -> None:
    """DNS rebinding: the page and its socket agree about their host, and it is the attacker's."""
    told = client()
    assert told.get(f"/?token={TOKEN}", headers={"host": host}).status_code == 421
    assert told.get("/page.js", headers={"host": host}).status_code == 421
    assert not is_let_in(told, host=host, origin=f"http://{host}")


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost", "LOCALHOST.:80", "[::1]:8080", "192.0.2.7", "gate7"])
def test_its_own_names_and_numbers_open_it(host: str) -> None:
    assert is_let_in(client(), host=host, origin=f"http://{host}")


def test_bytes_and_deep_nests_are_refused_quietly(caplog: pytest.LogCaptureFixture) -> None:
    """Each was a traceback before an operator's eyes; the viewer of the first is cut off, and nobody else."""
    with client() as told, told.websocket_connect(LIVE) as other:
        with told.websocket_connect(LIVE) as socket:
            socket.send_bytes(b"\xff\xfe")
            with pytest.raises(WebSocketDisconnect) as ended:
                list(iter(socket.receive_text, None))
            assert ended.value.code == 1003
        for deep in ("[" * 4_000, '{"a":' * 800):
            assert answer(other, deep)["answer"] == "not a command"
        assert answer(other, '{"command": "speed", "arguments": {"factor": 2}}')["ok"]
    assert not caplog.records


def test_an_address_is_a_port_or_a_host_with_one() -> None:
    assert parse_address("8080") == ("127.0.0.1", 8080)
    assert parse_address("[::1]:0") == ("::1", 0)
    for wrong in ("host", "host:", "host:http", "127.0.0.1:70000"):
        with pytest.raises(WebError, match="must be PORT or HOST:PORT"):
            parse_address(wrong)


def test_mistakes_are_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site = str(ROOT / "bus_sim" / "sites" / "level1.toml")
    assert onboard(["web", str(tmp_path / "no.log"), "--site", site]) == 2
    assert "name an existing log" in capsys.readouterr().err
    (tmp_path / "empty.log").write_text("")
    assert onboard(["web", str(tmp_path / "empty.log"), "--site", site]) == 2
    assert "name a log that something was written to" in capsys.readouterr().err
    assert bus_sim(["run", "level1", "--one-car", "1", "--web", "nowhere"]) == 2
    assert "must be PORT or HOST:PORT" in capsys.readouterr().err
