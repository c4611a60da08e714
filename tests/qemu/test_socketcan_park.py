"""The small park on the Linux CAN stack: real sockets, real candump, each machine in a network namespace of its own."""

import json
import re
import sys
from pathlib import Path

import pytest

from hil.guest.machine import GuestRun, run_guest
from hil.guest.quick import QUICK
from onboard.config.site import parse_site
from onboard.contract.codes import KindCode, MachineState, Reason, TaskPhase
from onboard.contract.messages import (
    EmergencyStop,
    Halted,
    Heartbeat,
    Itinerary,
    Message,
    Progress,
    SyncRequest,
    TaskReport,
)
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.check.checks import Checks, check_records
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from onboard.wire.site_dbc import site_dbc
from tests.qemu.guest import ROOT, once, require_guest, scene_script
from tests.qemu.park_scene import REPLAYED, UNPLUGGED

SITE = (ROOT / "bus_sim" / "sites" / "small.toml").read_text(encoding="utf-8") + QUICK
MACHINES = {"IOC1": 1, "ER1": 5, "ER2": 6, "MR1": 11, "MR2": 12}
#: A node-ID that is kept for tools.
PERSON = 251
#: Of the guest's own time.
LIMIT_S = 400.0


def frame_of(message: Message) -> str:
    """A message of one frame in cansend's words."""
    (frame,) = fleet_codec().encode(message)
    return f"{frame.arbitration_id:08X}#{frame.data.hex().upper()}"


def held(node: int) -> Halted:
    """What a machine in its first life says while the person's emergency stop holds it."""
    return Halted(node, node, Reason.EMERGENCY_STOP, PERSON, needs_person=False, boot=1)


def heartbeats() -> dict[str, str]:
    """Of every machine the identifier of its heartbeat."""
    said = {node: Heartbeat(node, 1, 1, 1, 1, KindCode.ROBOT, MachineState.IDLE) for node in MACHINES.values()}
    return {name: frame_of(said[node])[:8] for name, node in MACHINES.items()}


def make(share: Path) -> GuestRun:
    share.mkdir()
    (share / "site.toml").write_text(SITE)
    (share / "site.dbc").write_text(site_dbc(parse_site(SITE, "site.toml")))
    begin = ["--one-car", "1", "--seed", "3", "--for", "150", "--trace", "plant.log", "--json", "figures.json"]
    order = {"machines": list(MACHINES), "begin": begin}
    (share / "order.json").write_text(json.dumps(order))
    cantools = Path(sys.executable).with_name("cantools")
    # So many rows that all messages of all machines are on the screen at once.
    monitor = f"stty rows 1000 cols 160; TERM=xterm exec {cantools} monitor site.dbc -i socketcan -c can0"
    plan = {
        "heartbeats": heartbeats(),
        "monitor": ["script", "-q", "-f", "-c", monitor, "monitor.screen"],
        "ask": frame_of(SyncRequest(PERSON, MACHINES["MR1"])),
        "answer": frame_of(Progress(MACHINES["MR1"], 1, 1, 1, 1, 0, 0))[:8],
        "stop": frame_of(EmergencyStop(PERSON, Reason.OPERATOR)),
        "held": {name: frame_of(held(node)) for name, node in MACHINES.items()},
    }
    (share / "plan.json").write_text(json.dumps(plan))
    return run_guest(scene_script("tests.qemu.park_scene"), share, limit_s=LIMIT_S)


@pytest.fixture(scope="module")
def park(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished run, shared by all tests here."""
    require_guest()
    return once(tmp_path_factory, "park", make)


def recorded(log: Path) -> list[tuple[int, str, Message]]:
    """Every message of a candump log: microseconds, interface, message."""
    decoder, found = Decoder(fleet_codec()), []
    with log.open("rb") as lines:
        for record in CandumpReader(lines):
            message = decoder.feed(record.frame, record.time_us)
            if message is not None:
                found.append((record.time_us, record.channel, message))
    return found


def test_the_car_is_in_and_out_and_candumps_log_passes_the_checkers(park: Path) -> None:
    figures = json.loads((park / "figures.json").read_text())
    assert (figures["cars_in"], figures["cars_out"], figures["violations"]) == (1, 1, [])
    with (park / "fleet.log").open("rb") as lines:
        verdict = check_records(CandumpReader(lines), Checks(parse_site(SITE, "site.toml"), disturbed=True))
    assert verdict.is_good, "\n".join(verdict.lines())
    told = {message.phase for _, _, message in recorded(park / "fleet.log") if isinstance(message, TaskReport)}
    assert {TaskPhase.AWARDED, TaskPhase.DONE} <= told


def test_the_plants_process_heard_what_candump_recorded(park: Path) -> None:
    frames = [
        [line.split()[2] for line in (park / name).read_text().splitlines()] for name in ("fleet.log", "plant.log")
    ]
    assert set(frames[1]) <= set(frames[0])
    assert len(frames[1]) > 500


def test_an_unplugged_machine_is_not_heard_and_comes_back_with_its_life(park: Path) -> None:
    gone_s, back_s = json.loads((park / "found.json").read_text())["unplugged"]
    assert back_s - gone_s > 4
    beats = [
        (time_us / 1e6, message)
        for time_us, _, message in recorded(park / "fleet.log")
        if isinstance(message, Heartbeat) and message.sender == MACHINES[UNPLUGGED]
    ]
    assert not [at_s for at_s, _ in beats if gone_s + 0.5 < at_s < back_s]
    assert [beat for at_s, beat in beats if at_s > back_s], "it is heard again"
    assert {beat.boot for _, beat in beats} == {1}, "it was never restarted"
    others = {message.sender for at_us, _, message in recorded(park / "fleet.log") if gone_s < at_us / 1e6 < back_s}
    assert others >= {1, 5, 6, 11}, "the others go on"


def test_from_outside_the_interface_tells_who_sent(park: Path) -> None:
    """``candump any``: a node's frame comes in on its own interface and goes out on every other."""
    names = {node: name for name, node in MACHINES.items()} | {PERSON: "tools"}
    first: dict[str, str] = {}
    for line in (park / "outside.log").read_text().splitlines():
        _, interface, frame = line.split()
        first.setdefault(frame, interface)
    senders = {(int(frame[6:8], 16), interface) for frame, interface in first.items()}
    assert senders == {(node, names[node]) for node, _ in senders}
    assert {node for node, _ in senders} == set(names)


def test_cansend_asks_and_is_answered_and_an_emergency_stop_stops_everybody(park: Path) -> None:
    order = [message for _, _, message in recorded(park / "fleet.log")]
    asked = order.index(SyncRequest(PERSON, MACHINES["MR1"]))
    assert any(isinstance(one, Itinerary) and one.sender == MACHINES["MR1"] for one in order[asked:])
    stopped = order.index(EmergencyStop(PERSON, Reason.OPERATOR))
    assert {held(node) for node in MACHINES.values()} <= set(order[stopped:])
    status = json.loads((park / "found.json").read_text())["status"]
    assert status == {"plant": 0} | dict.fromkeys(MACHINES, 0), "who is held lives on"


def test_cantools_monitor_shows_every_machine(park: Path) -> None:
    screen = re.sub(r"\x1b[^A-Za-z]*[A-Za-z]", " ", (park / "monitor.screen").read_text(errors="replace"))
    # It draws only what differs from the line before: not every message's name is written as a whole.
    assert set(MACHINES) <= set(re.findall(r"\b([A-Z]+\d+)_\w+\(", screen))


def test_canplayer_plays_the_log_to_another_node(park: Path) -> None:
    sent = [line.split()[2] for line in (park / "part.log").read_text().splitlines()]
    assert len(sent) == REPLAYED
    assert json.loads((park / "found.json").read_text())["replayed"] == sent
