"""What a system's own messages tell, beside those that all systems have.

A system's own is the class ``HISTORY`` of its folder's ``history.py``; whatever shows that system is a view of it.
"""

from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.history.tasks import TaskFold
from onboard.systems.registry import part


class SystemFact:
    """What one of a system's own messages has told; each system has kinds of its own."""

    __slots__ = ()


class SystemHistory:
    """A system without messages of its own."""

    def __init__(self, tasks: TaskFold) -> None:
        #: Of the whole history: some systems order by words of their own, without a call.
        self.tasks = tasks

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Take up one message of the fleet bus, at a time of the log in us; None where it tells nothing of its own."""
        return None


def system_history(site: Site | None, tasks: TaskFold) -> SystemHistory | None:
    """The fold of a site's system; None where there is no site file, or the system has no fold of its own."""
    module = part(site.system, "history") if site is not None else None
    if module is None:
        return None
    found: SystemHistory = module.HISTORY(site, tasks)
    return found
