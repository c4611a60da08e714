"""A bus in one fold: feed it every message of the fleet bus, and let views take what it tells."""

from onboard.contract.messages import Message, TaskReport, TokenGrant, TokenHeld
from onboard.history.calls import BidMade, CallAnswered, CallOpened, Calls
from onboard.history.clock import LoggedBusTime
from onboard.history.lives import MachineLives
from onboard.history.rights import RightsHistory
from onboard.history.tasks import TaskFold, TaskTold

#: Calls and tasks that are kept, so that a picture may stay open for ever: those that are over go first, the oldest of
#: them. A site of 24 machines has fewer than 20 open at a time, and what is asked about was lately.
CALL_LIMIT, TASK_LIMIT = 512, 512
#: What one message has told; most tell nothing of calls and tasks.
Fact = CallOpened | BidMade | CallAnswered | TaskTold


class History:
    """The fold."""

    def __init__(self) -> None:
        self.clock = LoggedBusTime()
        self.lives = MachineLives()
        self.rights = RightsHistory()
        self.calls = Calls(CALL_LIMIT, self.clock)
        self.tasks = TaskFold(TASK_LIMIT)

    def feed(self, message: Message, time_us: int) -> Fact | None:
        """Take up one message, at a time of the log in us."""
        self.lives.feed(message, time_us)
        if isinstance(message, TokenGrant | TokenHeld):
            self.rights.feed(message)
        if isinstance(message, TaskReport):
            self.calls.feed(message, time_us)
            return self.tasks.on_report(message, time_us)
        fact = self.calls.feed(message, time_us)
        match fact:
            case CallOpened():
                self.tasks.on_call(fact)
            case CallAnswered():
                self.tasks.on_answer(fact)
        return fact
