"""What every step of a commissioning works with."""

from dataclasses import dataclass

from hil.commission.listener import CommissionListener
from hil.commission.person import Person
from hil.commission.protocol import Protocol, StepVerdict
from onboard.contract.messages import DriveState, Message
from onboard.core.serial import successor
from onboard.core.site import Machine, Site

#: Devices tell how they stand at least this often, s, and a little more (dbc/device.dbc).
REPEAT_S = 12.0


@dataclass
class CommissionSetting:
    """The new machine, its buses, the person, and the protocol so far."""

    site: Site
    machine: Machine
    fleet: CommissionListener
    devices: CommissionListener
    person: Person
    protocol: Protocol
    _sequence: int = 0

    def sequence(self) -> int:
        """A number for the next order to a door or a desk, which takes any other than its last for a new one."""
        self._sequence = successor(self._sequence, 8)
        return self._sequence

    def note(self, step: str, detail: str, *, passed: bool) -> bool:
        """Add a line to the protocol and tell the person; answers ``passed``."""
        verdict = StepVerdict.PASSED if passed else StepVerdict.FAILED
        self.protocol.note(step, verdict, detail)
        self.person.tell(f"  {verdict.value}: {step}: {detail}")
        return passed

    def leave_out(self, step: str, why: str) -> None:
        """A step that was not done."""
        self.protocol.note(step, StepVerdict.NOT_DONE, why)
        self.person.tell(f"  {StepVerdict.NOT_DONE.value}: {step}: {why}")

    def is_own(self, message: Message) -> bool:
        """Whether a message is of the new machine, or of its devices."""
        return message.sender == self.machine.node_id

    def position(self) -> DriveState | None:
        """What the drive said last."""
        said = [one for _, one in self.devices.heard if isinstance(one, DriveState) and self.is_own(one)]
        return said[-1] if said else None
