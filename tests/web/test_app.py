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


def client(token: str | None = None) -> TestClient:
    return TestClient(create_app(Shown(), token))


def answer(socket: Any, text: str) -> dict[str, Any]:
    socket.send_text(text)
    told: dict[str, Any] = {}
    while "answer" not in told:
        told = json.loads(socket.receive_text())
    return told


def test_a_viewer_gets_the_layout_then_a_snapshot_with_the_figures() -> None:
    with client().websocket_connect("/live") as socket:
        assert json.loads(socket.receive_text()) == {"layout": {"site": "test", "mode": "simulated"}}
        assert json.loads(socket.receive_text()) == {"snapshot": {"now_us": 5}, "figures": {"tasks": 0}}


def test_the_page_and_all_that_it_asks_for_come_from_here_and_nothing_else_may() -> None:
    page = client().get("/")
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
    with client().websocket_connect("/live") as socket:
        found = answer(socket, text)
        assert found["answer"] == told
        assert found["ok"] is (told == "2")
        assert found["snapshot"] == {"now_us": 5}, "what has come of it is shown at once"


def test_beyond_loopback_nothing_is_shown_without_the_token() -> None:
    assert client("secret").get("/").status_code == 403
    assert client("secret").get("/?token=wrong").status_code == 403
    assert client("secret").get("/?token=secret").status_code == 200
    for path in ("/live", "/live?token=wrong"):
        with pytest.raises(WebSocketDisconnect), client("secret").websocket_connect(path):
            pass
    with client("secret").websocket_connect("/live?token=secret") as socket:
        assert "layout" in socket.receive_text()


def test_a_page_of_another_host_cannot_command_this_one() -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        client().websocket_connect("/live", headers={"origin": "http://evil.test"}),
    ):
        pass
    with client().websocket_connect("/live", headers={"origin": "http://testserver"}) as socket:
        assert "layout" in socket.receive_text()


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
