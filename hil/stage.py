"""What a scenario stands on: a device under test in a simulated fleet, and everything that is said on its buses."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.run import FLEET, BusRun
from bus_sim.systems.stage import SystemStage
from hil.device import Device
from hil.notice import Notice
from onboard.contract.codes import MachineState
from onboard.contract.messages import BusTime, Heartbeat, Message
from onboard.core.frame import Frame
from onboard.core.site import Machine, Site
from onboard.wire.decoder import Decoder

M = TypeVar("M", bound=Message)
T = TypeVar("T")

#: A machine in one of these states takes part.
_TAKING_PART = (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING)
#: Who speaks for the bench is no machine of any site (node-IDs 251 to 255 are for tools).
BENCH_NODE = 254


@dataclass(frozen=True)
class BenchMessage(Generic[M]):
    """One message at the end of its last frame: loop time in us, ``fleet`` or the device's name, and the message."""

    time_us: int
    bus: str
    message: M


class TestBench:
    """One run of one scenario. Times of deadlines are seconds of the run's clock."""

    def __init__(self, world: SystemStage[Any], site: Site, machine: Machine, device: Device, site_text: str) -> None:
        """``world`` is the fleet without orders of its own, on ``site`` but for those."""
        self.world = world
        self.simulation: BusRun[Any] = world.run
        self.site = site
        self.machine = machine
        self.device = device
        self.site_text = site_text
        self.said: list[BenchMessage[Message]] = []
        simulation = self.simulation
        #: The bench's own node on the fleet bus.
        self.node = simulation.fleet.attach("bench", None)
        self._notice = Notice()
        simulation.observers.append(lambda message, time_us: self._hear(time_us, FLEET, message))
        decoder = Decoder(simulation.codecs.device)

        def on_device(frame: Frame, time_us: int, _sender: str) -> None:
            message = decoder.feed(frame, time_us)
            if message is not None:
                self._hear(time_us, machine.name, message)

        simulation.devices[machine.node_id].tap(on_device, errors=ErrorsHeard.NONE)

    # --- what happens ------------------------------------------------------------------------------------------

    async def power_on(self) -> None:
        """Power for the device, with the bench's site file."""
        await self.device.power_on(self.site_text)

    def bring(self) -> None:
        """Something comes that the device can do alone: a car, an order."""
        self.world.bring(self.site, self.machine.node_id)

    def say(self, message: Message) -> None:
        """Say a message on the fleet bus, under whatever node-ID it carries."""
        for frame in self.simulation.codecs.fleet.encode(message):
            self.node.send(frame)

    def bus_time_ms(self) -> int:
        """Bus time now, as the fleet last told it. Fails the test where nobody has."""
        told = self._all(BusTime, 0)
        assert told, "nobody has told bus time"
        since_us = self.simulation.loop.now_us() - told[-1].time_us
        return (told[-1].message.bus_time_us + since_us) // 1000

    # --- what is waited for ------------------------------------------------------------------------------------

    def mark(self) -> int:
        """The present: what is said from now on has this place or a later one in ``said``."""
        return len(self.said)

    def heard(self, kind: type[M], since: int = 0) -> list[BenchMessage[M]]:
        """What anybody has said of one kind, on either bus, since a mark."""
        return self._all(kind, since)

    def own(self, kind: type[M], since: int = 0) -> list[BenchMessage[M]]:
        """What the device has said of one kind, on the fleet bus, since a mark."""
        return [one for one in self._all(kind, since) if one.bus == FLEET and self._is_own(one.message)]

    async def first(
        self, kind: type[M], what: str, within_s: float, where: Callable[[M], bool] = lambda _: True, since: int = 0
    ) -> BenchMessage[M]:
        """The first message of a kind that fits, said since a mark or coming. Fails the test where none comes."""
        place = since

        def look() -> BenchMessage[M] | None:
            nonlocal place
            found = next((one for one in self._all(kind, place) if where(one.message)), None)
            place = len(self.said)
            return found

        return await self.until(look, what, within_s)

    async def first_own(
        self, kind: type[M], what: str, within_s: float, where: Callable[[M], bool] = lambda _: True, since: int = 0
    ) -> BenchMessage[M]:
        """The same of what the device says, or its sensors."""
        return await self.first(kind, what, within_s, lambda one: self._is_own(one) and where(one), since)

    async def until(self, look: Callable[[], T | None], what: str, within_s: float) -> T:
        """Look again after every message until ``look`` finds something. Fails the test after ``within_s``."""
        found = await self._notice.until(look, within_s)
        assert found is not None, f"no {what} within {within_s:g} s; {self._last_words()}"
        return found

    async def takes_part(self, within_s: float, since: int | None = None) -> Heartbeat:
        """Wait until the device, and every machine of the fleet, tells the same mirror digest and takes part."""
        begin = self.mark() if since is None else since
        nodes = {self.machine.node_id, *self.simulation.controllers}

        def look() -> Heartbeat | None:
            beats = {one.message.sender: one.message for one in self._all(Heartbeat, begin)}
            heard = [beats[node] for node in nodes if node in beats]
            own = beats.get(self.machine.node_id)
            if own is None or len(heard) < len(nodes) or own.state not in _TAKING_PART:
                return None
            return own if len({beat.mirror_digest for beat in heard}) == 1 else None

        return await self.until(look, "agreement of all mirrors", within_s)

    async def beats(self, node_id: int, count: int, within_s: float) -> None:
        """Let so many heartbeats of another machine pass: time as the fleet counts it."""
        since = self.mark()

        def look() -> bool | None:
            passed = [one for one in self._all(Heartbeat, since) if one.message.sender == node_id]
            return len(passed) >= count or None

        await self.until(look, f"{count} heartbeats of node {node_id}", within_s)

    # --- inside ------------------------------------------------------------------------------------------------

    def _hear(self, time_us: int, bus: str, message: Message) -> None:
        self.said.append(BenchMessage(time_us, bus, message))
        self._notice.tell()

    def _all(self, kind: type[M], since: int) -> list[BenchMessage[M]]:
        said = self.said[since:]
        return [BenchMessage(one.time_us, one.bus, one.message) for one in said if isinstance(one.message, kind)]

    def _is_own(self, message: Message) -> bool:
        return message.sender == self.machine.node_id

    def _last_words(self) -> str:
        fleet = [one for one in self.said if one.bus == FLEET and self._is_own(one.message)]
        if not fleet:
            return f"{self.machine.name} has said nothing on the fleet bus"
        return f"{self.machine.name} last said {fleet[-1].message} at {fleet[-1].time_us / 1e6:.3f} s"
