"""A pulled plug: nothing is heard, what is sent waits, and it leaves late once the plug is back."""

import asyncio

from bus_sim.can.medium import Medium
from bus_sim.virtual_time import VirtualTimeLoop, run
from hil.cable import QUEUE_LIMIT, Cable
from onboard.core.frame import Frame

FRAME = Frame(0x100, b"\x01")


def test_frames_wait_while_the_plug_is_out() -> None:
    async def scene() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        medium = Medium(loop)
        other = medium.attach("other")
        cable = Cable(lambda: medium.attach("device"))
        heard: list[Frame] = []
        got: list[Frame] = []
        other.subscribe(lambda frame, _: heard.append(frame))
        cable.subscribe(lambda frame, _: got.append(frame))
        cable.send(FRAME)
        await asyncio.sleep(0.01)
        assert len(heard) == 1
        cable.unplug()
        medium.attach("third")
        assert cable.send(FRAME)
        other.send(Frame(0x200, b""))
        await asyncio.sleep(0.01)
        assert (len(heard), got) == (1, [])
        cable.plug()
        await asyncio.sleep(0.01)
        assert (len(heard), cable.health().sent) == (2, 2)
        other.send(Frame(0x201, b""))
        await asyncio.sleep(0.01)
        assert [frame.arbitration_id for frame in got] == [0x201]

    run(scene())


def test_the_queue_of_an_unplugged_node_has_an_end() -> None:
    async def scene() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        medium = Medium(loop)
        cable = Cable(lambda: medium.attach("device"))
        cable.unplug()
        assert [cable.send(FRAME) for _ in range(QUEUE_LIMIT + 1)][-2:] == [True, False]
        assert cable.health().send_refused == 1
        cable.power_off()
        cable.plug()
        assert cable.node is None, "who has lost its power does not come back with the plug"

    run(scene())
