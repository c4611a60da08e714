"""A site that is simulated with a gateway on its bus that takes orders from a double of a broker."""

import asyncio
import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from bus_sim.can.node import SimulatedBus
from bus_sim.run import BusRun
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.gateway.gateway import Gateway
from onboard.gateway.reports import Reports
from onboard.gateway.roles import Role, Roles
from onboard.gateway.settings import GatewaySettings
from onboard.ports.broker import Publication
from onboard.ports.journal import Entry
from tests.mqtt.double import DoubleBroker
from tests.mqtt.logs import EPOCH_US
from tests.mqtt.played import MemoryJournal
from tests.system.scene import Scene, play, stays

NODE = 251


class FatalJournal(MemoryJournal):
    """The power fails while the first order is written: before it is on the disk, or right after."""

    def __init__(self, *, written: bool) -> None:
        super().__init__()
        self.written, self.is_over = written, False
        self.die: Callable[[], None] = lambda: None

    async def append(self, entry: Entry) -> None:
        fatal = entry.get("record") == "order" and not self.is_over
        if self.written or not fatal:
            await super().append(entry)
        if fatal:
            self.is_over = True
            self.die()
            await asyncio.sleep(1)


class Ordered:
    """A gateway that lives beside a simulated site; ``orders`` are (s, topic, payload), ``deaths_s`` its power cuts."""

    def __init__(
        self,
        orders: Sequence[tuple[float, str, Any]],
        *,
        deaths_s: Sequence[float] = (),
        version: str = "2.1",
        journal: MemoryJournal | None = None,
        roles: Roles | None = None,
    ) -> None:
        """``roles`` beside ``desk``, which may order everything."""
        self._roles = roles or {}
        self.broker = DoubleBroker()
        self.journal = journal if journal is not None else MemoryJournal()
        self.gateways: list[Gateway] = []
        self._orders, self._deaths_s, self._version = orders, deaths_s, version
        self._task: asyncio.Future[None] | None = None
        self._bus: SimulatedBus | None = None

    def attach(self, run: BusRun[Any]) -> None:
        """Power up, and let what shall happen happen. On the running loop."""
        self._start(run)
        for at_s, topic, payload in self._orders:
            body = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
            run.loop.call_at(at_s, self.broker.take, Publication(topic, body, 1))
        for at_s in self._deaths_s:
            run.loop.call_at(at_s, self._die, run)
        if isinstance(self.journal, FatalJournal):
            self.journal.die = partial(self._die, run)

    def _start(self, run: BusRun[Any]) -> None:
        bus = self._bus = run.fleet.attach(f"gateway {len(self.gateways)}", NODE)
        roles = {"desk": Role(frozenset(run.site.machines), frozenset(run.site.machines)), **self._roles}
        settings = GatewaySettings(version=self._version, epoch_us=EPOCH_US, node_id=NODE, roles=roles)
        gateway = Gateway(
            run.site, run.codecs.fleet, self.broker, settings, reports=Reports(self.journal), send=bus.send
        )
        bus.subscribe(gateway.on_frame, gateway.on_frame)
        self.gateways.append(gateway)
        self._task = asyncio.ensure_future(gateway.run())

    def _die(self, run: BusRun[Any]) -> None:
        """What is not in the journal is lost; then it starts again."""
        assert self._task is not None
        self._task.cancel()
        assert self._bus is not None
        self._bus.power_off()
        run.loop.call_later(1.0, self._start, run)

    def stop(self) -> None:
        """Power down in order, soon."""
        self.gateways[-1].stop()

    async def end(self) -> None:
        """Power down in order."""
        assert self._task is not None
        self.stop()
        await self._task

    def told(self, site: str, name: str | None = None) -> list[Any]:
        """Everything told of orders, of one or of all, in turn."""
        found = [json.loads(one.payload) for one in self.broker.all if one.topic.startswith(f"onboard/{site}/order/")]
        return [one for one in found if name is None or one["id"] == name]

    def lives(self, site: str, name: str) -> list[str]:
        """The phases of an order, each once."""
        return list(dict.fromkeys(one["phase"] for one in self.told(site, name)))

    def states(self, serial: str) -> Iterator[Any]:
        """States of a machine."""
        for one in self.broker.all:
            if one.topic.endswith(f"/onboard/{serial}/state"):
                yield json.loads(one.payload)


def park_and_order(
    site: Site, cars: int, orders: Sequence[tuple[float, str, Any]], *, extra_s: float = 300.0, **options: Any
) -> tuple[Scene, Ordered]:
    """Cars come in one after another, and nobody comes for them but the orders."""
    ordered = Ordered(orders, **options)
    demand = stays(*((60.0 * number, None) for number in range(cars)))

    def before(simulation: Simulation) -> None:
        ordered.attach(simulation)

    return play(site, demand, before=before, after=ordered.end, extra_s=extra_s, limit_s=100.0 * cars + 200), ordered


def said(scene: Scene, kind: type[Message]) -> list[Message]:
    """Messages of the fleet bus of one class from the gateway."""
    return [message for _, message in scene.all(kind, "fleet") if message.sender == NODE]
