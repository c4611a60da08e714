"""``onboard operate status``: who lives, who stands and why; it only listens."""

from onboard.contract.codes import Reason
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import Message
from onboard.holon.remedies import reason_words
from onboard.operate.order import DONE, NOT_CONFIRMED, OperatorCommand
from onboard.operate.park import Park
from onboard.operate.words import state_words


class Status(OperatorCommand):
    """Listens for ``listen_us`` and tells; status 1 where a machine is silent or needs a person."""

    is_silent = True

    def __init__(self, park: Park, node: int, listen_us: int) -> None:
        super().__init__(park, node)
        self._listen_us = listen_us

    def begin(self, now_us: int) -> None:
        """Listen for the time asked for; nothing is said on the bus."""
        self.began_us, self._wake_us = now_us, now_us + self._listen_us

    def wake(self, now_us: int) -> list[Message]:
        """Print the lines once the time to listen is over."""
        if self.status is None and self._wake_us is not None and now_us >= self._wake_us:
            for line in status_lines(self.park, now_us):
                self.tell(line)
            self.status = NOT_CONFIRMED if self._in_need(now_us) else DONE
        return []

    def _in_need(self, now_us: int) -> bool:
        words = [self.park.halted(node, now_us) for node in self.park.machines]
        needed = any(word is not None and word.needs_person for word in words)
        return needed or len(self.park.living(now_us)) < len(self.park.machines)


def status_lines(park: Park, now_us: int) -> list[str]:
    """A line for each machine, each blocked segment, each strange node, and what machines dropped."""
    width = max(len(known.machine.name) for known in park.machines.values())
    lines = [_machine_line(park, node, width, now_us) for node in park.machines]
    lines += [f"{segment} is blocked: {reason_words(word.reason)}" for segment, word in sorted(park.blocked.items())]
    for node in sorted(park.others):
        what = "a gateway or tool" if node in park.tools() else "no machine of this site"
        lines.append(f"node {node} is heard: {what}, last with {park.others[node]}")
    for node, counts in sorted(park.dropped.items()):
        drops = ", ".join(f"{reason_words(reason)} {count}" for reason, count in sorted(counts.items()))
        lines.append(f"{park.name(node)} has dropped since its start: {drops}")
    return lines


def _machine_line(park: Park, node: int, width: int, now_us: int) -> str:
    known = park.machines[node]
    where = park.where(node) if known.machine.kind in MOBILE_KINDS and known.heard_us is not None else ""
    beat = known.beat
    epoch = f", epoch {beat.epoch}" if beat is not None and beat.epoch and known.foreign is Reason.NONE else ""
    return (
        f"{known.machine.name:{width}}  {state_words(park, node, now_us)}" + (f", at {where}" if where else "") + epoch
    )
