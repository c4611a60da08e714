from bus_sim.can.bitstream import frame_length_bits
from bus_sim.can.error_frames import CAN_ERR_ACK, CAN_ERR_RESTARTED
from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.can.node import NodeOptions
from onboard.ports.bus import ErrorState
from tests.can.conftest import MakeRig
from tests.can.rig import Rig, ext

BIT_US = 2
FRAME = ext(0x123456, bytes(range(8)))
#: Well inside FRAME.
MIDDLE_US = 100


def test_a_second_sender_of_the_same_frame_carries_it_on(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b").send(FRAME)
    rig.node("c")
    a.send(FRAME)
    rig.run(MIDDLE_US)
    a.power_off()
    rig.run(10_000)
    assert rig.errors() == []
    assert [frame for _time, frame in rig.heard["c"]] == [FRAME]
    assert [len(rig.confirmed[name]) for name in "ab"] == [0, 1]


def test_a_node_that_vanishes_in_the_end_of_frame_has_sent_it(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    a.send(FRAME)
    rig.run((frame_length_bits(FRAME) - 3 - 5) * BIT_US)
    a.power_off()
    rig.run(10_000)
    assert [frame for _time, frame in rig.heard["b"]] == [FRAME]
    assert rig.errors() == []


def test_without_the_only_receiver_a_frame_is_not_acknowledged(rig: Rig) -> None:
    a, b = rig.node("a"), rig.node("b")
    a.send(FRAME)
    rig.run(MIDDLE_US)
    b.power_off()
    rig.run(1_000)
    assert rig.errors()[0][1].arbitration_id & CAN_ERR_ACK
    assert rig.confirmed["a"] == []
    assert a.waiting_to_send == 1


def test_a_node_may_leave_before_its_start_bit_is_over(rig: Rig) -> None:
    a = rig.node("a")
    rig.node("b")
    a.send(FRAME)
    a.power_off()
    rig.run(10_000)
    assert rig.log == []


def switched_off(make_rig: MakeRig, names: str, until_us: int = 50_000) -> Rig:
    """A bus on which the nodes of ``names`` are off, and two that are well."""
    faults = [
        InjectedFault(FaultKind.CORRUPTION, id_value=index, id_mask=0xFF, until_us=until_us)
        for index in range(len(names))
    ]
    rig = make_rig(faults=faults)
    rig.node("well")
    rig.node("listener")
    for index, name in enumerate(names):
        rig.node(name, options=NodeOptions(restart_after_us=None)).send(ext(0x1000 * index << 8 | index))
    rig.run(until_us)
    return rig


def test_two_nodes_recover_each_in_its_own_time(make_rig: MakeRig) -> None:
    rig = switched_off(make_rig, "xy")
    x, y = (next(node for node in rig.medium._nodes if node.name == name) for name in "xy")
    assert x.health().state is y.health().state is ErrorState.BUS_OFF
    begin_us = rig.loop.now_us()
    x.restart()
    rig.run(1_000)
    y.restart()
    y.restart()
    rig.run(50_000)
    back = [time - begin_us for time, frame in rig.errors() if frame.arbitration_id & CAN_ERR_RESTARTED]
    alone_us = 128 * 11 * BIT_US
    assert back[0] == alone_us
    # The other began 1 ms later, and x's frame in between was an interruption as well as a sequence.
    assert alone_us < back[1] - 1_000 + 11 * BIT_US
    assert back[1] <= alone_us + 1_000 + frame_length_bits(FRAME) * BIT_US + 2 * 11 * BIT_US
    assert {frame.arbitration_id & 0xFF for frame in rig.frames()} == {0, 1}


def test_a_node_that_leaves_while_it_recovers_does_not_come_back(make_rig: MakeRig) -> None:
    rig = switched_off(make_rig, "x")
    x = rig.medium._nodes[-1]
    x.restart()
    rig.run(1_000)
    x.power_off()
    rig.run(50_000)
    assert not [frame for _time, frame in rig.errors() if frame.arbitration_id & CAN_ERR_RESTARTED]
    assert rig.frames() == []


def test_a_delayed_restart_waits_first(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[InjectedFault(FaultKind.CORRUPTION, until_us=50_000)])
    rig.node("b")
    rig.node("a", options=NodeOptions(restart_after_us=100_000)).send(FRAME)
    rig.run(300_000)
    off_us, back_us = rig.errors()[-2][0], rig.errors()[-1][0]
    assert back_us == off_us + 100_000 + 128 * 11 * BIT_US
    assert len(rig.confirmed["a"]) == 1
