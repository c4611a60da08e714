"""A simulated bus on a table: nodes that write down what they hear, and a clock that a test moves."""

import asyncio
from collections.abc import Sequence

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.faults import InjectedFault
from bus_sim.can.medium import Medium
from bus_sim.can.node import AcceptanceFilter, NodeOptions, SimulatedBus
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.frame import Frame

Heard = tuple[int, Frame]


def std(identifier: int, data: bytes = b"", *, remote_dlc: int | None = None) -> Frame:
    return Frame(identifier, data, False, remote_dlc is not None, remote_dlc=remote_dlc or 0)


def ext(identifier: int, data: bytes = b"", *, remote_dlc: int | None = None) -> Frame:
    return Frame(identifier, data, True, remote_dlc is not None, remote_dlc=remote_dlc or 0)


class Rig:
    """One bus; ``log`` is what a tap saw, ``heard`` and ``confirmed`` what each node was told."""

    def __init__(self, bit_rate: int = 500_000, faults: Sequence[InjectedFault] = ()) -> None:
        self.loop = VirtualTimeLoop()
        self.medium = Medium(self.loop, bit_rate=bit_rate, faults=faults)
        self.log: list[tuple[int, Frame, str]] = []
        self.heard: dict[str, list[Heard]] = {}
        self.confirmed: dict[str, list[Heard]] = {}
        self.medium.tap(
            lambda frame, time_us, sender: self.log.append((time_us, frame, sender)), errors=ErrorsHeard.EVERY
        )

    def node(
        self,
        name: str,
        node_id: int | None = None,
        filters: Sequence[AcceptanceFilter] = (),
        options: NodeOptions | None = None,
    ) -> SimulatedBus:
        bus = self.medium.attach(name, node_id, filters=filters, options=options)
        heard = self.heard.setdefault(name, [])
        confirmed = self.confirmed.setdefault(name, [])
        bus.subscribe(
            lambda frame, time_us: heard.append((time_us, frame)),
            lambda frame, time_us: confirmed.append((time_us, frame)),
        )
        return bus

    def at(self, when_us: int, bus: SimulatedBus, frame: Frame) -> None:
        def send(_when_us: int) -> None:
            bus.send(frame)

        self.loop.at_us(when_us, send)

    def run(self, duration_us: int) -> None:
        self.loop.run_until_complete(asyncio.sleep(duration_us / 1e6))

    def frames(self) -> list[Frame]:
        return [frame for _time_us, frame, _sender in self.log if not frame.is_error]

    def errors(self) -> list[Heard]:
        return [(time_us, frame) for time_us, frame, _sender in self.log if frame.is_error]

    def close(self) -> None:
        self.loop.close()
