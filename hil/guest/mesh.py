"""One CAN bus between several network namespaces, so that every node can be unplugged by itself. Runs in the guest.

Each node has a namespace with ``can0`` in it; its peer outside carries the node's name, and every two peers are joined
by the kernel's CAN gateway (Linux Documentation/networking/can.rst; can-utils' ``cangw``). A frame arrives once at each
other node. A central ``vcan`` would send every frame round for ever.
"""

import subprocess
from collections.abc import Sequence
from itertools import permutations

#: The length of a burst that the controllers may queue at once; the kernel's 10 overruns.
QUEUE_LENGTH = 1000
#: Interface numbers outside that no namespace has inside. A frame keeps the number of the interface that it was sent
#: on, and the gateway sends none out where that number is the same: the node behind interface 2 would be deaf.
FIRST_INDEX = 100


def run(*words: str) -> str:
    """Run a program to its end; its standard output. Raises ``RuntimeError`` with its words where it fails."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: status {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def inside(name: str) -> list[str]:
    """The words before a command that run it in the namespace of this node."""
    return ["ip", "netns", "exec", name]


class Mesh:
    """A bus of virtual CAN interfaces. Names are those of interfaces as well: 15 bytes at the most."""

    def __init__(self, names: Sequence[str]) -> None:
        """Make the namespaces and join them. Raises ``RuntimeError``."""
        for number, name in enumerate(names, start=FIRST_INDEX):
            run("ip", "netns", "add", name)
            peer = ["peer", "name", "can0", "netns", name]
            run("ip", "link", "add", "name", name, "index", str(number), "type", "vxcan", *peer)
            bring_up(name, "can0")
            self.plug(name)
        for one, other in permutations(names, 2):
            run("cangw", "-A", "-s", one, "-d", other)

    def plug(self, name: str) -> None:
        """Join this node with the bus, as at the beginning."""
        run("ip", "link", "set", name, "txqueuelen", str(QUEUE_LENGTH), "up")

    def unplug(self, name: str) -> None:
        """Take this node off the bus: it neither hears nor is heard, and its own interface sees no carrier."""
        run("ip", "link", "set", name, "down")


def hand_out_boards(names: Sequence[str], bitrate: int) -> None:
    """Give each node a namespace with one of the guest's CAN controllers as ``can0``, in the order of their numbers.

    Brings them up with this bit rate, as on a board: restart after bus-off in 100 ms, a queue of ``QUEUE_LENGTH``.
    Raises ``RuntimeError``.
    """
    for number, name in enumerate(names):
        run("ip", "netns", "add", name)
        run("ip", "link", "set", f"can{number}", "netns", name, "name", "can0")
        run("ip", "-n", name, "link", "set", "can0", "type", "can", "bitrate", str(bitrate), "restart-ms", "100")
        bring_up(name, "can0")


def join_pair(one: str, channel: str, other: str, other_channel: str) -> None:
    """A bus of two nodes between two namespaces."""
    peer = ["peer", "name", other_channel, "netns", other]
    run("ip", "-n", one, "link", "add", channel, "type", "vxcan", *peer)
    bring_up(one, channel)
    bring_up(other, other_channel)


def bring_up(name: str, channel: str) -> None:
    """Switch an interface of a namespace on."""
    run("ip", "-n", name, "link", "set", channel, "txqueuelen", str(QUEUE_LENGTH), "up")
