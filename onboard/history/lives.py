"""Signs of life: when each machine was heard, the state that it told, and what it waits for."""

from onboard.contract.codes import MachineState
from onboard.contract.messages import Heartbeat, Message, Progress, Waiting


class MachineLives:
    """A fold over what machines say of themselves; times in us of the log."""

    def __init__(self) -> None:
        #: The last heartbeat of each machine, and the state in it.
        self.heard_us: dict[int, int] = {}
        self.states: dict[int, MachineState] = {}
        #: Waits that were told and not ended by motion.
        self.waits: dict[int, tuple[int, Waiting]] = {}

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message."""
        match message:
            case Heartbeat():
                self.heard_us[message.sender] = time_us
                self.states[message.sender] = message.state
            case Progress() if message.speed_mm_s:
                self.waits.pop(message.sender, None)
            case Waiting():
                self.waits[message.sender] = time_us, message
