"""Steps the foreign robot in virtual time: a process of node's, a line in and some lines out at each of its moments."""

import json
import subprocess
import tomllib
from asyncio import TimerHandle
from functools import partial
from pathlib import Path
from typing import Any, Self

from bus_sim.run import FLEET
from bus_sim.systems.car_park.simulation import Simulation
from onboard.core.frame import Frame
from onboard.ports.bus import Bus
from tests.conform.bench import Switch
from tests.tools import require_tool

FOLDER = Path(__file__).parent
#: Where the files of sites are.
_SITES = (FOLDER.parents[1] / "bus_sim" / "sites", FOLDER.parent / "conform")
#: From one wake to the next, so that a robot that is wrong does not stop time.
AT_LEAST_US = 1_000
Journal = dict[str, Any]


class Life:
    """One life of a robot: deaf and mute once it is ``off``. ``journal`` outlives it."""

    def __init__(self, simulation: Simulation, buses: dict[str, Bus], setup: Journal, journal: Journal) -> None:
        self.loop, self.buses, self.journal = simulation.loop, buses, journal
        self.timer: TimerHandle | None = None
        self.is_on = True
        command = ["node", str(FOLDER / "robot.mjs")]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for name, bus in buses.items():
            bus.subscribe(partial(self.on_frame, name))
        self.step("start", json.dumps([setup, journal]))

    def off(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
        if self.is_on:
            self.process.communicate()
        self.is_on = False

    def on_frame(self, name: str, frame: Frame, _: int) -> None:
        if not self.is_on:
            return
        if frame.is_extended and not frame.is_remote:
            self.step(name, f"{frame.arbitration_id} x{frame.data.hex()}")
        elif name == FLEET:
            self.step(name, "0")

    def step(self, kind: str, rest: str = "") -> None:
        """One moment: what it says is carried out when it has said all."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(f"{self.loop.now_us()} {kind} {rest}\n")
        self.process.stdin.flush()
        frames = []
        for line in self.process.stdout:
            word, _, rest = line.rstrip().partition(" ")
            if word == "wake":
                break
            if word == "keep":
                self.journal.clear()
                self.journal.update(json.loads(rest))
            else:
                number, _, data = rest.partition(" ")
                frames.append((word, Frame(int(number), bytes.fromhex(data))))
        else:
            raise AssertionError("the foreign robot has ended")
        for name, frame in frames:
            self.buses[name].send(frame)
        self.wake_at(int(rest))

    def wake_at(self, due_us: int) -> None:
        if self.timer is not None:
            self.timer.cancel()
        self.timer = None
        if due_us >= 0:
            due_s = max(due_us, self.loop.now_us() + AT_LEAST_US) / 1e6
            self.timer = self.loop.call_at(due_s, partial(self.step, "wake"))


class Foreign:
    """Machines of a simulation that are the foreign robot's; their processes end with the ``with``.

    ``fault`` names one of the ways in which it is made faulty.
    """

    def __init__(self, machine: str = "MR1", fault: str = "") -> None:
        self.machine, self.fault = machine, fault
        self.lives: list[Life] = []

    def __enter__(self) -> Self:
        require_tool("node")
        return self

    def __exit__(self, *_: object) -> None:
        for one in self.lives:
            one.off()

    def joins(self, simulation: Simulation) -> Switch:
        """What the bench asks for: switches its power."""
        site = simulation.site
        node = site.machine(self.machine).node_id
        file = next(folder / f"{site.name}.toml" for folder in _SITES if (folder / f"{site.name}.toml").exists())
        text = tomllib.loads(file.read_text(encoding="utf-8"))
        setup = {"node": node, "site": text, "digest": site.digest, "fault": self.fault}
        journal: Journal = {}
        buses: dict[str, Bus] = {
            FLEET: simulation.fleet.attach("foreign", node),
            "device": simulation.devices[node].attach("foreign", node),
        }

        def switch(on: bool) -> None:
            if self.lives:
                self.lives[-1].off()
            if on:
                self.lives.append(Life(simulation, buses, setup, journal))

        return switch

    def join(self, simulation: Simulation) -> None:
        """It is on from the begin."""
        self.joins(simulation)(True)
