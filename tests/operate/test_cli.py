"""The command as a person meets it: mistakes in one line, and a bus with machines behind it."""

import os
import signal
import threading
from pathlib import Path

import can
import pytest

from bus_sim.sites import find_site, site_text
from onboard.cli import main as onboard
from onboard.contract.codes import Reason
from onboard.contract.messages import EmergencyStop, Halted, Message
from onboard.wire.codec import fleet_codec

SITE = find_site("small")


@pytest.fixture(autouse=True)
def _site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "site.toml").write_text(site_text("small"), encoding="utf-8")


MISTAKES = [
    (["hold", "MR9"], 'MR9: no machine of site small; did you mean "MR2"?'),
    (["hold", "ER1"], "ER1: a lift does not move about; use block, or stop"),
    (["block", "p(9,1)"], "p(9,1): no segment of site small; write p(TRACK,INDEX), tracks are 1, 2, 3"),
    (["block", "p(1,11)"], "p(1,11): no segment of site small"),
    (["clear", "here"], "here: no segment of site small"),
    (["block", "p(1,3)", "--reason", "operater"], '--reason operater: not known; did you mean "operator"?'),
    (["go", "--of", "256"], "256: no machine of site small"),
    (["change-site", "site.toml"], "site.toml: rights of a site of system car-park begin by its file"),
    (["change-site", "gone.toml"], "gone.toml: "),
    (["stop", "--node", "11"], "--node 11: no node-ID of a tool; from 251 to 255"),
]


@pytest.mark.parametrize(("words", "told"), MISTAKES)
def test_a_mistake_is_one_line_with_the_remedy(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert onboard(["operate", *words, "-i", "virtual", "-c", "none", "--site", "site.toml"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and told in error


def test_a_bus_must_be_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        onboard(["operate", "stop", "--site", "site.toml"])
    assert ended.value.code == 2 and "name a bus" in capsys.readouterr().err


def test_without_an_answer_nothing_is_said(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "site.toml").write_text(site_text("small") + "\n[timing]\nheartbeat_ms = 100\n", encoding="utf-8")
    with can.Bus(interface="virtual", channel="unanswered") as listener:
        for answer in ("", "n\n"):
            (tmp_path / "answer").write_text(answer, encoding="utf-8")
            with (tmp_path / "answer").open(encoding="utf-8") as source:
                monkeypatch.setattr("sys.stdin", source)
                assert onboard(["operate", "go", "-i", "virtual", "-c", "unanswered", "--site", "site.toml"]) == 2
            assert "nothing was said" in capsys.readouterr().out
        assert listener.recv(0) is None


def test_stop_is_said_at_once_and_ends_when_all_hold(capsys: pytest.CaptureFixture[str]) -> None:
    """A site of one thread that answers the stop for all of its machines."""
    codec = fleet_codec()

    def say(bus: can.BusABC, message: Message) -> None:
        for frame in codec.encode(message):
            bus.send(can.Message(arbitration_id=frame.arbitration_id, is_extended_id=True, data=frame.data))

    stop_id = codec.encode(EmergencyStop(251, Reason.OPERATOR))[0].arbitration_id
    with can.Bus(interface="virtual", channel="operated") as site:

        def answer() -> None:
            while (heard := site.recv(20)) is not None:
                if heard.arbitration_id == stop_id:
                    for node in SITE.machines:
                        say(site, Halted(node, node, Reason.EMERGENCY_STOP, 251, False, 1))
                    return

        machines = threading.Thread(target=answer)
        machines.start()
        words = ["operate", "stop", "--for", "0", "-i", "virtual", "-c", "operated", "--site", "site.toml"]
        assert onboard(words) == 0
        machines.join()
    out = capsys.readouterr().out
    assert "stop: said to all under node-ID 251" in out and "MR2 holds by it" in out


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_who_ends_the_tool_hears_what_still_holds(number: signal.Signals, capsys: pytest.CaptureFixture[str]) -> None:
    """A terminal that is closed too: in the midst of a regeneration all would stand for a tool that is gone."""
    before = signal.signal(number, signal.SIG_DFL)
    with can.Bus(interface="virtual", channel="ended") as site:

        def end() -> None:
            if site.recv(20) is not None:
                os.kill(os.getpid(), number)

        person = threading.Thread(target=end)
        person.start()
        try:
            assert onboard(["operate", "stop", "-i", "virtual", "-c", "ended", "--site", "site.toml"]) == 1
        finally:
            person.join()
            signal.signal(number, before)
    assert "no longer said: the stop holds for 30 s more" in capsys.readouterr().out
