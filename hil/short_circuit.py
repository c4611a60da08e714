"""Frames of one node destroyed on a simulated wire until the node is off the bus."""

import asyncio
from dataclasses import replace

from bus_sim.can.error_frames import CAN_ERR_BUSOFF
from bus_sim.can.faults import FaultInjector, FaultKind, InjectedFault
from bus_sim.can.medium import Medium
from onboard.core.frame import Frame

#: A fault that waits, us: longer than any run.
_NEVER_US = 10**15
#: The lowest byte of an identifier is the sender's node-ID.
_SENDER_MASK = 0xFF
#: Off the bus after 32 destroyed frames (ISO 11898-1, 12.1.4), once the node says anything at all, s.
_DEADLINE_S = 20.0


def waiting_fault(node_id: int) -> InjectedFault:
    """To be given to the bus beforehand; ``ShortCircuit`` sets it to work."""
    return InjectedFault(
        FaultKind.CORRUPTION, id_value=node_id, id_mask=_SENDER_MASK, extended=True, from_us=_NEVER_US, seed=node_id
    )


class ShortCircuit:
    """Works a ``waiting_fault`` of a bus."""

    def __init__(self, medium: Medium, node_id: int) -> None:
        self._medium = medium
        self._injector = next(one for one in medium.injectors if _is_waiting(one, node_id))
        self._off: asyncio.Future[None] | None = None
        medium.tap(self._on_frame)

    async def force_bus_off(self) -> None:
        """Return once a node is off the bus. Raises ``TimeoutError`` where none went in time."""
        now_us = self._medium.clock.now_us()
        waiting = self._injector.fault
        self._off = asyncio.get_running_loop().create_future()
        self._injector.fault = replace(waiting, from_us=now_us)
        try:
            async with asyncio.timeout(_DEADLINE_S):
                await self._off
        finally:
            self._injector.fault = waiting
            self._off = None

    def _on_frame(self, frame: Frame, _time_us: int, _sender: str) -> None:
        if self._off is not None and frame.is_error and frame.arbitration_id & CAN_ERR_BUSOFF and not self._off.done():
            self._off.set_result(None)


def _is_waiting(injector: FaultInjector, node_id: int) -> bool:
    return injector.fault.from_us == _NEVER_US and injector.fault.id_value == node_id
