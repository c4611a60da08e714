"""``hold`` and ``release``: a person has a hand in one machine that moves (row M38; onboard/work/manual.py)."""

from onboard.contract.messages import ManualState, Message
from onboard.core.site import Machine
from onboard.gateway.pauses import Pauses
from onboard.operate.order import DONE, OperatorCommand
from onboard.operate.park import Park
from onboard.operate.words import state_words


class HoldCommand(OperatorCommand):
    """Holds a machine until it says that it has come to rest, or lets it go until it says so.

    ``seed`` begins the numbers of orders, so that another life of this station has others.
    """

    def __init__(self, park: Park, node: int, machine: Machine, *, holds: bool, seed: int) -> None:
        super().__init__(park, node)
        self._machine, self._holds = machine, holds
        self._pauses = Pauses(node, seed)
        self._is_told = False
        self.is_urgent = holds

    def preview(self, now_us: int) -> list[str]:
        """One line: how the machine stands now."""
        return [f"{self._machine.name} {state_words(self.park, self._machine.node_id, now_us)}"]

    @property
    def question(self) -> str:
        """Asked before a machine is let go only: to hold one takes motion away."""
        return "" if self._holds else f"Is nobody in the way of {self._machine.name}, and shall it go on by itself?"

    def begin(self, now_us: int) -> None:
        """Ask the machine to stand, or to go on by itself."""
        super().begin(now_us)
        self._pauses.ask(self._machine.node_id, {"actionType": "startPause" if self._holds else "stopPause"}, now_us)
        self.tell(f"{self._machine.name} is asked to {'stand' if self._holds else 'go on'} under node-ID {self.node}")

    def feed(self, message: Message, now_us: int) -> None:
        """The machine's own word that it is held and stands, or goes on, ends the order."""
        if self.status is not None:
            return
        closed = self._pauses.feed(message, now_us)
        if closed and closed[0][-1]:
            self.tell(f"{self._machine.name}: {closed[0][-1]}")
            self.end([self._machine.name])
        elif closed:
            self.tell(f"{self._machine.name} " + ("is held, and stands" if self._holds else "goes on by itself"))
            self.status = DONE
        elif self._begins_nothing(message):
            self._is_told = True
            self.tell(f"{self._machine.name} has answered: it begins nothing more, and comes to rest")

    def _begins_nothing(self, message: Message) -> bool:
        """Whether it says for the first time that it is held."""
        is_own = isinstance(message, ManualState) and message.sender == self._machine.node_id
        return is_own and self._holds and not self._is_told and self.park.machines[message.sender].is_held

    def wake(self, now_us: int) -> list[Message]:
        """Repeat the request as ``Pauses`` says; give up after ``REST_US``."""
        if self.status is not None:
            return []
        due, closed = self._pauses.wake(now_us)
        self._wake_us = min(self._pauses.due(), default=None)
        if closed or now_us >= self.began_us + REST_US:
            state = state_words(self.park, self._machine.node_id, now_us)
            why = "does not answer" if closed else "has answered, but has not come to rest"
            self.tell(f"{self._machine.name} {why}; it {state}")
            self.end([self._machine.name])
            return []
        return due


#: The longest way to a place where a held robot may stand: a ride and a spur of the largest site, us.
REST_US = 180_000_000
