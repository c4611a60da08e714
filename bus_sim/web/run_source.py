"""A simulated run as the page shows it: what it shows comes from the buses, what it commands goes to the simulator."""

import asyncio
import random
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.can.medium import Tap
from bus_sim.run import BusRun
from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.core.site import Machine
from onboard.web.app import CommandError, number
from onboard.web.picture import LivePicture, marks_of
from onboard.wire.decoder import Decoder

#: Fastest pace that a page may ask for, simulated seconds a second.
MOST_SPEED = 1_000.0

Arguments = Mapping[str, Any]
#: What a command does; it says so in one line, or raises ``CommandError``.
Act = Callable[[Arguments], str]


class RunSource:
    """A run in this process. It hears the buses as any node does, and turns commands into faults and the run's pace.

    What people do at a site differs from system to system: ``acts`` take further commands.
    """

    mode = "simulated"

    def __init__(self, run: BusRun[Any], zero: datetime | None = None, acts: Mapping[str, Act] | None = None) -> None:
        """``zero`` is the local time of loop time 0, None where the site's day has no clock."""
        self.picture = LivePicture(run.site, marks_of(run.site, run.codecs, None))
        self.chance = random.Random(f"page:{run.options.seed}")
        self._run = run
        self._zero_s = zero.hour * 3600 + zero.minute * 60 + zero.second if zero is not None else 0
        self._paused = False
        self.acts: dict[str, Act] = {
            "pause": self._pause,
            "resume": self._resume,
            "speed": self._speed,
            "break": self._break,
            "repair": self._repair,
            "drop": self._drop,
            **(acts or {}),
        }
        run.observers.append(self.picture.feed)
        run.fleet.tap(self._count)
        for node, medium in run.devices.items():
            medium.tap(self._device_tap(node), errors=ErrorsHeard.NONE)

    def _count(self, frame: Frame, time_us: int, _sender: str) -> None:
        self.picture.count_frame(frame)
        self.picture.mark_frame(frame, time_us)

    def _device_tap(self, node: int) -> Tap:
        decoder = Decoder(self._run.codecs.device)

        def on_device(frame: Frame, time_us: int, _: str) -> None:
            message: Message | None = decoder.feed(frame, time_us)
            if message is not None:
                self.picture.feed_device(node, message, time_us)

        return on_device

    # --- the port ----------------------------------------------------------------------------------------------

    def layout(self) -> dict[str, Any]:
        """As in the port, with the commands that this run takes."""
        return {**self.picture.layout(), "commands": sorted(self.acts)}

    def snapshot(self) -> dict[str, Any]:
        """The picture at the present virtual time, with the run's pace (virtual s to a wall s, 0 while paused)."""
        self.picture.view.now_us = self._run.loop.now_us()
        pace = 0 if self._paused else self._run.loop.pace or MOST_SPEED
        return {**self.picture.snapshot(), "pace": pace, "zero_s": self._zero_s}

    def figures(self) -> dict[str, Any]:
        """The indicators of the run so far."""
        return self.picture.figures()

    async def command(self, name: str, arguments: Arguments) -> str:
        """Carry out one command and tell what it did. Raises ``CommandError`` for one that there is not."""
        act = self.acts.get(name)
        if act is None:
            raise CommandError(f"{name}: no such command; there are {', '.join(sorted(self.acts))}")
        return act(arguments)

    async def sleep(self, seconds: float) -> None:
        """As in the port: the loop's clock runs ``pace`` times as fast as the wall's."""
        await asyncio.sleep(seconds * (self._run.loop.pace or MOST_SPEED))

    # --- commands ----------------------------------------------------------------------------------------------

    def _pause(self, _: Arguments) -> str:
        self._paused = True
        self._run.loop.pause()
        return "paused"

    def _resume(self, _: Arguments) -> str:
        self._paused = False
        self._run.loop.resume()
        return "goes on"

    def _speed(self, arguments: Arguments) -> str:
        factor = number(arguments, "factor", 0.1, MOST_SPEED)
        self._run.loop.set_pace(factor)
        return f"{factor:g} times real time"

    def _machine(self, arguments: Arguments) -> Machine:
        try:
            return self._run.site.machine(str(arguments.get("machine")))
        except KeyError:
            names = ", ".join(machine.name for machine in self._run.site.machines.values())
            raise CommandError(f"{arguments.get('machine')}: no such machine; there are {names}") from None

    def _break(self, arguments: Arguments) -> str:
        machine = self._machine(arguments)
        if machine.node_id not in self._run.controllers:
            raise CommandError(f"{machine.name} is broken already")
        self._run.crash(machine)
        return f"{machine.name}'s controller has lost its power"

    def _repair(self, arguments: Arguments) -> str:
        machine = self._machine(arguments)
        if machine.node_id in self._run.controllers:
            raise CommandError(f"{machine.name} is not broken")
        self._run.start_controller(machine)
        return f"{machine.name} starts again with its journal"

    def _drop(self, arguments: Arguments) -> str:
        percent, seconds = number(arguments, "percent", 0, 100), number(arguments, "seconds", 1, 3600)
        now_us = self._run.loop.now_us()
        until_us = now_us + round(seconds * 1e6)
        seed = self.chance.randrange(1 << 30)
        self._run.fleet.add_fault(
            InjectedFault(
                FaultKind.OMISSION, "page", probability=percent / 100, from_us=now_us, until_us=until_us, seed=seed
            )
        )
        return f"each receiver misses {percent:g} % of the frames for {seconds:g} s"
