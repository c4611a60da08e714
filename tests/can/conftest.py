"""Buses for the tests of this folder."""

from collections.abc import Callable, Iterator, Sequence

import pytest

from bus_sim.can.faults import InjectedFault
from tests.can.rig import Rig

MakeRig = Callable[..., Rig]


@pytest.fixture
def make_rig() -> Iterator[MakeRig]:
    rigs: list[Rig] = []

    def make(bit_rate: int = 500_000, faults: Sequence[InjectedFault] = ()) -> Rig:
        rigs.append(Rig(bit_rate, faults))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.close()


@pytest.fixture
def rig(make_rig: MakeRig) -> Rig:
    return make_rig()
