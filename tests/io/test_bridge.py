"""A simulated bus joined with another: each frame crosses once."""

import itertools

import pytest

from bus_sim.serve.bridge import open_bridge, parse_bus_spec, parse_bus_specs
from onboard.core.frame import Frame
from onboard.io.open_bus import open_bus
from onboard.io.settings import BusSettings
from tests.io.hub import Ears, Hub, until

_numbers = itertools.count()


async def test_frames_cross_once_in_both_directions() -> None:
    hub, ears_inside, ears_outside = Hub(), Ears(), Ears()
    settings = parse_bus_spec(f"virtual:bridge-{next(_numbers)}", 500_000)
    inside, outside = hub.attach("node"), await open_bus(settings)
    inside.subscribe(ears_inside.on_frame)
    outside.subscribe(ears_outside.on_frame, ears_outside.on_sent)
    bridge, far = await open_bridge(hub.attach("bridge"), settings)
    assert inside.send(Frame(0x100, b"\x01"))
    assert await ears_outside.hear(1) == [Frame(0x100, b"\x01")]
    assert outside.send(Frame(0x200, b"\x02", False))
    assert await ears_inside.hear(1) == [Frame(0x200, b"\x02", False)]
    await ears_outside.hear_sent(1)
    await until(lambda: far.health().sent == 1)
    assert bridge.counts == {"outward": 1, "inward": 1}
    assert ears_inside.frames.empty()
    assert ears_outside.frames.empty()
    await bridge.close()
    await outside.close()
    assert hub.nodes == [inside]


async def test_a_full_side_is_counted() -> None:
    hub = Hub()
    settings = BusSettings("virtual", f"bridge-{next(_numbers)}")
    outside, node = await open_bus(settings), hub.attach("bridge")
    bridge, _ = await open_bridge(node, settings)
    node.refuse = True
    outside.send(Frame(1))
    await until(lambda: bridge.counts["inward_refused"] == 1)
    await bridge.close()
    await outside.close()


def test_specifications() -> None:
    assert parse_bus_spec("socketcan:vcan0", 250_000) == BusSettings("socketcan", "vcan0", 250_000)
    assert parse_bus_spec("socketcand:fleet,port=29536,host=localhost", 1) == BusSettings(
        "socketcand", "fleet", 1, (("host", "localhost"), ("port", 29536))
    )
    assert parse_bus_spec("slcan:/dev/ttyACM0:2", 1).channel == "/dev/ttyACM0:2"


@pytest.mark.parametrize("spec", ["vcan0", "socketcan:", ":vcan0", "", "socketcand:fleet,port", "a:b,1x=2"])
def test_a_mistake_names_the_form(spec: str) -> None:
    with pytest.raises(ValueError, match="INTERFACE:CHANNEL"):
        parse_bus_spec(spec, 500_000)


def test_one_bus_twice_is_a_loop() -> None:
    with pytest.raises(ValueError, match="given twice"):
        parse_bus_specs(["socketcan:vcan0", "socketcan:vcan1", "socketcan:vcan0"], 500_000)


def test_a_machines_device_bus_is_named_before_its_interface() -> None:
    specs = ["socketcan:can0", "MR1=socketcan:can1", "socketcand:fleet,port=29536"]
    joints = parse_bus_specs(specs, 500_000, ["IOC1", "MR1"])
    assert [(joint.machine, joint.settings.channel) for joint in joints] == [
        *((None, "can0"), ("MR1", "can1"), (None, "fleet")),
    ]
    with pytest.raises(ValueError, match="no machine MR2; did you mean"):
        parse_bus_specs(["MR2=socketcan:can1"], 500_000, ["IOC1", "MR1"])
