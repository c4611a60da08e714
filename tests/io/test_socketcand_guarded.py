"""Who may join a served bus: no browser, and, where there is a token, nobody without it."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from bus_sim.serve.socketcand import SocketcandServer
from onboard.core.frame import Frame
from onboard.io.kept_token import kept_token, read_token
from onboard.io.open_bus import BusOpenError, BusSettings, open_bus
from onboard.io.owned_file import OwnedFileError
from tests.io.hub import Ears, Hub
from tests.tools import DEADLINE_S

TOKEN = "0123456789abcdef"
FRAME = Frame(0x080100F0, bytes(8))
SAID = b"< open fleet:0123456789abcdef >< send 080100F0 8 0 0 0 0 0 0 0 0 >< echo >"


@pytest.fixture
async def hub() -> AsyncIterator[tuple[Hub, SocketcandServer, int]]:
    bus = Hub()
    server = SocketcandServer(
        lambda channel, name: bus.attach(name) if channel == "fleet" else None, int, port=0, token=TOKEN
    )
    yield bus, server, await server.start()
    await server.close()


async def conversation(port: int, *said: bytes) -> bytes:
    """What a client hears up to the end, or up to its echo."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    heard = b""
    async with asyncio.timeout(DEADLINE_S):
        assert await reader.readexactly(6) == b"< hi >"
        for piece in said:
            writer.write(piece)
            await writer.drain()
        while not heard.endswith(b"< echo >") and (more := await reader.read(1_000)):
            heard += more
    writer.close()
    return heard


@pytest.mark.parametrize(
    "begin",
    [
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1:29536\r\nContent-Type: text/plain\r\n\r\n",
        b"GET /?<open HTTP/1.1\r\n\r\n",
        b"\r\n OPTIONS * HTTP/1.1\r\n\r\n",
        b"\x16\x03\x01\x02\x00",
    ],
    ids=["post", "get", "after blank lines", "TLS"],
)
async def test_what_a_browser_sends_reaches_no_bus(hub: tuple[Hub, SocketcandServer, int], begin: bytes) -> None:
    """A page on the web that an operator visits could put frames on a real bus: the body of a POST was obeyed."""
    bus, server, port = hub
    node, ears = bus.attach("node"), Ears()
    node.subscribe(ears.on_frame)
    assert await conversation(port, begin + SAID) == b"< error not the socketcand protocol >"
    assert await conversation(port, b"\r\n" + SAID) == b"< ok >< echo >", "blanks before a message are none of a verb"
    assert await ears.hear(1) == [FRAME], "of the second alone"
    assert server.counts["foreign"] == 1


@pytest.mark.parametrize("channel", [b"fleet", b"fleet:", b"fleet:0123456789abcdeX", b"fleet:\xc3\xa9", b"MR1:" + b"x"])
async def test_without_the_token_there_is_no_channel(hub: tuple[Hub, SocketcandServer, int], channel: bytes) -> None:
    bus, server, port = hub
    heard = await conversation(port, b"< open " + channel + b" >< echo >")
    assert heard.startswith(b"< error could not open bus") and b"CHANNEL:TOKEN" in heard and not bus.nodes
    assert server.counts["refused"] == 1


async def test_our_client_says_the_token_of_a_file_and_no_message_names_it(
    hub: tuple[Hub, SocketcandServer, int], tmp_path: Path
) -> None:
    bus, _, port = hub
    node, ears = bus.attach("node"), Ears()
    node.subscribe(ears.on_frame)
    kept = tmp_path / "token"
    kept.write_text(f"{TOKEN}\n", encoding="ascii")
    kept.chmod(0o600)
    extra = (("port", port), ("token_file", str(kept)))
    client = await open_bus(BusSettings("socketcand-asyncio", "fleet", extra=extra))
    assert client.send(FRAME) and await ears.hear(1) == [FRAME]
    assert TOKEN not in client.name
    await client.close()
    with pytest.raises(BusOpenError, match="could not open bus") as refused:
        await open_bus(BusSettings("socketcand-asyncio", f"fleet:{TOKEN}x", extra=(("port", port),)))
    assert TOKEN not in str(refused.value)


def test_a_token_is_made_once_for_its_owner_alone(tmp_path: Path) -> None:
    kept = tmp_path / "token"
    word = kept_token(kept)
    assert len(word) >= 22 and kept_token(kept) == read_token(kept) == word
    assert kept.stat().st_mode & 0o077 == 0
    assert kept_token(tmp_path / "other") != word
    kept.chmod(0o644)
    with pytest.raises(OwnedFileError, match="others may read it; chmod 600"):
        kept_token(kept)
    kept.chmod(0o600)
    for wrong in ("", "short", "a" * 129, "sixteen letters and a blank"):
        kept.write_text(wrong, encoding="ascii")
        with pytest.raises(OwnedFileError, match="its first line needs 16 to 128"):
            kept_token(kept)
    for place in (Path("/dev/zero"), tmp_path, tmp_path / "none" / "token"):
        with pytest.raises(OwnedFileError) as told:
            kept_token(place)
        assert "\n" not in str(told.value)
    with pytest.raises(OwnedFileError, match="does not exist"):
        read_token(tmp_path / "none")


def test_a_bus_is_served_to_others_with_a_token_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "small", "--one-car", "60", "--for", "1", "--trace", str(tmp_path / "run.log")]
    assert bus_sim([*words, "--serve", "0.0.0.0:0"]) == 2
    assert "others reach it there, and may say anything; add --serve-token FILE" in capsys.readouterr().err
    served = ["--serve", "0.0.0.0:0", "--serve-token", str(tmp_path / "token"), "--speed", "max"]
    bus_sim([*words, *served])
    said = capsys.readouterr().out
    assert f"open CHANNEL:TOKEN, the token is in {tmp_path / 'token'}" in said
    assert read_token(tmp_path / "token") not in said
