"""``stop`` and ``go``: all machines stand, and go on again (docs/protocol.md).

A stop counts until 30 s after it was last heard, so it is said as long as it shall hold. This bus is no safety channel.
"""

from onboard.contract.codes import MachineState, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import EmergencyStop, Go, Halted, Heartbeat, Message
from onboard.core.site import Machine
from onboard.operate.order import AGAIN_US, DONE, NOT_CONFIRMED, OperatorCommand
from onboard.operate.park import Park
from onboard.operate.words import halted_words, state_words

#: How long a stop that is no longer said still holds, us (docs/protocol.md).
LASTS_US = 30_000_000


class StopCommand(OperatorCommand):
    """Says EmergencyStop each second: until all have answered and ``keep_us`` are over, None for ever."""

    is_urgent = True

    def __init__(self, park: Park, node: int, keep_us: int | None = None) -> None:
        super().__init__(park, node)
        self._keep_us = keep_us
        self._waited = set(park.machines)
        self._is_told = False

    def begin(self, now_us: int) -> None:
        """Say the stop to all at once, and tell the person under which node-ID."""
        super().begin(now_us)
        self.tell(f"stop: said to all under node-ID {self.node}")

    def feed(self, message: Message, now_us: int) -> None:
        """Who stands says so; a Go of another tool that lifts this stop ends it."""
        match message:
            case Halted() if message.sender == message.machine and message.reason is Reason.EMERGENCY_STOP:
                self._answered(message.sender)
            case Heartbeat() if message.state is MachineState.STOPPED:
                self._answered(message.sender)
            case Go() if message.stopper in (NOBODY, self.node):
                self.tell(f"{self.park.name(message.sender)} has lifted this stop")
                self._finish()

    def wake(self, now_us: int) -> list[Message]:
        """Say the stop again for as long as it shall hold, and tell once who has confirmed it."""
        if self.status is not None:
            return []
        if not self._is_told and (not self._waited or now_us >= self.began_us + self.confirm_us()):
            self._tell_result(now_us)
        if self._is_told and self._keep_us is not None and now_us >= self.began_us + self._keep_us:
            self._finish()
            self.tell(f"the stop holds for {LASTS_US // 1_000_000} s more; onboard operate go lifts it")
            return []
        self._wake_us = now_us + AGAIN_US
        return [EmergencyStop(self.node, Reason.OPERATOR)]

    def interrupt(self, now_us: int) -> list[Message]:
        """Say it no longer: it then holds for ``LASTS_US`` more."""
        self._finish()
        self.tell(f"no longer said: the stop holds for {LASTS_US // 1_000_000} s more; onboard operate go lifts it")
        return []

    def _answered(self, node: int) -> None:
        if node in self._waited:
            self._waited.discard(node)
            self.tell(f"{self.park.name(node)} holds by it")

    def _tell_result(self, now_us: int) -> None:
        self._is_told = True
        for node in sorted(self._waited):
            self.tell(f"{self.park.name(node)} has NOT said that it holds; it {state_words(self.park, node, now_us)}")
        if self._keep_us is None:
            self.tell("all hold" if not self._waited else "go and see")
            self.tell("the stop is said on until Ctrl-C, or until another tool says go")

    def _finish(self) -> None:
        names = [self.park.name(node) for node in sorted(self._waited)]
        if self.status is None:
            self.end(names)


class GoAgain(OperatorCommand):
    """Lifts the stop of node ``stopper``, 0 for all; each machine that held by it has to be heard without it."""

    def __init__(self, park: Park, node: int, stopper: int = NOBODY) -> None:
        super().__init__(park, node)
        self._stopper = stopper
        self._waited: set[int] = set()

    def preview(self, now_us: int) -> list[str]:
        """Who stands and why: what this lifts, and what it does not."""
        lines = [
            f"{known.machine.name} {state_words(self.park, node, now_us)}"
            for node, known in self.park.machines.items()
            if self.park.halted(node, now_us) is not None or not self.park.lives(node, now_us)
        ]
        standing = self._standing(now_us)
        if not standing:
            lines.append("no machine says that it stands by an emergency stop" + self._of())
        return lines

    @property
    def question(self) -> str:
        """Asked always: machines begin to move afterwards."""
        return f"Is nobody in the machines' way, and shall the emergency stop{self._of()} be lifted?"

    def begin(self, now_us: int) -> None:
        """Say ``Go`` to all, and wait for those that stand now."""
        super().begin(now_us)
        self._waited = self._standing(now_us)
        self.tell(f"go{self._of()}: said under node-ID {self.node}")

    def feed(self, message: Message, now_us: int) -> None:
        """Somebody who still says stop undoes it; another ``stop`` of this tool ends when it hears the first Go."""
        is_stop = isinstance(message, EmergencyStop) and self._stopper in (NOBODY, message.sender)
        if is_stop and self.status is None and now_us > self.began_us + AGAIN_US:
            self.tell(f"{self.park.name(message.sender)} still says stop: end it there first")
            self.status = NOT_CONFIRMED

    def wake(self, now_us: int) -> list[Message]:
        """Tell of each machine that goes on; give up on the others when the time to confirm is over."""
        if self.status is not None:
            return []
        for node in sorted(self._waited):
            if self._goes_on(node, now_us):
                self._waited.discard(node)
                word = self.park.halted(node, now_us)
                self.tell(f"{self.park.name(node)} {halted_words(self.park, word) if word else 'goes on'}")
        said_once = now_us > self.began_us
        if said_once and not self._waited:
            self.status = DONE
            return []
        if now_us >= self.began_us + self.confirm_us():
            for node in sorted(self._waited):
                self.tell(f"{self.park.name(node)} {state_words(self.park, node, now_us)}")
            self.end(self.park.name(node) for node in sorted(self._waited))
            return []
        self._wake_us = now_us + AGAIN_US
        return [Go(self.node, self._stopper)]

    def _standing(self, now_us: int) -> set[int]:
        return {node for node in self.park.machines if self._is_stopped(self.park.halted(node, now_us))}

    def _is_stopped(self, word: Halted | None) -> bool:
        """Whether a machine stands by what this lifts."""
        if word is None or word.reason is not Reason.EMERGENCY_STOP:
            return False
        return self._stopper in (NOBODY, word.cause)

    def _goes_on(self, node: int, now_us: int) -> bool:
        """Whether it was heard since, and does not say any more that it stands by this."""
        known = self.park.machines[node]
        return known.beat_us > self.began_us and not self._is_stopped(self.park.halted(node, now_us))

    def _of(self) -> str:
        return f" of {self.park.name(self._stopper)}" if self._stopper else ""


class LetGo(GoAgain):
    """Lets one machine go on that holds until a person says so: Go under its own number (docs/protocol.md)."""

    def __init__(self, park: Park, node: int, machine: Machine) -> None:
        super().__init__(park, node, machine.node_id)

    def preview(self, now_us: int) -> list[str]:
        """One line: how the machine stands now, and why."""
        return [f"{self.park.name(self._stopper)} {state_words(self.park, self._stopper, now_us)}"]

    @property
    def question(self) -> str:
        """Asked always: the machine begins to move afterwards."""
        name = self.park.name(self._stopper)
        return f"Is what made {name} hold put right, is nobody in its way, and shall it go on?"

    def _is_stopped(self, word: Halted | None) -> bool:
        return word is not None and word.machine == self._stopper and word.reason is not Reason.EMERGENCY_STOP
