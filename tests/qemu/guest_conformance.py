"""The conformance body of ``ports.Bus`` on the Linux CAN stack.

Runs in the guest, called by its name: the host's kernel may have no such stack, and collection passes this file over.
"""

from collections.abc import AsyncIterator, Awaitable, Callable
from itertools import permutations

import pytest

from hil.guest.mesh import QUEUE_LENGTH, run
from onboard.io.open_bus import BusSettings, open_bus
from tests.can import conformance
from tests.can.conformance import FILTER_MASK, FILTER_VALUE
from tests.io.test_conformance import VIRTUAL, OutsidePair

Check = Callable[[conformance.Pair], Awaitable[None]]
NODES = 4
BITRATE = 500_000


@pytest.fixture(scope="module")
def vcan() -> list[str]:
    """One virtual interface that all nodes' sockets share."""
    run("ip", "link", "add", "vcan0", "type", "vcan")
    _up("vcan0")
    return ["vcan0"] * NODES


@pytest.fixture(scope="module")
def mesh() -> list[str]:
    """An interface for each node, joined by the kernel's gateway."""
    for number in range(NODES):
        run("ip", "link", "add", f"node{number}", "type", "vxcan", "peer", "name", f"out{number}")
        _up(f"node{number}")
        _up(f"out{number}")
    for one, other in permutations(range(NODES), 2):
        run("cangw", "-A", "-s", f"out{one}", "-d", f"out{other}")
    return [f"node{number}" for number in range(NODES)]


def _up(name: str) -> None:
    run("ip", "link", "set", name, "txqueuelen", str(QUEUE_LENGTH), "up")


@pytest.fixture
async def pair(request: pytest.FixtureRequest) -> AsyncIterator[OutsidePair]:
    names: list[str] = request.getfixturevalue(request.param)
    accepts = [{"can_id": FILTER_VALUE, "can_mask": FILTER_MASK, "extended": True}]
    buses = [await open_bus(BusSettings("socketcan", name, BITRATE)) for name in names[:3]]
    filtered = await open_bus(BusSettings("socketcan", names[3], BITRATE, (("can_filters", accepts),)))
    one = OutsidePair(buses, filtered)
    yield one
    await one.close()


@pytest.mark.parametrize("pair", ["vcan"], indirect=True)
@pytest.mark.parametrize("check", VIRTUAL, ids=lambda check: check.__name__)
async def test_vcan(check: Check, pair: OutsidePair) -> None:
    await check(pair)


@pytest.mark.parametrize("pair", ["mesh"], indirect=True)
@pytest.mark.parametrize("check", VIRTUAL, ids=lambda check: check.__name__)
async def test_mesh(check: Check, pair: OutsidePair) -> None:
    await check(pair)
