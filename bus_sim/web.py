"""The page of a simulated run: what it shows comes from the buses, what it commands goes to the simulator."""

import asyncio
import random
from collections.abc import Callable, Mapping
from datetime import datetime
from types import TracebackType
from typing import Any, Self

from rich.console import Console

from bus_sim.by_hand import Hand
from bus_sim.can.faults import Fault, FaultKind
from bus_sim.can.medium import Tap
from bus_sim.demand import Law
from bus_sim.run import Simulation
from onboard.core.frame import Frame
from onboard.core.messages import Message
from onboard.core.site import Machine
from onboard.web.app import CommandError, number
from onboard.web.picture import LivePicture
from onboard.web.serve import WebServer
from onboard.wire.decoder import Decoder

#: Fastest pace that a page may ask for, simulated seconds a second.
MOST_SPEED = 1_000.0

_Arguments = Mapping[str, Any]


class SimulatedSource:
    """A run in this process. It hears the buses as any node does, and turns commands into acts of people and faults."""

    mode = "simulated"

    def __init__(self, simulation: Simulation, zero: datetime) -> None:
        """``zero`` is the local time of loop time 0."""
        self.picture = LivePicture(simulation.site)
        self._simulation = simulation
        self._zero_s = zero.hour * 3600 + zero.minute * 60 + zero.second
        self._hand = Hand(simulation.plant.street, simulation.options.seed)
        self._chance = random.Random(f"page:{simulation.options.seed}")
        self._arrivals: asyncio.Task[None] | None = None
        self._paused = False
        self._acts: dict[str, Callable[[_Arguments], str]] = {
            "pause": self._pause,
            "resume": self._resume,
            "speed": self._speed,
            "car_in": self._car_in,
            "car_out": self._car_out,
            "arrivals": self._set_arrivals,
            "break": self._break,
            "repair": self._repair,
            "drop": self._drop,
        }
        simulation.observers.append(self.picture.feed)
        simulation.fleet.tap(self._count)
        for node, medium in simulation.devices.items():
            medium.tap(self._device_tap(node))

    def _count(self, _frame: Frame, _time_us: int, _sender: str) -> None:
        self.picture.count_frame()

    def _device_tap(self, node: int) -> Tap:
        decoder = Decoder(self._simulation.codecs.device)

        def on_device(frame: Frame, time_us: int, _: str) -> None:
            message: Message | None = decoder.feed(frame, time_us)
            if message is not None:
                self.picture.feed_device(node, message)

        return on_device

    # --- the port ----------------------------------------------------------------------------------------------

    def layout(self) -> dict[str, Any]:
        """As in the port."""
        return self.picture.layout()

    def snapshot(self) -> dict[str, Any]:
        """As in the port; waiting is what the street measures."""
        self.picture.view.now_us = self._simulation.loop.now_us()
        summary = self._simulation.plant.street.summary()
        waits = (summary.in_wait_us, summary.out_wait_us)
        means = [sum(times) / len(times) / 1e6 if times else None for times in waits]
        return {
            **self.picture.snapshot(),
            "pace": 0 if self._paused else self._simulation.loop.pace or MOST_SPEED,
            "zero_s": self._zero_s,
            "waiting": {"in_s": means[0], "out_s": means[1]},
        }

    def figures(self) -> dict[str, Any]:
        """As in the port."""
        return self.picture.figures()

    async def command(self, name: str, arguments: _Arguments) -> str:
        """As in the port."""
        act = self._acts.get(name)
        if act is None:
            raise CommandError(f"{name}: no such command; there are {', '.join(self._acts)}")
        return act(arguments)

    async def sleep(self, seconds: float) -> None:
        """As in the port: the loop's clock runs ``pace`` times as fast as the wall's."""
        await asyncio.sleep(seconds * (self._simulation.loop.pace or MOST_SPEED))

    # --- commands ----------------------------------------------------------------------------------------------

    def _pause(self, _: _Arguments) -> str:
        self._paused = True
        self._simulation.loop.pause()
        return "paused"

    def _resume(self, _: _Arguments) -> str:
        self._paused = False
        self._simulation.loop.resume()
        return "goes on"

    def _speed(self, arguments: _Arguments) -> str:
        factor = number(arguments, "factor", 0.1, MOST_SPEED)
        self._simulation.loop.set_pace(factor)
        return f"{factor:g} times real time"

    def _car_in(self, _: _Arguments) -> str:
        return f"{self._hand.car_in()} comes in"

    def _car_out(self, _: _Arguments) -> str:
        name = self._hand.car_out()
        if name is None:
            raise CommandError("no car is inside that nobody has asked for")
        return f"the owner of {name} comes back"

    def _set_arrivals(self, arguments: _Arguments) -> str:
        law = Law(number(arguments, "mean_s", 5, 3600), number(arguments, "sigma_s", 0, 600))
        if self._arrivals is not None:
            self._arrivals.cancel()
        self._arrivals = asyncio.get_running_loop().create_task(self._arrive(law))
        return f"cars come and go every {law.mean_s:g} s +- {law.sigma_s:g} s"

    async def _arrive(self, law: Law) -> None:
        """Cars in, and as many out; who is wanted came first."""
        while True:
            await asyncio.sleep(law.draw_us(self._chance) / 1e6)
            self._hand.car_in()
            await asyncio.sleep(law.draw_us(self._chance) / 1e6)
            self._hand.car_out()

    def _machine(self, arguments: _Arguments) -> Machine:
        try:
            return self._simulation.site.machine(str(arguments.get("machine")))
        except KeyError:
            names = ", ".join(machine.name for machine in self._simulation.site.machines.values())
            raise CommandError(f"{arguments.get('machine')}: no such machine; there are {names}") from None

    def _break(self, arguments: _Arguments) -> str:
        machine = self._machine(arguments)
        if machine.node_id not in self._simulation.controllers:
            raise CommandError(f"{machine.name} is broken already")
        self._simulation.crash(machine)
        return f"{machine.name}'s controller has lost its power"

    def _repair(self, arguments: _Arguments) -> str:
        machine = self._machine(arguments)
        if machine.node_id in self._simulation.controllers:
            raise CommandError(f"{machine.name} is not broken")
        self._simulation.start_controller(machine)
        return f"{machine.name} starts again with its journal"

    def _drop(self, arguments: _Arguments) -> str:
        percent, seconds = number(arguments, "percent", 0, 100), number(arguments, "seconds", 1, 3600)
        now_us = self._simulation.loop.now_us()
        until_us = now_us + round(seconds * 1e6)
        seed = self._chance.randrange(1 << 30)
        self._simulation.fleet.add_fault(
            Fault(FaultKind.OMISSION, "page", probability=percent / 100, from_us=now_us, until_us=until_us, seed=seed)
        )
        return f"each receiver misses {percent:g} % of the frames for {seconds:g} s"


class Page:
    """The page for the time of a run: entered on the running loop, it prints its address and serves."""

    def __init__(self, source: SimulatedSource, where: str, console: Console) -> None:
        """Raises ``WebError``."""
        self._server = WebServer(source, where)
        self._console = console
        self._serving: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        self._serving = asyncio.get_running_loop().create_task(self._server.run())
        self._console.print(f"picture at {self._server.address}", highlight=False, soft_wrap=True)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.stop()
        if self._serving is not None:
            await self._serving
