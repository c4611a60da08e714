"""Wire input never raises: a node that says anything the contract allows, and worse, stops no controller."""

import asyncio
import random

import pytest

from bus_sim.options import RunOptions
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import run
from onboard.contract.codes import Reason
from onboard.core.frame import Frame
from onboard.wire.dbc_file import fleet_layouts
from tests.sites import one_floor
from tests.thinned import some
from tests.wire.samples import CODES, message_of, random_frames

FLEET = {layout.name for layout in fleet_layouts()}
OWN_NODES = (1, 11)


async def _babble(seed: int) -> Simulation:
    loop = asyncio.get_running_loop()
    simulation = build(one_floor(), RunOptions(), loop)  # type: ignore[arg-type]  # run() makes a virtual loop
    simulation.start()
    await asyncio.sleep(12)
    bus, chance = simulation.fleet.attach("babbler", 99), random.Random(seed)
    said = [one for one in random_frames(150, seed) if one[0].name in FLEET and one[0].name != "EmergencyStop"]
    chance.shuffle(said)
    for layout, _, values in said:
        node = chance.choice([2, 12, 99, 250, 251, 255])
        bus.send(Frame(layout.frame_id | node, CODES[layout.name].pack(message_of(layout.name, node, values))))
        bus.send(Frame(layout.frame_id | node, chance.randbytes(chance.randrange(9))))
        await asyncio.sleep(0.002)
    await asyncio.sleep(20)
    return simulation


@pytest.mark.parametrize("seed", some(range(1, 9), 3))
def test_a_babbling_node_stops_no_controller_and_is_counted(seed: int) -> None:
    simulation = run(_babble(seed))
    for node in OWN_NODES:
        controller = simulation.controllers[node]
        assert controller.holon.halted is None
        drops = controller.all_drops()
        for reason in (Reason.SHORT_FRAME, Reason.VALUE_OUT_OF_RANGE, Reason.INCOMPLETE_SET, Reason.OTHER_CONTRACT):
            assert drops[reason] > 0
    told = {key: count for key, count in simulation.view.messages.items() if key == "Diagnostic"}
    assert told["Diagnostic"] > 0, "the bus itself shows what was dropped"
    assert simulation.plant.oracle.finish() == []
