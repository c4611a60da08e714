"""A command by hand: messages and times in, messages and lines out, without a bus."""

from collections.abc import Sequence

from bus_sim.sites import find_site
from onboard.contract.codes import CONTRACT_VERSION, MachineState, Reason
from onboard.contract.messages import Halted, Heartbeat, Message
from onboard.operate.commands import Maker
from onboard.operate.order import OperatorCommand
from onboard.operate.park import Park

SITE = find_site("small")
ALL = tuple(SITE.machines)
SECOND = 1_000_000


class Hand:
    """One order and its park; time only goes on by ``turn``."""

    def __init__(self, make: Maker, before: Sequence[Message] = ()) -> None:
        self.park, self.now_us = Park(SITE), SECOND
        for message in before:
            self.park.feed(message, self.now_us)
        self.order: OperatorCommand = make(self.park, 251)
        self.said: list[Message] = []
        self.lines: list[str] = []

    def is_over(self) -> bool:
        return self.order.status is not None

    def begin(self) -> "Hand":
        self.order.begin(self.now_us)
        return self

    def hear(self, *messages: Message) -> None:
        for message in messages:
            self.park.feed(message, self.now_us)
            self.order.feed(message, self.now_us)

    def turn(self, seconds: float, *beats: Message) -> None:
        """Let so long pass; ``beats`` are heard once in each second."""
        for _ in range(round(seconds)):
            due_us = self.order.next_wake()
            if due_us is not None and due_us <= self.now_us:
                self.said += self.order.wake(self.now_us)
            self.now_us += SECOND
            self.hear(*beats)
            self.lines += self.order.news()

    def all(self, kind: type[Message]) -> list[Message]:
        return [one for one in self.said if isinstance(one, kind)]


def beat(node: int, state: MachineState = MachineState.IDLE, boot: int = 1) -> Heartbeat:
    return Heartbeat(node, CONTRACT_VERSION, SITE.digest, 0, boot, SITE.machines[node].kind, state)


def halted(node: int, reason: Reason, cause: int = 0, *, needs_person: bool = False) -> Halted:
    return Halted(node, node, reason, cause, needs_person, 1)
