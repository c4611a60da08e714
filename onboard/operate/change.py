"""``change-site``: a new site file is rolled out while the site works (onboard/holon/site_change.py)."""

from onboard.contract.change import ChangePhase, SiteNext
from onboard.contract.codes import MachineState
from onboard.contract.messages import Message
from onboard.operate.order import DONE, NOT_CONFIRMED, OperatorCommand
from onboard.operate.park import Park

#: The change is announced so often, us: machines forget it after five of these.
EVERY_US = 2_000_000
#: States of machines that do not take part.
_NOT_YET = (MachineState.STARTING, MachineState.OBSTACLE, MachineState.STOPPED)


class ChangeCommand(OperatorCommand):
    """Announces a site file beside the one that it follows, of digest ``old``, until every machine takes part by it.

    The park is that of the new file. Who starts the machines again is a person, or what deploys their files.
    """

    def __init__(self, park: Park, node: int, *, old: int) -> None:
        super().__init__(park, node)
        self._old = old
        #: Machines that count both, and machines that take part by the new file.
        self._counting: set[int] = set()
        self._changed: set[int] = set()
        self._starting: set[int] = set()

    def preview(self, now_us: int) -> list[str]:
        """One line a machine: which file it has."""
        words = {self._old: "has the old file", self.park.site.digest: "has the new file"}
        lines = []
        for node, known in self.park.machines.items():
            beat = known.beat
            is_silent = beat is None or not self.park.lives(node, now_us)
            state = "is not heard" if is_silent or beat is None else words.get(beat.site_digest, "has another file")
            lines.append(f"{known.machine.name} {state}")
        return lines

    @property
    def question(self) -> str:
        """Asked always: a machine that is added must stand where nobody comes to."""
        site = self.park.site
        return (
            f"Shall machines of {site.name} {self._old:04X} and {site.digest:04X} count as one site, "
            "and does every machine that is added stand where a segment is blocked, or nobody comes to?"
        )

    def begin(self, now_us: int) -> None:
        """Announce it, and tell the person what is to be done meanwhile."""
        super().begin(now_us)
        self.tell("announced: give each machine the new file and start it again, one after the other, added ones last")

    def feed(self, message: Message, now_us: int) -> None:
        """Who counts both, and who takes part by the new file; with the last of these it is over."""
        if self.status is not None or message.sender not in self.park.machines:
            return
        name, node, new = self.park.name(message.sender), message.sender, self.park.site.digest
        if node not in self._counting and isinstance(message, SiteNext) and message.change_phase is ChangePhase.HEARD:
            self._counting.add(node)
            self.tell(f"{name} counts both")
        beat = self.park.machines[node].beat
        is_starting = beat is not None and beat.state is MachineState.STARTING
        if is_starting and node not in self._starting:
            # It does not know of the change, and takes whoever has the other file for a stranger until it hears.
            self._wake_us = now_us
        self._starting = self._starting | {node} if is_starting else self._starting - {node}
        takes_part = beat is not None and beat.site_digest == new and beat.state not in _NOT_YET
        if not takes_part:
            self._changed.discard(node)
        elif node not in self._changed:
            self._changed.add(node)
            left = [self.park.name(one) for one in self.park.machines if one not in self._changed]
            self.tell(f"{name} takes part by the new file" + (f"; to come: {', '.join(left)}" if left else ""))
            self._wake_us = self._wake_us if left else now_us

    def wake(self, now_us: int) -> list[Message]:
        """The announcement; once all take part by the new file, that it is over."""
        if self.status is not None:
            return []
        is_over = len(self._changed) == len(self.park.machines)
        self._wake_us = now_us + EVERY_US
        if is_over:
            self.tell("all machines take part by the new file")
            self.status = DONE
        return [self._word(ChangePhase.OVER if is_over else ChangePhase.ANNOUNCED)]

    def interrupt(self, now_us: int) -> list[Message]:
        """Said no more: after ten seconds machines of different files are strangers again."""
        left = [self.park.name(node) for node in self.park.machines if node not in self._changed]
        self.tell(f"broken off; not on the new file: {', '.join(left) or 'nobody'}; give the command again to go on")
        self.status = NOT_CONFIRMED
        return []

    def _word(self, phase: ChangePhase) -> SiteNext:
        return SiteNext(self.node, self._old, self.park.site.digest, phase)
