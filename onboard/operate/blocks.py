"""``block`` and ``clear``: a segment that nobody can pass, kept in the journal of its track's steward."""

from onboard.contract.codes import Reason
from onboard.contract.messages import Blocked, Clear, Message, SyncDone, SyncRequest
from onboard.core.site import Segment
from onboard.holon.remedies import reason_words
from onboard.operate.order import AGAIN_US, DONE, OperatorCommand
from onboard.operate.park import Park
from onboard.operate.words import state_words

#: A steward that lives says all that it keeps within this after it was asked, us: a burst of frames.
ANSWER_US = 2_000_000


class Mark(OperatorCommand):
    """Says that a segment is blocked, or clear, and asks the steward of its track what it keeps."""

    def __init__(self, park: Park, node: int, segment: Segment, reason: Reason, *, blocks: bool) -> None:
        super().__init__(park, node)
        self._segment, self._reason, self._blocks = segment, reason, blocks
        self._steward = park.site.stewards[segment.track]
        self._asked_us: int | None = None
        self.is_urgent = blocks

    def preview(self, now_us: int) -> list[str]:
        """Who stands there by its own word."""
        here = str(self._segment)
        return [
            f"{known.machine.name} is at {here} by its last word; it {state_words(self.park, node, now_us)}"
            for node, known in self.park.machines.items()
            if known.heard_us is not None and self.park.where(node) == here
        ]

    @property
    def question(self) -> str:
        """Asked before a segment is cleared only: to block one takes motion away."""
        return "" if self._blocks else f"Is {self._segment} free of persons and things, and shall it be passed again?"

    def begin(self, now_us: int) -> None:
        """Say it to all at once, and tell the person under which node-ID."""
        super().begin(now_us)
        what = f"blocked: {reason_words(self._reason)}" if self._blocks else "clear"
        self.tell(f"{self._segment} is {what}; said to all under node-ID {self.node}")

    def feed(self, message: Message, now_us: int) -> None:
        """The track's steward repeats what it keeps; that it keeps this word ends the order."""
        if message.sender != self._steward or self._asked_us is None or self.status is not None:
            return
        match message:
            case Blocked() | Clear() if Segment(message.track, message.index) == self._segment:
                if isinstance(message, Blocked) is self._blocks:
                    self._kept()
            case SyncDone() if not self._blocks and self._segment not in self.park.blocked:
                self._kept()

    def wake(self, now_us: int) -> list[Message]:
        """Ask the steward for its word where it has not come; give up when the time to confirm is over."""
        if self.status is not None:
            return []
        if self._is_gone(now_us):
            self._kept()
            return []
        if now_us >= self.began_us + self.confirm_us():
            state = state_words(self.park, self._steward, now_us)
            self.tell(f"{self.park.name(self._steward)}, which keeps this track, does not answer; it {state}")
            self.end([self.park.name(self._steward)])
            return []
        self._asked_us = now_us if self._asked_us is None else self._asked_us
        self._wake_us = now_us + AGAIN_US
        word = Blocked if self._blocks else Clear
        self.park.feed(word(self.node, *self._segment, self._reason), now_us)
        return [word(self.node, *self._segment, self._reason), SyncRequest(self.node, self._steward)]

    def _is_gone(self, now_us: int) -> bool:
        """Whether the steward, which lives and was asked, says no word of a block (it may never have heard of one)."""
        if self._blocks or self._asked_us is None or now_us < self._asked_us + ANSWER_US:
            return False
        heard_us = self.park.machines[self._steward].heard_us
        return self._segment not in self.park.blocked and heard_us is not None and heard_us > self._asked_us

    def _kept(self) -> None:
        what = "is blocked, also after a power cut, until clear" if self._blocks else "can be passed again"
        self.tell(f"{self.park.name(self._steward)} keeps it: {self._segment} {what}")
        self.status = DONE
