import asyncio
from collections.abc import Awaitable, Callable

import pytest

from bus_sim.can.medium import Medium
from bus_sim.can.node import AcceptanceFilter, NodeOptions
from bus_sim.virtual_time import LoopClock, run
from onboard.ports.bus import Bus
from tests.can.conformance import CONFORMANCE, FILTER_MASK, FILTER_VALUE, Pair


class SimulatedPair:
    def __init__(self, options: NodeOptions) -> None:
        medium = Medium(LoopClock(asyncio.get_running_loop()))
        self.a: Bus = medium.attach("a", options=options)
        self.b: Bus = medium.attach("b")
        self.c: Bus | None = medium.attach("c")
        self.filtered: Bus | None = medium.attach("filtered", filters=[AcceptanceFilter(FILTER_VALUE, FILTER_MASK)])
        self.send_capacity: int | None = options.mailboxes + options.transmit_queue

    async def settle(self) -> None:
        await asyncio.sleep(1.0)


@pytest.mark.parametrize("options", [NodeOptions(), NodeOptions(mailboxes=3, transmit_queue=60)], ids=["one", "three"])
@pytest.mark.parametrize("check", CONFORMANCE, ids=lambda check: check.__name__)
def test_the_simulated_bus_conforms(check: Callable[[Pair], Awaitable[None]], options: NodeOptions) -> None:
    async def scenario() -> None:
        await check(SimulatedPair(options))

    run(scenario())
