"""`bus-sim run` takes every option on every system: what concerns buses, processes and faults is nobody's own."""

import json
import os
import re
import signal
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import can
import pytest

from bus_sim import session
from bus_sim.cli import main
from bus_sim.faults.arm import ACTIONS
from bus_sim.faults.bus import FRAME_FAULTS
from bus_sim.faults.table import KINDS
from bus_sim.options import RunOptions
from bus_sim.outside import Served
from bus_sim.processes.plan import ProcessPlan
from bus_sim.run import FLEET, BusRun
from bus_sim.sites import site_text
from bus_sim.systems.registry import simulated_names
from onboard.contract.messages import Heartbeat, Message
from onboard.systems.contract import codecs_for
from onboard.systems.registry import system_names
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.decoder import Decoder
from tests.conformance.cases import CASES
from tests.conformance.runs import can_be_held, site_file, site_of
from tests.tools import DEADLINE_S

PLUGIN = Path(__file__).parents[1] / "plugin"
every_system = pytest.mark.parametrize("system", CASES)
without_cars = pytest.mark.parametrize("system", [one for one in CASES if one != "car-park"])


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Plays some seconds of a site with these options, and answers with what was printed. Fails on a bad status."""
    monkeypatch.chdir(tmp_path)

    def play(system: str, *options: str, seconds: float = 20.0, statuses: tuple[int, ...] = (0, 1)) -> str:
        # Few runs are over so soon: 1 says that somebody waits, and nothing else may be wrong.
        words = [site_file(system), "--for", str(seconds), "--seed", "1", "--json", "figures.json", *options]
        status = main(["run", *words])
        said = capsys.readouterr()
        assert status in statuses, said.err
        return said.out + said.err

    return play


def nothing_broke(folder: Path) -> None:
    figures = json.loads((folder / "figures.json").read_text(encoding="utf-8"))
    assert not figures["violations"] and not figures["halted"], figures


def heard(system: str, folder: Path, log: str = "trace.log") -> set[int]:
    """Who was heard on the fleet bus: node-IDs."""
    decoder = Decoder(codecs_for(site_of(system)).fleet)
    with (folder / log).open("rb") as lines:
        messages = [decoder.feed(one.frame, 0) for one in CandumpReader(lines) if one.channel == FLEET]
    return {one.sender for one in messages if isinstance(one, Heartbeat)}


def test_each_system_that_can_be_simulated_is_tried_here() -> None:
    assert CASES.keys() == set(simulated_names()) == set(system_names())


@every_system
def test_a_machine_is_left_out(system: str, run: Callable[..., str], tmp_path: Path) -> None:
    machines = site_of(system).machines
    left_out = list(machines.values())[-1]
    run(system, "--without", left_out.name, "--speed", "max")
    assert heard(system, tmp_path) == set(machines) - {left_out.node_id}
    nothing_broke(tmp_path)


@every_system
def test_a_machine_that_is_not_there_cannot_be_left_out(system: str, run: Callable[..., str]) -> None:
    assert "--without Nobody: no such machine; machines here: " in run(system, "--without", "Nobody", statuses=(2,))


@every_system
def test_its_buses_are_served_joined_and_shown(system: str, run: Callable[..., str], tmp_path: Path) -> None:
    channel = f"every {system}"
    with can.Bus(interface="virtual", channel=channel) as outside:
        options = ("--serve", "127.0.0.1:0", "--bus", f"virtual:{channel}", "--web", "0", "--speed", "max")
        said = run(system, *options, seconds=3.0)
        frames = list(iter(partial(outside.recv, timeout=0), None))
    names = [one.name for one in site_of(system).machines.values()]
    assert f"(socketcand), channels {', '.join([FLEET, *names])}" in said
    assert f"the fleet bus is on virtual:{channel}" in said and "picture at http://127.0.0.1:" in said
    assert frames, "nothing came through to the interface"
    nothing_broke(tmp_path)


@every_system
def test_a_machine_is_a_process_of_its_own(system: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last machine runs as ``onboard``, all others are off; it speaks under its site's digest."""
    monkeypatch.chdir(tmp_path)
    # As where the package of a system is installed.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(PLUGIN), str(PLUGIN.parents[1])]))
    name = site_file(system)
    site = site_of(system)
    *others, process = site.machines.values()
    said: list[Heartbeat] = []

    def prepare(run: BusRun[Any]) -> None:
        def hear(message: Message, _: int) -> None:
            if isinstance(message, Heartbeat):
                said.append(message)
                signal.raise_signal(signal.SIGINT)

        run.observers.append(hear)

    options = RunOptions(
        speed=1.0,
        limit_s=DEADLINE_S,
        demand=None,
        without=frozenset(one.name for one in others),
        processes=ProcessPlan(site_text(name)),
        serve="127.0.0.1:0",
    )
    stage = session.play(site, options, prepare)
    assert {(one.sender, one.site_digest) for one in said} == {(process.node_id, site.digest)}
    assert stage.run.controllers == {}, "it is not in this process"


@every_system
def test_it_is_published(system: str, run: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The gateway gets the site and the served bus; what it says of each system is its own tests' business."""
    published = []

    class Published:
        def __init__(self, site: object, text: str, url: str, served: Served, _: object) -> None:
            published.append((getattr(site, "system", ""), "[" in text, url, served.host))

        async def __aenter__(self) -> None:
            """As if it had started."""

        async def __aexit__(self, *_: object) -> None:
            """As if it had ended."""

    monkeypatch.setattr("bus_sim.session.Publishing", Published)
    run(system, "--mqtt", "mqtt://127.0.0.1:1", "--speed", "max", seconds=1.0)
    assert published == [(system, True, "mqtt://127.0.0.1:1", "127.0.0.1")]


def faults_on(system: str) -> list[str]:
    """One fault of each kind that any system can have."""
    names = [one.name for one in site_of(system).machines.values()]
    found = []
    for kind in (*FRAME_FAULTS, *ACTIONS):
        if not (targets := can_be_held(system) if kind == "held" else names):
            continue
        last = targets[-1]
        settings = {"target": last, "receivers": last, "members": last, "name": "mutated", "do": "stop"}
        known = KINDS[kind].settings
        given = [f"{key}={settings[key]}" for key in settings if key in known and known[key].default is None]
        found.append(f"{kind}:" + ",".join([*given, "at_s=6"]))
    return found


@every_system
def test_each_machine_is_held_or_the_run_is_refused_in_one_line(system: str, run: Callable[..., str]) -> None:
    last = list(site_of(system).machines.values())[-1].name
    holdable = last in can_be_held(system)
    said = run(system, "--fault", f"held:target={last},at_s=1", "--speed", "max", seconds=2.0, statuses=(0, 1, 2))
    assert (f"fault 'held:target={last},at_s=1.0': {last}" in said) != holdable
    assert holdable or said.count("\n") == 1


@every_system
def test_faults_of_buses_controllers_and_operators_strike(system: str, run: Callable[..., str], tmp_path: Path) -> None:
    """All at once, so that only what is said of them can be looked at: every kind is taken, and nothing gives way."""
    options = [word for fault in faults_on(system) for word in ("--fault", fault)]
    run(system, *options, "--speed", "max", seconds=12.0)
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert not figures["violations"], figures


@every_system
def test_one_crash_is_got_over(system: str, run: Callable[..., str], tmp_path: Path) -> None:
    machine = list(site_of(system).machines.values())[-1]
    run(system, "--fault", f"crash:target={machine.name},at_s=5,restart_s=2", "--speed", "max", seconds=12.0)
    nothing_broke(tmp_path)
    assert machine.node_id in heard(system, tmp_path)


@without_cars
@pytest.mark.parametrize(
    "option",
    [("--random", "40", "15"), ("--one-car", "60"), ("--hour", "07:00"), ("--by-hand",), ("--day", "x")],
)
def test_what_is_about_cars_is_refused_where_no_cars_come(
    system: str, option: tuple[str, ...], run: Callable[..., str]
) -> None:
    said = run(system, *option, statuses=(2,))
    assert said.count("\n") == 1
    assert re.match(
        rf"bus-sim: {option[0]}: is about cars .* is a {site_of(system).called}, and its orders are those of its", said
    )


@without_cars
def test_a_fault_that_strikes_nothing_there_is_refused_with_the_reason(system: str, run: Callable[..., str]) -> None:
    said = run(system, "--fault", "lost_ticket:car=1", "--speed", "max", seconds=1.0, statuses=(2,))
    assert (
        f"a {site_of(system).called} has nothing that this strikes (a customer comes back without the ticket)" in said
    )


@every_system
def test_a_scene_of_single_faults_is_there(system: str, tmp_path: Path) -> None:
    """`bus-sim campaign S --exhaustive crash`: one order alone, all points of it, of which two are played."""
    name = site_file(system)
    words = ["--exhaustive", "crash", "--sample", "2", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert main(["campaign", name, *words]) == 0
