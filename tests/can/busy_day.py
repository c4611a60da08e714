"""A busy bus with every kind of fault, printed as a log: run as a script in two processes, see test_determinism."""

import random
import sys

from bus_sim.can.faults import parse_fault
from bus_sim.can.node import NodeOptions
from onboard.core.frame import Frame
from tests.can.rig import Rig, ext

FAULTS = (
    "omission:receivers=3|4,probability=0.05,seed=1",
    "duplicate:receivers=N5,probability=0.05,delay_us=700,seed=2",
    "delay:probability=0.02,delay_us=900,seed=3",
    "corruption:probability=0.03,seed=4",
    "corruption:receivers=6,probability=0.02,seed=5",
)


def busy_day(duration_us: int) -> list[str]:
    """Nodes that send by chance and answer each other, one slow, one that comes and goes."""
    rig = Rig(faults=[parse_fault(line) for line in FAULTS])
    lines: list[str] = []
    rig.medium.tap(lambda frame, time_us, sender: lines.append(f"({time_us}) {sender} {describe(frame)}"))
    names = {f"N{index}" for index in range(8)}
    for index, name in enumerate(sorted(names)):
        options = NodeOptions(mailboxes=1 + index % 3, processing_us=400 if index == 7 else 0, receive_queue=4)
        bus = rig.node(name, index, options=options)
        chance = random.Random(index)

        def answer(frame: Frame, time_us: int, bus=bus, index=index) -> None:  # type: ignore[no-untyped-def]  # bound here
            lines.append(f"{time_us} {bus.name} heard {describe(frame)}")
            if frame.data[:1] == bytes((index,)):
                bus.send(ext(0x200 << 8 | index, frame.data[1:] + bytes((255,))))

        bus.subscribe(answer)
        for _ in range(duration_us // 4_000):
            data = bytes((chance.randrange(8),)) + chance.randbytes(chance.randrange(7))
            rig.at(chance.randrange(duration_us), bus, ext(chance.randrange(1 << 20) << 8 | index, data))
    visitor = rig.node("visitor", 99)
    rig.at(duration_us // 4, visitor, ext(0x99))
    rig.loop.at_us(duration_us // 3, lambda _when_us: visitor.power_off())
    rig.run(duration_us + 100_000)
    lines.append(str(rig.medium.statistics()))
    lines += [f"{injector.fault} struck {injector.struck}" for injector in rig.medium.injectors]
    rig.close()
    return lines


def describe(frame: Frame) -> str:
    return f"{'E' if frame.is_error else ''}{frame.arbitration_id:08X}#{frame.data.hex().upper()}"


if __name__ == "__main__":
    sys.stdout.write("\n".join(busy_day(int(sys.argv[1]))) + "\n")
