"""Faults of journals, point by point: at every write of every machine the power fails, and its medium has suffered.

A torn write strikes before the record is durable, all else right after it. A machine that cannot rely on its journal
holds and says so: that counts as told, however many then wait for a person.
"""

from collections.abc import Mapping
from typing import Final

from bus_sim.faults.injection import AnyFault, Injection
from onboard.contract.codes import Reason
from onboard.contract.messages import Halted, Heartbeat, Message

#: Records that are cut off the end, each number of them a point.
MOST_LOST = 50
#: A copy that is so many records old: a few tasks.
ROLLED_BACK = (1, 10, 50)
#: The power is off for so long, s: longer than peers wait for a sign of life, so that they notice.
OFF_S = 5.0
#: What one point does to the medium: the word of a crash, and how many records it is about.
_HARMS: Final[tuple[tuple[str, tuple[int, ...]], ...]] = (
    ("cut", tuple(range(1, MOST_LOST + 1))),
    ("zeroed", (1,)),
    ("flipped", (1,)),
    ("unsealed", (1,)),
    ("foreign", (1,)),
    ("lost", (1,)),
    ("rolled_back", ROLLED_BACK),
)
#: What a machine says of a journal that it cannot rely on.
OF_JOURNALS = frozenset({Reason.JOURNAL_LOST, Reason.JOURNAL_SHORT, Reason.JOURNAL_FOREIGN})
#: The others go on beside a machine that is held for so long, us, and then the trial is over.
HELD_US = 120_000_000


def journal_faults(written: Mapping[str, int], person_s: float = 0.0) -> list[AnyFault]:
    """Every point; ``written`` is how many records each machine writes in the scene, by name.

    With ``person_s`` somebody comes so long after a machine holds, and has its rights made anew.
    """
    found: list[AnyFault] = []
    for name, writes in written.items():
        for write in range(1, writes + 1):
            base: dict[str, str | int | float] = {"target": name, "at_s": 0.0, "restart_s": OFF_S, "write": write}
            base |= {"person_s": person_s} if person_s else {}
            found.append(Injection("crash", {**base, "durable": "no", "journal": "torn"}))
            found += [
                Injection("crash", {**base, "durable": "yes", "journal": how, "entries": entries})
                for how, every in _HARMS
                for entries in every
                if entries <= write
            ]
    return found


class Held:
    """Listens to the fleet bus for machines that hold because of their journals, and need a person.

    A hold is over with the life that says it, and with the epoch: in the next of either the machine says it again, or
    works. So a run is not over because a machine once halted whose disk was full, or whose rights were made anew.
    """

    def __init__(self) -> None:
        #: Since when each is held, us, by node-ID.
        self.since_us: dict[int, int] = {}
        self._lives: dict[int, tuple[int, int]] = {}

    def hear(self, message: Message, time_us: int) -> None:
        """To be told every message of the fleet bus."""
        if isinstance(message, Heartbeat):
            life = (message.boot, message.epoch)
            if self._lives.get(message.sender) != life:
                self._lives[message.sender] = life
                self.since_us.pop(message.sender, None)
        if not isinstance(message, Halted) or message.sender != message.machine:
            # What others say of it is not believed.
            return
        if message.needs_person and message.reason in OF_JOURNALS:
            self.since_us.setdefault(message.machine, time_us)

    def is_over(self, now_us: int) -> bool:
        """Whether somebody is held, and the others have had their time beside it."""
        return bool(self.since_us) and now_us - min(self.since_us.values()) >= HELD_US
